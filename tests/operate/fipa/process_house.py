"""`roco fipa` as a process over a real router, between doors of agents in this one."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from agent_runtime.core.wiring import Wiring
from agent_runtime.io.guests import Asked, Door
from agent_runtime.io.inbox import Inbox
from agent_runtime.io.reaching import free_port
from agent_runtime.io.sessions import close, free_endpoint, open_client, open_links, open_router
from agent_runtime.io.zenoh_wire import ZenohWire
from companion.design import DESIGN, LANGUAGES, wiring
from companion.languages import wm
from companion.languages.cmd import TaskReport, TaskState
from fipa_codec.acl_string import Aid
from fipa_codec.performatives import Performative as P

SYSTEM = "lab"


class Agent:
    """The door of an agent at the router; `asked`: what reached it."""

    def __init__(self, name: str, endpoint: str) -> None:
        self.asked: list[Asked] = []
        wires: Wiring = wiring(name, SYSTEM)
        self._wire = ZenohWire(open_links(free_endpoint(), ()), wires, 1, Inbox())
        session = open_client(endpoint, lambda: False)
        assert session is not None
        self._wire.join(session)
        self.door = Door(DESIGN, LANGUAGES, name, self._wire, self._asked)  # type: ignore[arg-type]

    def _asked(self, asked: Asked) -> None:
        if asked.content is not None:
            known = isinstance(asked.content, wm.Query)
            self.door.say(
                asked.conversation,
                P.INFORM_REF if known else P.AGREE,
                wm.Objects(()) if known else TaskReport(TaskState.WAITING),
            )
        self.asked.append(asked)

    def close(self) -> None:
        """It is gone, with all that it knew."""
        self._wire.close()


class House:
    """Router, agents, and the gateway where it listens."""

    def __init__(self, run: Path) -> None:
        self.run, self.endpoint = run, free_endpoint()
        self._router = open_router(self.endpoint)
        self.hi, self.km = Agent("hi", self.endpoint), Agent("km", self.endpoint)
        self.scheme, self.place = "http", f"127.0.0.1:{free_port()}"
        self.gateway: subprocess.Popen[str] | None = None
        self.process_error = run / "stderr"

    @property
    def url(self) -> str:
        """Where the gateway takes messages."""
        return f"{self.scheme}://{self.place}/acc"

    def start(self, *words: str) -> None:
        """Start the gateway; return when it serves."""
        told = {"CONNECT": self.endpoint, "SYSTEM": SYSTEM, "RUN_DIR": str(self.run)}
        with self.process_error.open("a") as errors:
            self.gateway = subprocess.Popen(
                [sys.executable, "-m", "console", "fipa", "--at", self.place, "--format", "json",
                 *words],
                env=os.environ | {f"ROCO_{name}": value for name, value in told.items()},
                stdout=subprocess.PIPE, stderr=errors, text=True,
            )  # fmt: skip
        assert self.gateway.stdout is not None
        line = self.gateway.stdout.readline()
        assert line, self.process_error.read_text()
        assert json.loads(line) == {"url": self.url, "agents": [f"hi@{SYSTEM}", f"km@{SYSTEM}"]}

    def kill(self) -> None:
        """kill -9."""
        assert self.gateway is not None
        self.gateway.kill()
        self.gateway.communicate(timeout=20.0)

    def aid(self, agent: str) -> Aid:
        """As others name one of ours."""
        return Aid(f"{agent}@{SYSTEM}", (self.url,))

    def close(self) -> None:
        """End all that runs."""
        if self.gateway is not None:
            self.kill()
        for one in (self.hi, self.km):
            one.close()
        close(self._router)

    def log(self) -> list[dict[str, object]]:
        """What the gateway told."""
        lines = (self.run / "logs/fipa.jsonl").read_text().splitlines()
        return [json.loads(line) for line in lines]


@contextmanager
def house_at(run: Path) -> Iterator[House]:
    """One that ends."""
    made = House(run)
    try:
        yield made
    finally:
        made.close()

"""A real router and agents as processes on free loopback ports; waits are for conditions, with a
deadline.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.core.agent import Agent
from agent_runtime.core.state import restored
from agent_runtime.io.heartbeat import Heartbeat
from agent_runtime.io.journal import last_record
from agent_runtime.io.options import AGENTS_VARIABLE, LISTEN_VARIABLE
from agent_runtime.io.reaching import free_port

DEADLINE_S = 30.0
GARBAGE = (b"", b"garbage", b"\xc1" * 100, msgspec.msgpack.encode({"V": "request"}))
"""No communicates."""
TOY = Path(__file__).with_name("toy_process.py")


def wait_for(condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Look every 20 ms until the condition holds."""
    end = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end, f"not in {deadline_s} s: {what}"
        time.sleep(0.02)


def service(module: str, log: Path, **variables: object) -> "subprocess.Popen[bytes]":
    """Start a service with these variables of the environment; its output goes to a log."""
    told = os.environ | {f"ROCO_{name}": str(value) for name, value in variables.items()}
    with log.open("ab") as file:
        command = [sys.executable, "-m", f"services.{module}"]
        return subprocess.Popen(command, env=told, stdout=file, stderr=file)


@contextmanager
def serving(
    module: str, run: Path, end_s: float = DEADLINE_S, **variables: object
) -> Iterator[None]:
    """A service that is ready; it must end in order."""
    process = service(module, run / f"{module}.log", RUN_DIR=run, **variables)
    wait_for((run / f"{module}.ready").exists, f"the {module} is ready")
    yield
    process.send_signal(signal.SIGTERM)
    assert process.wait(end_s) == 0, (run / f"{module}.log").read_text()


def journalled(run: Path, agent: Agent[Any], record: bytes | None = None) -> Any:
    """The memory in a record, else in the last one of the agent's journal; the first memory where
    there is none yet.
    """
    path = run / "journal" / f"{agent.name}.journal"
    record = record or (last_record(path.read_bytes()) if path.exists() else None)
    return agent.memory if record is None else restored(agent, record).memory


class Fleet:
    """Processes of one run folder by name. `endpoint`: the router's; `agents`: those of the agents,
    linked directly.
    """

    def __init__(
        self,
        run: Path,
        script: Path = TOY,
        agents: Sequence[str] = ("asker", "server"),
        *,
        scheme: str = "tcp",
    ) -> None:
        self.run, self.script = run, script
        self.endpoint, *others = (
            f"{scheme}/127.0.0.1:{free_port()}" for _ in range(1 + len(agents))
        )
        self.agents = dict(zip(agents, others, strict=True))
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.closing = ExitStack()
        """What is closed at the end, also where a test fails: with a session open, this process
        would not end.
        """

    def start(self, *names: str) -> None:
        """Start processes (router, agents of the script) side by side, each with its output in a
        log.
        """
        for name in names:
            command = [sys.executable, str(self.script), name, self.endpoint, str(self.run)]
            if name == "router":
                command = [sys.executable, "-m", "services.router"]
            at = ",".join(f"{agent}={endpoint}" for agent, endpoint in self.agents.items())
            environment = os.environ | {
                "ROCO_RUN_DIR": str(self.run),
                LISTEN_VARIABLE: self.endpoint if name == "router" else "",
                AGENTS_VARIABLE: at,
            }
            with (self.run / f"{name}.log").open("ab") as log:
                self.processes[name] = subprocess.Popen(
                    command, env=environment, stdout=log, stderr=log
                )

    def ready(self, *names: str) -> None:
        """Wait until these say that they are ready."""
        for name in names:
            self.wait((self.run / f"{name}.ready").exists, f"{name} is ready")

    def wait(
        self, condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S
    ) -> None:
        """Wait with a deadline; the output of all is told where it passes."""
        try:
            wait_for(condition, what, deadline_s)
        except AssertionError as error:
            raise AssertionError(f"{error}\n{self.logs()}") from None

    def kill(self, name: str) -> None:
        """kill -9."""
        self.processes[name].kill()
        self.processes.pop(name).wait()
        (self.run / f"{name}.ready").unlink(missing_ok=True)

    def stop(self, name: str) -> int:
        """SIGTERM; the exit status."""
        process = self.processes.pop(name)
        process.send_signal(signal.SIGTERM)
        return process.wait(DEADLINE_S)

    def end(self) -> None:
        """Kill what still runs, and close what was opened with it."""
        self.closing.close()
        for name in list(self.processes):
            self.kill(name)

    def want(self, *numbers: int) -> None:
        """Words for the asker."""
        with (self.run / "want").open("a") as file:
            file.writelines(f"{number}\n" for number in numbers)

    def beat(self, name: str) -> Heartbeat:
        """The agent's last heartbeat."""
        file = self.run / f"{name}.heartbeat.json"
        return msgspec.json.decode(file.read_bytes(), type=Heartbeat)

    def beats_on(self, name: str) -> None:
        """Wait for its next heartbeat."""
        file = self.run / f"{name}.heartbeat.json"
        last = file.stat().st_mtime_ns
        self.wait(lambda: file.stat().st_mtime_ns > last, f"{name} beats on")

    def logs(self) -> str:
        """Return the output of all processes."""
        return "\n".join(
            f"--- {log.name}\n{log.read_text()[-3000:]}" for log in sorted(self.run.glob("*.log"))
        )

"""Processes of the companion with keys, and their router: addresses and keys stand in the
environment.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from toy_fleet import Fleet as Processes

from agent_runtime.io import issuing
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import client_config
from companion.design import DESIGN
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet

SYSTEM = "roco"
SERVICES = {
    "co": "coordinator", "hi": "human_interface", "pl": "planner", "monitor": "monitor",
}  # fmt: skip


def secured(run: Path, monkeypatch: pytest.MonkeyPatch) -> Processes:
    """A run folder with keys and the file that tells the addresses; nothing runs yet."""
    made = Processes(run, agents=tuple(DESIGN.agents), scheme="tls")
    issuing.issue(run / KEYS_FOLDER, DESIGN, (SYSTEM,))
    keys = {"TLS_DIR": run / KEYS_FOLDER, "SYSTEM": SYSTEM}
    for name, value in {"CONNECT": made.endpoint, "RUN_DIR": run, **keys}.items():
        monkeypatch.setenv(f"ROCO_{name}", str(value))
    fleet = Fleet(SYSTEM, made.endpoint, 0, 0.0, processes=(), agents=made.agents)
    (run / FLEET_FILE).write_bytes(msgspec.json.encode(fleet))
    return made


def session(fleet: Processes, identity: str, to: str = "") -> zenoh.Session:
    """A session with the keys of this identity, with the agent `to`, else with the router."""
    at = fleet.agents[to] if to else fleet.endpoint
    return zenoh.open(client_config(at, client_tls(fleet.run / KEYS_FOLDER, identity)))


class KeyHolder:
    """Whoever holds the keys of an identity, linked with co: it puts, hears and declares lives."""

    def __init__(self, fleet: Processes, identity: str) -> None:
        self.session = session(fleet, identity, "co")
        self._declared: list[object] = []
        fleet.closing.callback(self.close)

    def put(self, key: str, data: bytes, attachment: bytes | None = None) -> None:
        """Put on a key of the system; nothing is dropped for want of room."""
        block = zenoh.CongestionControl.BLOCK
        at = f"roco/{SYSTEM}/{key}"
        self.session.put(at, data, congestion_control=block, attachment=attachment)

    def hears(self, key: str, then: Callable[[bytes], object] | None = None) -> list[bytes]:
        """Return what will have come on keys of the system; `then`: called with each."""
        heard: list[bytes] = []

        def take(sample: zenoh.Sample) -> None:
            heard.append(sample.payload.to_bytes())
            if then is not None:
                then(heard[-1])

        self._declared.append(self.session.declare_subscriber(f"roco/{SYSTEM}/{key}", take))
        return heard

    def lives(self, life: object) -> None:
        """Declare the token of a life of hi."""
        token = self.session.liveliness().declare_token(f"roco/{SYSTEM}/_/alive/hi/{life}")
        self._declared.append(token)

    def close(self) -> None:
        """End the session."""
        self._declared.clear()
        self.session.close()  # type: ignore[no-untyped-call]


def serve(fleet: Processes, *names: str) -> None:
    """Start services as the processes of these names."""
    for name in names:
        module = f"services.{SERVICES[name]}"
        path = fleet.run / f"{module}.py"
        path.write_text(
            f"import runpy, sys\nsys.argv = ['{module}']\nrunpy.run_module('{module}',"
            " run_name='__main__')\n"
        )
        before, fleet.script = fleet.script, path
        fleet.start(name)
        fleet.script = before


def serve_linked(fleet: Processes, name: str) -> None:
    """Start an agent; it listens, and is at the router."""
    serve(fleet, name)
    beat = fleet.run / f"{name}.heartbeat.json"
    fleet.wait(lambda: beat.exists() and fleet.beat(name).up, f"{name} lives")


def logged(fleet: Processes, name: str, event: str = "") -> list[dict[str, Any]]:
    """The lines of an agent's log, perhaps only those of an event."""
    lines = (fleet.run / "logs" / f"{name}.jsonl").read_text().splitlines()
    return [line for line in map(json.loads, lines) if event in ("", line["event"])]

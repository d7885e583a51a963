"""Processes of the companion with keys, and their router: addresses and keys stand in the
environment.
"""

from pathlib import Path

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


def secured(run: Path, monkeypatch: pytest.MonkeyPatch) -> Processes:
    """A run folder with keys and the file that tells the addresses; nothing runs yet."""
    made = Processes(run, agents=tuple(DESIGN.agents), scheme="tls")
    issuing.issue(run / KEYS_FOLDER, DESIGN, (SYSTEM,))
    told = {
        "CONNECT": made.endpoint,
        "RUN_DIR": run,
        "TLS_DIR": run / KEYS_FOLDER,
        "SYSTEM": SYSTEM,
    }
    for name, value in told.items():
        monkeypatch.setenv(f"ROCO_{name}", str(value))
    fleet = Fleet(
        system=SYSTEM,
        connect=made.endpoint,
        supervisor=0,
        started=0.0,
        processes=(),
        agents=made.agents,
    )
    (run / FLEET_FILE).write_bytes(msgspec.json.encode(fleet))
    return made


def session(fleet: Processes, identity: str, to: str = "") -> zenoh.Session:
    """A session with the keys of this identity, with the agent `to`, else with the router."""
    at = fleet.agents[to] if to else fleet.endpoint
    return zenoh.open(client_config(at, client_tls(fleet.run / KEYS_FOLDER, identity)))


def serve(fleet: Processes, name: str, module: str) -> None:
    """Start a service as the process of this name."""
    path = fleet.run / f"{module}.py"
    path.write_text(
        f"import runpy, sys\nsys.argv = ['{module}']\nrunpy.run_module('{module}',"
        " run_name='__main__')\n"
    )
    before, fleet.script = fleet.script, path
    fleet.start(name)
    fleet.script = before


def listens(fleet: Processes, name: str) -> bool:
    """Whether an agent listens, and is at the router."""
    beat = fleet.run / f"{name}.heartbeat.json"
    return beat.exists() and fleet.beat(name).up


def end(fleet: Processes) -> None:
    """Kill whatever still runs."""
    for name in list(fleet.processes):
        fleet.kill(name)

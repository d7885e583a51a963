"""`roco doctor` on ports that are set: another program has one, before a fleet is up and while it
runs.
"""

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

from agent_runtime.io.run_files import FLEET_VARIABLE, RUN_FOLDER_VARIABLE
from companion.tools.verbs.checkup import CHECKS
from console.errors import NoRunError
from console.fleet import view
from console.fleet.checkup import Level, pictures
from console.fleet.local import Local
from console.fleet.status import GRPC, SWITCH, WEB, state_of
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

pytestmark = pytest.mark.process


@pytest.fixture
def port() -> Iterator[int]:
    """A port at which another program listens."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        yield int(other.getsockname()[1])


@pytest.mark.parametrize("variable", [GRPC, WEB, "ROCO_HTTP", "ROCO_PAGE"])
def test_a_set_port_that_is_taken(
    variable: str, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before the fleet is up; the variable and the port are named."""
    monkeypatch.setenv(variable, str(port) if variable in (GRPC, WEB) else f"127.0.0.1:{port}")
    wrong = [check for check in CHECKS.machine["ports"]() if check.level is Level.WRONG]
    assert [check.what for check in wrong] == [
        f"{variable}: another program listens at port {port}"
    ]


def test_a_set_port_of_a_fleet_in_any_folder(
    port: int, called: Callable[..., int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No other program's: the fleet is named, and says itself what is wrong with the port."""
    monkeypatch.setenv("ROCO_HTTP", f"127.0.0.1:{port}")
    called("idle", **{FLEET_VARIABLE: "one", RUN_FOLDER_VARIABLE: str(tmp_path)})
    found = {(check.level, check.what) for check in CHECKS.machine["ports"]()}
    started = f"ROCO_HTTP: the fleet of {tmp_path} was started with port {port}"
    assert (Level.NOTE, started) in found
    assert Level.WRONG not in {level for level, _ in found}


SERVES = """
import socket, sys, time
with socket.create_server(("127.0.0.1", int(sys.argv[1]))) as server:
    print(server.getsockname()[1], flush=True)
    time.sleep(300)
"""


@pytest.mark.parametrize("own", [False, True])
def test_the_pictures_of_a_fleet(
    own: bool,
    port: int,
    called: Callable[..., int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Wrong where another program has the port; fine where a process of the fleet has it."""
    fleet = {FLEET_VARIABLE: "one", RUN_FOLDER_VARIABLE: str(tmp_path)}
    with ExitStack() as stack:
        if own:
            command = [sys.executable, "-c", SERVES, "0"]
            serving = stack.enter_context(
                subprocess.Popen(command, env=os.environ | fleet, stdout=subprocess.PIPE, text=True)
            )
            stack.callback(serving.kill)
            assert serving.stdout is not None
            port = int(serving.stdout.readline())
        pid = called("services.supervisor", **{SWITCH: "on", GRPC: str(port)}, **fleet)
        monitor = ProcessStatus("monitor", ProcessState.READY, pid, module="services.supervisor")
        told = Fleet("test", "", pid, time.time(), (monitor,))
        (tmp_path / FLEET_FILE).write_bytes(msgspec.json.encode(told))
        local = Local(tmp_path)
        words = "" if own else f"another program listens at port {port} ({GRPC})"
        assert [check.what for check in pictures(local, local.look())] == (
            [] if own else [f"none: {words}"]
        )
        assert state_of(local).pictures == words
        wanted = "no pictures are served" if own else f"{words}; end that program"
        with pytest.raises(NoRunError, match=re.escape(f"{tmp_path} shows nothing: {wanted}")):
            view.found(None, "", tmp_path, web=False)
        monkeypatch.setattr(Local, "variable", lambda self, name, variable: "70000")
        assert state_of(local).pictures == ""  # the monitor says that it is no port

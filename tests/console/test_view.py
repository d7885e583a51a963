"""`roco view` says what shows a run, or what is missing and what to do."""

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest

from agent_runtime.io.run_files import FLEET_VARIABLE, RUN_FOLDER_VARIABLE
from companion.tools.verbs.checkup import CHECKS
from console.errors import NoRunError, UsageError
from console.fleet import view
from console.fleet.checkup import Level, pictures
from console.fleet.local import Local
from console.fleet.status import GRPC, SWITCH, WEB, state_of
from operate.file_names import FLEET_FILE, RRD_FILE, VIEW_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus, ViewAddress

pytestmark = pytest.mark.process

NOWHERE = os.environ | {"DISPLAY": "", "WAYLAND_DISPLAY": ""}
SERVES = """
import socket, time
with socket.create_server(("127.0.0.1", 0)) as server:
    print(server.getsockname()[1], flush=True)
    time.sleep(300)
"""


@pytest.fixture
def served(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[int]:
    """A port at which a process listens: one of the fleet of `tmp_path` (True), or another program
    (False).
    """
    own = {FLEET_VARIABLE: "one", RUN_FOLDER_VARIABLE: str(tmp_path)} if request.param else {}
    command = [sys.executable, "-c", SERVES]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=os.environ | own, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        yield int(process.stdout.readline())
        process.kill()


@pytest.mark.parametrize("served", [True], indirect=True)
def test_a_running_fleet_is_shown_where_its_monitor_serves_it(tmp_path: Path, served: int) -> None:
    """Live comes before a recording; page and viewer connect to the same port."""
    (tmp_path / VIEW_FILE).write_bytes(msgspec.json.encode(ViewAddress(served, 4711)))
    (tmp_path / RRD_FILE).touch()
    seen = view.found(None, "", tmp_path, web=False)
    assert seen.live
    assert seen.command[1:] == ("--connect", f"rerun+http://127.0.0.1:{served}/proxy")
    proxy = f"rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{served}%2Fproxy"
    assert seen.url == f"http://127.0.0.1:4711/?url={proxy}"


@pytest.mark.parametrize("served", [False], indirect=True)
def test_a_fleet_that_has_ended_is_shown_by_its_recording(tmp_path: Path, served: int) -> None:
    """view.json is left; another program listens there now."""
    (tmp_path / VIEW_FILE).write_bytes(msgspec.json.encode(ViewAddress(served, 1)))
    (tmp_path / RRD_FILE).touch()
    seen = view.found(None, "", tmp_path, web=False)
    assert (seen.live, seen.command[1:]) == (False, (str(tmp_path / RRD_FILE),))
    page = view.found(tmp_path / RRD_FILE, "", None, web=True)
    assert "--serve-web" in page.command
    assert page.command[page.command.index("--bind") + 1] == "127.0.0.1"
    port = page.command[page.command.index("--web-viewer-port") + 1]
    assert page.url.startswith(f"http://127.0.0.1:{port}/?url=")


def test_a_run_without_pictures_says_how_they_are_made(tmp_path: Path) -> None:
    """No fleet, no run.rrd."""
    with pytest.raises(NoRunError, match="roco report"):
        view.found(None, "", tmp_path, web=False)
    for no_file in (tmp_path / "none", tmp_path):
        with pytest.raises(UsageError, match="a run is named by --run-dir"):
            view.found(no_file, "", None, web=False)


def test_containers_serve_where_compose_publishes() -> None:
    """The usual ports, or those of the environment."""
    assert view.containers({}) == ViewAddress(9876, 9090)
    assert view.containers({view.GRPC: "9976", view.WEB: "9190"}) == ViewAddress(9976, 9190)
    for wrong in ("page", "70000"):
        with pytest.raises(UsageError, match=view.WEB):
            view.containers({view.WEB: wrong})


def test_without_a_display_it_names_the_page(tmp_path: Path) -> None:
    """Exit code 1, and the words say what works instead."""
    (tmp_path / RRD_FILE).touch()
    words = [sys.executable, "-m", "console", "view", "--run-dir", str(tmp_path)]
    done = subprocess.run(words, env=NOWHERE, capture_output=True, text=True, timeout=50)
    assert done.returncode == 1
    assert "roco view --web" in done.stderr


# --- A port that is set, and that another program has: told by doctor, status and view ------------


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


def test_a_set_port_is_looked_for_at_its_address(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the page in a network: the same port of another address is another one."""
    with socket.create_server(("127.0.0.2", 0)) as other:
        port = other.getsockname()[1]
        for host, taken in (("127.0.0.2", True), ("127.0.0.3", False)):
            monkeypatch.setenv("ROCO_PAGE", f"{host}:{port}")
            levels = {check.level for check in CHECKS.machine["ports"]()}
            assert (Level.WRONG in levels) == taken, host


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


@pytest.mark.parametrize(("served", "own"), [(True, True), (False, False)], indirect=["served"])
def test_the_pictures_of_a_fleet(
    own: bool,
    served: int,
    called: Callable[..., int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Wrong where another program has the port; fine where a process of the fleet has it."""
    fleet = {FLEET_VARIABLE: "one", RUN_FOLDER_VARIABLE: str(tmp_path)}
    pid = called("services.supervisor", **{SWITCH: "on", GRPC: str(served)}, **fleet)
    monitor = ProcessStatus("monitor", ProcessState.READY, pid, module="services.supervisor")
    told = Fleet("test", "", pid, time.time(), (monitor,))
    (tmp_path / FLEET_FILE).write_bytes(msgspec.json.encode(told))
    local = Local(tmp_path)
    words = "" if own else f"another program listens at port {served} ({GRPC})"
    assert [check.what for check in pictures(local, local.look())] == (
        [] if own else [f"none: {words}"]
    )
    assert state_of(local).pictures == words
    wanted = "no pictures are served" if own else f"{words}; end that program"
    with pytest.raises(NoRunError, match=re.escape(f"{tmp_path} shows nothing: {wanted}")):
        view.found(None, "", tmp_path, web=False)
    monkeypatch.setattr(Local, "variable", lambda self, name, variable: "70000")
    assert state_of(local).pictures == ""  # the monitor says that it is no port

"""A fleet with a fork server: who is made by it, and that it is one process more that may die."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from stepped import ended, until

from agent_runtime.io.fork_server import FORKS_VARIABLE
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE
from operate.fleet_file import ProcessState
from operate.supervisor import core, folder
from operate.supervisor.processes import Process, around
from operate.supervisor.shell import FORKS, FORKS_FILE, Shell, forking

TABLE = (
    *around(),
    Process("loop", "a.loop", forked=False),
    Process("pl", "a.pl", after=("router", "monitor"), workers=("a.search",)),
    Process("ex", "a.ex", after=("router", "loop"), workers=("a.eye", "a.search")),
)
WAITS = """
import os, pathlib, signal, sys
if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    pathlib.Path(os.environ["ROCO_RUN_DIR"], sys.argv[0].split("/")[-2] + ".ready").touch()
    signal.pause()
"""


def test_the_server_is_ready_before_what_it_makes() -> None:
    """It has all that they import; a router and who locks memory wait for nothing more than
    before.
    """
    after = forking(TABLE)
    core.begin(after, 0.0)  # the order holds
    server, *others = after
    assert server.arguments == (
        "operate.recording.__main__", "a.pl.__main__", "a.search", "a.ex.__main__", "a.eye",
    )  # fmt: skip
    waits = {one.name for one in others if FORKS.name in one.after}
    assert waits == {"monitor", "pl", "ex"}
    assert [(one.name, one.module) for one in others] == [(one.name, one.module) for one in TABLE]


@pytest.mark.parametrize("few", [TABLE[:1], TABLE[:2], TABLE[:3]])
def test_a_server_for_one_process_is_not_worth_it(few: tuple[Process, ...]) -> None:
    """A part of a fleet, as `--only` has it."""
    assert forking(few) == few


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Shell]:
    """Two processes and their fork server."""
    code, run = tmp_path / "code", tmp_path / "run"
    for name in ("one", "two"):
        (code / name).mkdir(parents=True)
        (code / name / "__init__.py").touch()
        (code / name / "__main__.py").write_text(WAITS)
    monkeypatch.syspath_prepend(str(code))
    folder.make(run)
    places = {RUN_FOLDER_VARIABLE: str(run), FORKS_VARIABLE: str(run / FORKS_FILE)}
    told = os.environ | places | {"PYTHONPATH": str(code), "OMP_NUM_THREADS": "1"}
    shell = Shell(run, forking((Process("one", "one"), Process("two", "two"))), "test", "", told)
    yield shell
    ended(shell)


def parent(shell: Shell, name: str) -> int:
    status = Path(f"/proc/{shell.children[name].pid}/status").read_text()
    return int(status.partition("\nPPid:\t")[2].split()[0])


@pytest.mark.process
def test_processes_are_made_by_the_server_also_by_a_new_one(fleet: Shell) -> None:
    """Its death ends nobody; a process that dies then is made by the next one. In the end all end
    in order.
    """
    until(fleet, lambda: fleet.fleet.ready)
    first = fleet.children[FORKS.name].pid
    assert {parent(fleet, "one"), parent(fleet, "two")} == {first}
    os.kill(first, signal.SIGKILL)
    until(fleet, lambda: not fleet.fleet.known[FORKS.name].running)
    until(fleet, lambda: fleet.fleet.known[FORKS.name].state is ProcessState.READY)
    assert [fleet.fleet.known[name].restarts for name in ("one", "two")] == [0, 0]
    fleet.children["one"].kill()
    until(fleet, lambda: fleet.fleet.known["one"].restarts == 1)
    until(fleet, lambda: fleet.fleet.ready)
    assert parent(fleet, "one") == fleet.children[FORKS.name].pid != first
    ended(fleet)
    assert {one.state for one in fleet.fleet.status} == {ProcessState.STOPPED}
    # a busy machine notes late heartbeats, too
    codes = {one.note for one in fleet.fleet.status if "code" in one.note}
    assert codes <= {"ended with code 0"}


@pytest.mark.process
def test_services_are_made_by_it(tmp_path: Path) -> None:
    """What they import changes nothing that counts at a start; a search process is made by it,
    too.
    """
    run = tmp_path / "run"
    command = [sys.executable, "-m", "services.supervisor", "--only", "router,pl,ex", "--run-dir"]
    with subprocess.Popen([*command, str(run)], stdin=subprocess.DEVNULL) as supervisor:
        try:
            files = [run / f"{name}.pid" for name in ("forks", "pl", "ex")]
            while not all(file.exists() for file in files) or len(children(run)) < 3:
                assert supervisor.poll() is None
                time.sleep(0.05)
            made = children(run)
            assert {int((run / f"{name}.pid").read_text()) for name in ("pl", "ex")} < made
        finally:
            supervisor.terminate()


def children(run: Path) -> set[int]:
    """Return the processes that the fork server of a run has made and that live."""
    pid = (run / "forks.pid").read_text().strip()
    return {int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()}


@pytest.mark.process
def test_a_server_that_hangs_holds_up_nobody(fleet: Shell) -> None:
    """What dies meanwhile is started without it."""
    until(fleet, lambda: fleet.fleet.ready)
    server = fleet.children[FORKS.name]
    os.kill(server.pid, signal.SIGSTOP)
    fleet.children["two"].kill()
    until(fleet, lambda: fleet.fleet.known["two"].restarts == 1)
    until(fleet, lambda: fleet.fleet.ready)
    assert parent(fleet, "two") == os.getpid()
    os.kill(server.pid, signal.SIGCONT)

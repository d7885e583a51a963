"""One supervisor keeps a run folder; the next one ends what a dead one left. With real supervisors
and routers.
"""

import contextlib
import datetime as dt
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agent_runtime.io.issuing import issue
from companion.design import DESIGN
from console.runs import folders
from operate.file_names import LOCK_FILE
from operate.fleet_file import ProcessState
from operate.supervisor.folder import KeptError, kept
from operate.supervisor.shell import FORKS

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]

PATIENCE_S = 60.0  # of a busy machine
Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Path]:
    """A run folder; whatever was started for it is killed at the end."""
    folder = tmp_path / "runs" / "one"
    yield folder
    for pid in of_run(folder, ""):
        os.kill(pid, signal.SIGKILL)


@pytest.fixture
def start(run: Path) -> Iterator[Start]:
    """Starts Python modules, with the run folder in their environment."""
    started: list[subprocess.Popen[str]] = []

    def begin(*words: str) -> "subprocess.Popen[str]":
        pipe, settings = subprocess.PIPE, os.environ | {"ROCO_RUN_DIR": str(run)}
        command = [sys.executable, "-m", *words]
        started.append(subprocess.Popen(command, env=settings, stdout=pipe, stderr=pipe, text=True))
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def supervise(start: Start, *options: str, only: str = "router") -> "subprocess.Popen[str]":
    """Start a supervisor of a part of the companion."""
    return start("services.supervisor", "--only", only, *(options or ("--insecure",)))


def roco(start: Start, *words: str) -> tuple[int, str]:
    """The exit code of `roco`, and what it said."""
    process = start("console", *words)
    said = "".join(process.communicate(timeout=PATIENCE_S))
    return process.returncode, said


def until(condition: Callable[[], object]) -> None:
    """Wait for it, with a deadline."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def deleted(run: Path) -> bool:
    """Delete a run folder; whether that worked, although processes write to it meanwhile."""
    with contextlib.suppress(OSError):
        shutil.rmtree(run)
        return True
    return False


def up(run: Path, supervisor: "subprocess.Popen[str]", name: str = "router") -> None:
    """Wait until a process of this supervisor is ready."""

    def ready() -> bool:
        assert supervisor.poll() is None, supervisor.communicate()
        told = folders.fleet(run)
        if told is None or not told.supervisor == supervisor.pid == folders.keeper(run):
            return False
        return (name, ProcessState.READY) in [(one.name, one.state) for one in told.processes]

    until(ready)


def killed(process: "subprocess.Popen[str]") -> None:
    """kill -9."""
    process.kill()
    process.wait()


def ended(process: "subprocess.Popen[str]") -> str:
    """End a supervisor in order; what it said."""
    process.terminate()
    return process.communicate(timeout=PATIENCE_S)[0]


def of_run(run: Path, module: str = "services.router") -> list[int]:
    """The living processes of this run folder that run a module; "": all of them."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            words, settings = (
                (place / name).read_bytes().split(b"\0") for name in ("cmdline", "environ")
            )
        except OSError:
            continue
        if f"ROCO_RUN_DIR={run}".encode() in settings and (not module or module.encode() in words):
            found.append(int(place.name))
    return found


@pytest.mark.parametrize("frozen", [False, True])
def test_the_next_supervisor_ends_what_a_dead_one_left(
    run: Path, start: Start, frozen: bool
) -> None:
    """Never two routers of one run, also where the first one is frozen; nothing is left at the
    end.
    """
    first = supervise(start)
    up(run, first)
    (old,) = of_run(run)
    killed(first)
    assert of_run(run) == [old]
    assert folders.keeper(run) == 0
    if frozen:
        os.kill(old, signal.SIGSTOP)
    second, counts = supervise(start), list[int]()

    def other() -> bool:
        routers = of_run(run)
        counts.append(len(routers))
        return folders.keeper(run) == second.pid and len(routers) == 1 and old not in routers

    until(other)
    assert max(counts) == 1
    up(run, second)
    assert "ending what a supervisor that died left: router" in ended(second)
    assert of_run(run) == []


def test_the_fork_server_of_a_dead_supervisor_is_ended_too(run: Path, start: Start) -> None:
    """It is in no table of the system; the next supervisor finds it by its variables."""
    first = supervise(start, only="router,co,ta")
    up(run, first, FORKS.name)
    old = of_run(run, FORKS.module)
    killed(first)
    assert old == of_run(run, FORKS.module) != []
    second = supervise(start, only="router,co,ta")
    up(run, second, FORKS.name)
    assert not set(old) & set(of_run(run, ""))
    ended(second)
    assert of_run(run, "") == []


@pytest.mark.parametrize("hours", [-24 * 8, 24])
def test_status_names_a_certificate_that_does_not_hold(
    run: Path, start: Start, tmp_path: Path, hours: int
) -> None:
    """One that has ended, or begins only later; doctor names it, too."""
    made = dt.datetime.now(dt.UTC) + dt.timedelta(hours=hours)
    issue(tmp_path / "keys", DESIGN, ("roco",), now=made)
    supervisor = supervise(start, "--keys", str(tmp_path / "keys"), only="router,ta")
    until(lambda: supervisor.poll() is None and (run / "ta.heartbeat.json").exists())
    for verb in ("status", "doctor"):
        code, said = roco(start, verb, "--run-dir", str(run), "--format", "json")
        assert code == 1, said
        assert f"the certificate {tmp_path}/keys/" in said
        assert ("ended at" if hours < 0 else "holds only from") in said
    ended(supervisor)


@pytest.mark.parametrize("keeper_dies", [False, True])
def test_a_fleet_whose_run_folder_was_deleted_is_ended(
    run: Path, start: Start, keeper_dies: bool
) -> None:
    """It is not started a second time meanwhile; with its supervisor dead, too, it is found by its
    variables.
    """
    words = ("up", "--only", "router", "--insecure", "--out", str(run))
    assert roco(start, *words)[0] == 0
    (supervisor,) = of_run(run, "operate.supervisor")
    until(lambda: deleted(run))
    if keeper_dies:
        os.kill(supervisor, signal.SIGKILL)
        until(lambda: not of_run(run, "operate.supervisor"))
        until(lambda: deleted(run))
    else:
        until((run / "fleet.json").exists)
        code, said = roco(start, *words)
        assert (code, f"runs already (supervisor {supervisor})" in said) == (1, True), said
    assert of_run(run)
    assert roco(start, "down", "--run-dir", str(run))[0] == 0
    assert of_run(run, "") == []


def test_of_two_supervisors_one_is_refused_in_words(run: Path, start: Start) -> None:
    """The other goes on as if nothing had been."""
    first = supervise(start)
    up(run, first)
    routers = of_run(run)
    second = supervise(start)
    _, said = second.communicate(timeout=PATIENCE_S)
    assert second.returncode == 1
    assert f"runs already (supervisor {first.pid}); `roco down` ends it" in said
    assert of_run(run) == routers
    up(run, first)


def test_of_two_up_at_once_one_wins_and_the_other_ends_nothing(run: Path, start: Start) -> None:
    """Whichever: the one that is refused says so, and the fleet of the other is whole."""
    words = ("console", "up", "--only", "router", "--insecure", "--out", str(run))
    both = [start(*words), start(*words)]
    said = ["".join(process.communicate(timeout=PATIENCE_S)) for process in both]
    assert sorted(process.returncode for process in both) == [0, 1], said
    refused = said[[process.returncode for process in both].index(1)]
    assert "runs already" in refused
    assert len(of_run(run)) == len(of_run(run, "operate.supervisor")) == 1
    assert roco(start, "status", "--run-dir", str(run))[0] == 0
    assert roco(start, "down", "--run-dir", str(run)) == (0, "ended router\n")
    assert of_run(run, "") == []


def test_a_look_at_the_lock_keeps_nobody_from_it(tmp_path: Path) -> None:
    """It is free once its holder is gone; meanwhile the holder is named."""
    with kept(tmp_path):
        assert folders.keeper(tmp_path) == os.getpid()
        with pytest.raises(KeptError, match=f"supervisor {os.getpid()}"), kept(tmp_path):
            pass
    assert folders.keeper(tmp_path) == 0
    assert (tmp_path / LOCK_FILE).exists()
    with kept(tmp_path):
        assert folders.keeper(tmp_path) == os.getpid()


@pytest.mark.parametrize("who", ["supervisor", "router"])
def test_status_says_who_is_frozen_and_that_nobody_keeps_the_fleet(
    run: Path, start: Start, who: str
) -> None:
    """Exit code 0 only where all run and are looked after."""
    supervisor = supervise(start)
    up(run, supervisor)
    (router,) = of_run(run)
    status = ("status", "--run-dir", str(run))
    assert roco(start, *status)[0] == 0
    os.kill(supervisor.pid, signal.SIGSTOP)
    if who == "router":
        os.kill(router, signal.SIGSTOP)
    code, said = roco(start, *status)
    assert code == 1
    assert f"the supervisor (pid {supervisor.pid}) is stuck, frozen by a signal" in said
    assert ("frozen by a signal" in said.replace("stuck, frozen", "")) is (who == "router")
    for pid in (router, supervisor.pid):
        os.kill(pid, signal.SIGCONT)
    until(lambda: roco(start, *status)[0] == 0)
    killed(supervisor)
    code, said = roco(start, *status)
    assert code == 1
    assert "no supervisor: who dies now stays dead" in said
    assert roco(start, "down", "--run-dir", str(run))[0] == 0
    assert of_run(run, "") == []

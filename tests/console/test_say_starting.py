"""`roco say` and `roco page` right after a start: a fleet on its way is waited for; nothing else
is.
"""

import http.server
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from calling import roco
from typer.testing import Result

from companion.run_files import HI_FILE, PAGE_FILE, HiAddress, PageAddress, Problem
from companion.tools.verbs import hi, talk
from console.fleet import starting
from console.runs import folders
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

from . import fake_fleet

pytestmark = pytest.mark.process

STARTING = "the fleet is starting"
LOST = (ProcessState.GIVEN_UP, ProcessState.STOPPED, ProcessState.READY)
Act = Callable[[], None]


class Clock:
    """In place of `time` in the verb: what is to happen while it waits happens there, one thing at
    each pause.
    """

    localtime, time = staticmethod(time.localtime), staticmethod(time.time)

    def __init__(self) -> None:
        self.now, self.pauses = 0.0, 0
        self.acts: list[Act] = []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.pauses += 1
        if self.acts:
            self.acts.pop(0)()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Clock:
    """The time of the verb, in a place without runs and containers."""
    made = Clock()
    monkeypatch.setattr(hi, "time", made)
    monkeypatch.setattr("console.fleet.compose.projects", lambda **_: ())
    monkeypatch.delenv("ROCO_RUN_DIR", raising=False)
    monkeypatch.delenv("ROCO_CONNECT", raising=False)
    monkeypatch.chdir(tmp_path)
    return made


def say(*words: object) -> Result:
    """Say a sentence."""
    return roco("say", "pour the jar into the bowl", *words)


def heard(done: Result) -> None:
    """It became a task, and a person read once what was waited for."""
    assert done.exit_code == 0, done.output
    assert "hi-1-1" in done.stdout
    assert done.stderr.count(STARTING) == 1


def told(run: Path, state: ProcessState, supervisor: int, name: str = "hi") -> None:
    """Write a supervisor's report about a_hi, or another process."""
    run.mkdir(parents=True, exist_ok=True)
    processes = (ProcessStatus(name, state, supervisor, module="services.supervisor"),)
    fleet = Fleet("test", "", supervisor, time.time(), processes)
    (run / FLEET_FILE).write_bytes(msgspec.json.encode(fleet))


def listening(pretend: Callable[[bool], None], run: Path) -> Act:
    """Bring up a fleet with somebody who listens, where nothing may be yet."""

    def come_up() -> None:
        pretend(True)
        beside = run.with_name("beside")
        supervisor = starting.start(beside, [])
        starting.wait_ready(beside, supervisor, lambda _: None)
        run.mkdir(exist_ok=True)
        (run / HI_FILE).write_bytes((beside / HI_FILE).read_bytes())

    return come_up


def test_before_anything_is_in_the_run_folder(clock, called, pretend, tmp_path: Path) -> None:
    """The supervisor lives, and has told nothing."""
    run = tmp_path / "run"
    called(folders.SUPERVISORS[0], "--run-dir", run)
    clock.acts = [lambda: None, listening(pretend, run)]
    heard(say("--run-dir", run))
    assert clock.pauses == 2


def test_the_run_that_will_be_the_latest(clock, called, pretend, tmp_path: Path) -> None:
    """Without a name it is waited for, though the run that is the latest so far has ended."""
    old = tmp_path / "runs" / "old"
    told(old, ProcessState.READY, 0)
    (old / HI_FILE).write_bytes(msgspec.json.encode(HiAddress(1, "t")))
    (tmp_path / "runs" / "latest").symlink_to(old)
    new = tmp_path / "runs" / "new"
    called(folders.SUPERVISORS[0], "--run-dir", new)

    def linked() -> None:
        listening(pretend, new)()
        told(new, ProcessState.READY, called("services.supervisor"))
        (tmp_path / "runs" / "latest").unlink()
        (tmp_path / "runs" / "latest").symlink_to(new)

    clock.acts = [linked]
    heard(say())


@pytest.mark.parametrize("state", ["waiting", "starting", "backing-off"])
def test_while_the_supervisor_brings_it_up(
    clock, called, pretend, tmp_path: Path, state: str
) -> None:
    """As it says in the run folder."""
    run = tmp_path / "run"
    told(run, ProcessState(state), called("services.supervisor"))
    clock.acts = [listening(pretend, run)]
    heard(say("--run-dir", run))


def test_what_does_not_come_is_not_waited_for(clock, called, tmp_path: Path) -> None:
    """It was given up or stopped, or is there and hangs, or is not of this fleet: said at once."""
    run, pid = tmp_path / "run", called("services.supervisor", "--run-dir", tmp_path / "run")
    for state, name in (*((state, "hi") for state in LOST), (ProcessState.READY, "km")):
        told(run, state, pid, name)
        done = say("--run-dir", run)
        assert (done.exit_code, clock.pauses) == (3, 0), (state, name)
        assert STARTING not in done.stderr, (state, name)


def test_nothing_starts(clock, tmp_path: Path) -> None:
    """No supervisor, no container: said at once."""
    done = say()
    assert (done.exit_code, clock.pauses) == (3, 0)
    assert "roco up" in done.stderr


def test_the_wait_ends(clock, called, tmp_path: Path) -> None:
    """In words that say what to look at."""
    run = tmp_path / "run"
    told(run, ProcessState.STARTING, called("services.supervisor"))
    done = say("--run-dir", run)
    assert done.exit_code == 3
    assert clock.now == pytest.approx(hi.STARTING_S, abs=1.0)
    assert "still starting after 90 s; see `roco status`" in done.stderr


def test_in_a_container_a_hi_itself_is_looked_for(
    clock, called, pretend, tmp_path: Path, monkeypatch
) -> None:
    """There is no supervisor, and no run folder until a_hi makes it."""
    run = tmp_path / "run"
    # others may have a fleet here
    mine = hi.HUMAN_INTERFACE._replace(module="services.a_hi_of_this_test")
    monkeypatch.setattr(talk, "HUMAN_INTERFACE", mine)
    monkeypatch.setenv("ROCO_CONNECT", "tls/router:7447")
    monkeypatch.setenv("ROCO_RUN_DIR", str(run))
    assert say().exit_code == 3
    assert clock.pauses == 0, "it is no container of a_hi"
    called(mine.module)
    clock.acts = [listening(pretend, run)]
    heard(say())


def page(*words: object) -> Result:
    """Ask for an address of the page."""
    return roco("page", *words)


def test_a_page_that_is_starting_is_waited_for(clock, called, tmp_path: Path) -> None:
    """First it has told no address, then it has one where it does not listen yet."""
    run, started = tmp_path / "run", list[subprocess.Popen[bytes]]()
    told(run, ProcessState.STARTING, called("services.supervisor"), "page")

    def begin() -> None:
        settings = os.environ | {"ROCO_RUN_DIR": str(run), "ROCO_CONNECT": "tcp/127.0.0.1:1"}
        with (tmp_path / "page.log").open("ab") as log:
            words = [sys.executable, "-P", "-m", "services.page"]
            started.append(subprocess.Popen(words, env=settings, stdout=log, stderr=log))
        until = time.monotonic() + 20.0
        while not (run / "page.ready").exists():
            assert started[0].poll() is None, (tmp_path / "page.log").read_text()
            assert time.monotonic() < until

    bound = socket.create_server(("127.0.0.1", 0))
    address = PageAddress(bound.getsockname()[1], "t")
    bound.close()
    clock.acts = [lambda: (run / PAGE_FILE).write_bytes(msgspec.json.encode(address)), begin]
    try:
        done = page("--run-dir", run)
        assert (done.exit_code, clock.pauses, done.stderr.count(STARTING)) == (0, 2, 1), done.output
        assert done.stdout.startswith("http://127.0.0.1:")
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_a_page_that_does_not_come_is_not_waited_for(clock, called, tmp_path: Path) -> None:
    """It is said that there is none, in words."""
    run, pid = tmp_path / "run", called("services.supervisor", "--run-dir", tmp_path / "run")
    for state in LOST:
        told(run, state, pid, "page")
        done = page("--run-dir", run)
        assert (done.exit_code, clock.pauses) == (3, 0), state
        assert "has no page (no page.json); see `roco status`" in done.stderr, state


class WithoutCo(fake_fleet.Answers):
    """A_hi that has no coordinator for its first two sentences."""

    said = 0

    def do_POST(self) -> None:
        """Decline, then take it."""
        WithoutCo.said += 1
        if WithoutCo.said <= 2:
            self.rfile.read(int(self.headers["Content-Length"]))
            self.reply(Problem("there is no coordinator yet"), 503)
        else:
            super().do_POST()


def test_a_hi_without_a_coordinator_is_asked_again(clock, tmp_path: Path) -> None:
    """It has done nothing with the sentence, so that it can be said again."""
    server = http.server.HTTPServer(("127.0.0.1", 0), WithoutCo)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = HiAddress(server.server_port, fake_fleet.TOKEN)
    (tmp_path / HI_FILE).write_bytes(msgspec.json.encode(address))
    heard(say("--run-dir", tmp_path))
    assert clock.pauses == 2
    server.shutdown()
    server.server_close()


def test_programs_read_nothing_but_the_answer(clock, called, pretend, tmp_path: Path) -> None:
    """Nothing on standard error, as where other verbs wait."""
    run = tmp_path / "run"
    called(folders.SUPERVISORS[0], "--run-dir", run)
    clock.acts = [listening(pretend, run)]
    done = say("--run-dir", run, "--format", "json")
    assert (done.exit_code, done.stderr) == (0, "")

"""The supervisor's shell with real processes: short Python programs in place of the services."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import FrameType

import msgspec
import pytest
from stepped import ended, until

from agent_runtime.io.run_files import STOP_FILE, STOP_HELD, STOP_RELEASED
from operate.file_names import LOCK_FILE, OFF_SUFFIX
from operate.fleet_file import Fleet, ProcessState
from operate.supervisor import core, folder
from operate.supervisor.shell import NotBuiltError, Shell, python_module
from operate.system import Process

pytestmark = pytest.mark.process

MADE = "import pathlib, sys, os; run = pathlib.Path(os.environ['RUN']); "
READY = MADE + "(run / (sys.argv[1] + '.ready')).touch(); "
WAIT = READY + "import signal; signal.pause()"
TABLE = (Process("router", WAIT), Process("ta", WAIT, after=("router",), stop_within_s=0.3))


def program(process: Process) -> list[str]:
    """In these tests a process's module is the text of its program."""
    return [sys.executable, "-c", process.module, process.name]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Shell]]:
    """Make a shell in a run folder of its own, perhaps with all ready; whatever still runs at the
    end is killed.
    """
    shells: list[Shell] = []

    def make(*processes: Process, ready: bool = False) -> Shell:
        run = tmp_path / "run"
        folder.make(run)
        shell = Shell(run, processes, "test", "", os.environ | {"RUN": str(run)}, program)
        shells.append(shell)
        if ready:
            until(shell, lambda: shell.fleet.ready)
        return shell

    yield make
    for shell in shells:
        for child in shell.children.values():
            child.kill()
            child.wait()


def read(shell: Shell) -> Fleet:
    return msgspec.json.decode((shell.run / "fleet.json").read_bytes(), type=Fleet)


def test_a_fleet_comes_up_and_goes_down_in_order(start: Callable[..., Shell]) -> None:
    """All ready, pid files while they run, none after, and every child is gone."""
    shell = start(*TABLE, ready=True)
    pids = [status.pid for status in read(shell).processes]
    assert [int(folder.pid_file(shell.run, name).read_text()) for name in ("router", "ta")] == pids
    ended(shell)
    assert not list(shell.run.glob("*.pid"))
    assert [status.state for status in read(shell).processes] == [ProcessState.STOPPED] * 2
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_full_disk_ends_neither_the_supervisor_nor_what_it_starts(
    tmp_path: Path,
    disk: Callable[[Path, str], Path],
    start: Callable[..., Shell],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What was killed meanwhile is started again; what could not be written is written once there
    is room.
    """
    small_disk = disk(tmp_path / "run", "256k")
    shell = start(Process("ta", WAIT), ready=True)
    first = shell.children["ta"].pid
    with suppress(OSError), (small_disk / "filler").open("wb", buffering=0) as filler:
        while filler.write(bytes(4096)):
            pass
    os.kill(first, signal.SIGKILL)
    until(shell, lambda: shell.fleet.known["ta"].restarts == 1 and shell.fleet.ready)
    assert shell.files.why
    (small_disk / "filler").unlink()
    until(shell, lambda: shell.fleet.ready and not shell.files.why)
    assert read(shell).processes[0].pid == shell.children["ta"].pid != first
    told = capsys.readouterr().out
    assert "No space left on device; the fleet goes on, and it is tried again" in told
    assert told.endswith("all is written again\n")


def test_who_finds_no_room_at_its_start_is_tried_until_there_is(
    start: Callable[..., Shell], monkeypatch: pytest.MonkeyPatch
) -> None:
    """More often than what fails for other reasons; then that is given up as ever."""
    for name in ("FIRST_PAUSE_S", "LONGEST_PAUSE_S"):
        monkeypatch.setattr(core, name, 0.01)
    shell = start(Process("monitor", "import sys; sys.exit(1)"))
    free = shutil.disk_usage(shell.run)._replace(free=folder.LEAST_ROOM - 1)
    with monkeypatch.context() as full:
        full.setattr(folder.shutil, "disk_usage", lambda path: free)
        until(shell, lambda: shell.fleet.known["monitor"].restarts > core.ATTEMPTS)
        words = f"ended with code 1, and the disk of {shell.run} has 16.8 MB free"
        until(shell, lambda: shell.fleet.known["monitor"].note == words)
    until(shell, lambda: shell.fleet.known["monitor"].state is ProcessState.GIVEN_UP)


def test_a_deleted_run_folder_is_made_again(start: Callable[..., Shell]) -> None:
    """The supervisor goes on with what it knows, and ends its fleet in order."""
    shell = start(*TABLE, ready=True)
    shutil.rmtree(shell.run)
    os.kill(shell.children["ta"].pid, signal.SIGKILL)
    until(shell, lambda: shell.fleet.known["ta"].restarts == 1 and shell.fleet.ready)
    assert [status.state for status in read(shell).processes] == [ProcessState.READY] * 2
    assert shell.run.stat().st_mode & 0o777 == 0o700
    shutil.rmtree(shell.run)
    ended(shell)


def test_a_killed_process_comes_back_with_a_fresh_ready_file(start: Callable[..., Shell]) -> None:
    """The old ready file does not speak for the new process."""
    shell = start(*TABLE, ready=True)
    first = shell.children["router"].pid
    os.kill(first, signal.SIGKILL)
    until(shell, lambda: not shell.fleet.ready)
    until(shell, lambda: shell.fleet.ready)
    router = read(shell).processes[0]
    assert router.restarts == 1
    assert router.pid != first


def test_what_ignores_the_request_to_end_is_killed(start: Callable[..., Shell]) -> None:
    """A deaf process does not hold up the end."""
    ignores = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); "
    deaf = ignores + READY + "\nwhile True: signal.pause()"
    shell = start(Process("ta", deaf, stop_within_s=0.2), ready=True)
    ended(shell)
    assert "killed: did not stop in 0.2 s" in shell.fleet.known["ta"].note


def test_the_last_words_of_a_process_are_told(start: Callable[..., Shell]) -> None:
    """The reason of its death can be read in fleet.json."""
    shell = start(Process("ta", "import sys; print('no such scene'); sys.exit(2)"))
    until(shell, lambda: shell.fleet.known["ta"].state is ProcessState.GIVEN_UP)
    assert read(shell).processes[0].note == "ended with code 2: no such scene"


@pytest.mark.parametrize(
    ("behind", "note"),
    [
        ("hi stopped", "OSError: [Errno 98] Address already in use"),
        ("it goes on\\n" * 9 + "no such scene", "no such scene"),
    ],
    ids=["a farewell", "more lines"],
)
def test_the_exception_on_which_a_process_ends_is_told(
    start: Callable[..., Shell], behind: str, note: str
) -> None:
    """An agent logs its traceback, and then that it stopped; a traceback long before the end is no
    reason.
    """
    code = (
        "import sys, traceback\n"
        "try: raise OSError(98, 'Address already in use')\n"
        "except OSError: print('06:12 hi ! died why=' + traceback.format_exc())\n"
        f"print('{behind}'); sys.exit(2)"
    )
    shell = start(Process("hi", code))
    until(shell, lambda: shell.fleet.known["hi"].state is ProcessState.GIVEN_UP)
    assert read(shell).processes[0].note == f"ended with code 2: {note}"


def test_a_service_without_a_program_is_named() -> None:
    """The message says which file is missing."""
    with pytest.raises(NotBuiltError, match=r"services/nowhere/__main__\.py is missing"):
        python_module(Process("x", "services.nowhere"))
    found = python_module(Process("supervisor", "services.supervisor"))
    assert found[1:] == ["-P", "-m", "services.supervisor"]


def test_the_program_itself_beats_and_stops_in_order_on_sigterm(tmp_path: Path) -> None:
    """`python -m services.supervisor` with a real router: who looks from outside sees that it gets
    on, and its end.
    """
    run = tmp_path / "runs" / "one"
    command = [sys.executable, "-m", "services.supervisor", "--only", "router", "--run-dir"]
    with subprocess.Popen([*command, str(run)]) as supervisor:

        def wait(condition: Callable[[], bool]) -> None:
            while not condition():
                assert supervisor.poll() is None
                time.sleep(0.02)

        for name in ("supervisor", "router"):
            wait((run / f"{name}.ready").exists)
        beat = run / "supervisor.heartbeat.json"
        assert json.loads(beat.read_bytes())["pid"] == supervisor.pid
        first = beat.stat().st_mtime_ns
        wait(lambda: beat.stat().st_mtime_ns != first)
        supervisor.terminate()
        assert supervisor.wait(30) == 0
    assert [file.name for file in run.glob("supervisor.*")] == [LOCK_FILE]
    assert (run.parent / "latest").resolve() == run.resolve()
    assert (run / "stop").read_bytes() == b"\x00"


def test_the_file_beside_it_keeps_a_process_down(start: Callable[..., Shell]) -> None:
    """With real processes: it ends when the file appears, and starts when it goes; a new start
    knows of no file.
    """
    shell = start(*TABLE, ready=True)
    off = shell.run / f"ta{OFF_SUFFIX}"
    off.touch()
    until(shell, lambda: shell.fleet.known["ta"].state is ProcessState.STOPPED)
    assert read(shell).processes[1].note == core.OFF
    assert shell.fleet.known["router"].state is ProcessState.READY
    off.unlink()
    until(shell, lambda: shell.fleet.ready)
    off.touch()
    folder.make(shell.run)
    assert not off.exists()


BEATS = """
import time
while True:
    (run / (sys.argv[1] + '.heartbeat.json')).write_text(str(time.time()))
    time.sleep(0.05)
"""


@pytest.mark.parametrize("ready", [True, False])
def test_a_frozen_process_is_killed_and_comes_back(
    start: Callable[..., Shell], ready: bool
) -> None:
    """SIGSTOP, before it is ready or after; one that beats beside it is left alone."""
    frozen = Process("ta", (READY if ready else MADE) + BEATS, hangs_s=0.5)
    shell = start(frozen, Process("co", READY + BEATS, hangs_s=0.5))
    known = shell.fleet.known
    until(shell, lambda: all(shell.fleet.known[name].beaten for name in known))
    first, other = shell.children["ta"].pid, shell.children["co"].pid
    os.kill(first, signal.SIGSTOP)
    until(shell, lambda: shell.fleet.known["ta"].restarts == 1 and shell.fleet.known["ta"].beaten)
    assert (shell.children["ta"].pid != first, shell.children["co"].pid) == (True, other)
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)


def test_where_a_process_cannot_be_kept_alive_the_robot_is_held(
    start: Callable[..., Shell], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stop flag is that of a person; it is set once, so a release is not undone."""
    monkeypatch.setattr(core, "MOST_DEATHS", 2)
    shell = start(Process("ta", READY + "import time; time.sleep(0.2)"))
    flag = shell.run / STOP_FILE
    assert flag.read_bytes() == STOP_RELEASED
    until(shell, lambda: shell.fleet.known["ta"].state is ProcessState.GIVEN_UP)
    until(shell, lambda: flag.read_bytes() == STOP_HELD)
    flag.write_bytes(STOP_RELEASED)
    shell.step(time.monotonic())
    assert flag.read_bytes() == STOP_RELEASED
    assert "died 2 times" in read(shell).processes[0].note


def test_what_a_process_prints_takes_bounded_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An appending process goes on in the same file, which begins again; the earlier contents are
    beside it.
    """
    monkeypatch.setattr(folder, "MOST_BYTES", 1000)
    file = tmp_path / "co.log"
    with file.open("ab", buffering=0) as printed:
        printed.write(b"x" * 1000)
        folder.keep_small(file)
        assert file.stat().st_size == 1000
        printed.write(b"y")
        folder.keep_small(file)
        printed.write(b"after")
    assert file.read_bytes() == b"after"
    assert (tmp_path / "co.log.1").read_bytes() == b"x" * 1000 + b"y"


@pytest.mark.timeout(60)
def test_a_child_that_ends_is_seen_at_once(
    start: Callable[..., Shell], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not at the next look, which is rarer while all is well."""
    monkeypatch.setattr(core, "REST_PERIODS", 10_000)
    shell = start(TABLE[0], ready=True)
    until(shell, lambda: shell.fleet.resting)
    shell.children["router"].kill()
    shell._wait()
    assert shell.periods == 1
    shell.step(time.monotonic())
    assert not shell.fleet.resting
    assert not shell.ends


LINES = 6  # of two waits


@pytest.mark.timeout(30)
def test_a_signal_ends_it_at_any_line_of_its_wait(start: Callable[..., Shell]) -> None:
    """The handler runs in the thread that waits."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        for line in range(1, LINES + 1):
            left = line

            def trace(frame: FrameType, what: str, _: object) -> object:
                nonlocal left
                if what == "line" and frame.f_code is Shell._wait.__code__:
                    left -= 1
                    if left == 0:
                        signal.raise_signal(signal.SIGTERM)
                return trace

            shell = start()
            sys.settrace(trace)
            try:
                shell.serve()
            finally:
                sys.settrace(None)
            assert shell.fleet.ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

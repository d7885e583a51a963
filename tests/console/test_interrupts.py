"""Processes started by `roco` end with it: by Ctrl-C, SIGTERM and SIGHUP alike, with real
processes.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

import pytest

from console import interrupts
from console.runs import folders
from operate import proc

pytestmark = pytest.mark.process

SUPERVISED = Path(__file__).with_name("fake_supervised.py")
PATIENCE_S = 40.0
ENDINGS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
VIEWER = """
import subprocess, sys, pathlib
child = subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"])
pathlib.Path("pids").write_text(f"{child.pid}\\n")
child.wait()
"""
SHOWING = """
import sys
from operate import proc
from console import interrupts
from console.fleet import view
with interrupts.heard(), open("words", "wb") as words:
    view.shown((sys.executable, "-c", sys.argv[1]), words)
"""

PRINTING = """
import signal
from console import __main__ as roco
def app():
    print("line")
    signal.pause()
roco.app = app
roco.main()
"""
TELLING = """
import sys
from operate import proc
from console import interrupts
from console.output import tell_json
try:
    while True:
        tell_json("x" * int(sys.argv[1]))
except KeyboardInterrupt:
    tell_json("end")
"""


@pytest.fixture(autouse=True)
def _terminal_that_can_close() -> Iterator[None]:
    """SIGHUP has its default: a suite under nohup ignores it, and so would all that it starts."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


Roco = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def roco(tmp_path: Path) -> Iterator[Roco]:
    """Starts `roco` with a pretended fleet, in a folder of its own; at the end nothing of either is
    left.
    """
    started: list[subprocess.Popen[str]] = []

    def start(mode: str, *words: str) -> "subprocess.Popen[str]":
        command = [sys.executable, str(SUPERVISED), mode, *words]
        pipe = subprocess.PIPE
        started.append(subprocess.Popen(command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()
    for file in tmp_path.glob("runs/*/fleet.json"):
        told = folders.fleet(file.parent)
        if told is not None and folders.is_service(told.supervisor, *folders.SUPERVISORS):
            os.kill(told.supervisor, signal.SIGKILL)


@contextlib.contextmanager
def running(code: str, *words: str) -> Iterator[tuple["subprocess.Popen[bytes]", IO[bytes]]]:
    """A process with that code, and what it prints."""
    command, pipe = [sys.executable, "-c", code, *words], subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        try:
            yield process, process.stdout
        finally:
            process.kill()


def until(condition: Callable[[], object]) -> None:
    """Wait for it, but not for ever."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def fleet_of(folder: Path) -> int:
    """The pid of the pretended fleet, once it has told of itself."""
    until(lambda: list(folder.glob("runs/*/fleet.json")))
    (file,) = folder.glob("runs/*/fleet.json")
    fleet = folders.fleet(file.parent)
    assert fleet is not None
    return fleet.supervisor


@pytest.mark.parametrize(
    ("words", "number"),
    [
        *((("up",), number) for number in ENDINGS),
        (("demo",), signal.SIGTERM),
        (("demo", "--format", "json"), signal.SIGHUP),
    ],
)
def test_an_interrupted_start_leaves_no_fleet(
    roco: Roco, tmp_path: Path, words: tuple[str, ...], number: int
) -> None:
    """It ends in order, and `roco` only after it."""
    process = roco("starting", *words)
    supervisor = fleet_of(tmp_path)
    process.send_signal(number)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert not folders.is_service(supervisor, *folders.SUPERVISORS)
    assert list(tmp_path.glob("runs/*/report.json"))
    if words == ("up",):
        assert "what was started is brought down" in said


@pytest.mark.parametrize("verb", ["up", "demo"])
def test_a_terminal_that_is_gone_leaves_no_fleet(roco: Roco, tmp_path: Path, verb: str) -> None:
    """Nobody takes the words any more; the fleet is ended all the same."""
    process = roco("starting", verb)
    supervisor = fleet_of(tmp_path)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    process.stderr.close()
    process.send_signal(signal.SIGHUP)
    process.wait(PATIENCE_S)
    until(lambda: not folders.is_service(supervisor, *folders.SUPERVISORS))


def test_signals_that_come_twice_are_one(roco: Roco, tmp_path: Path) -> None:
    """`timeout` sends SIGTERM twice, a closed terminal SIGHUP: the fleet is waited for all the
    same.
    """
    process = roco("slow", "demo")
    supervisor = fleet_of(tmp_path)
    for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGHUP):
        process.send_signal(number)
        time.sleep(0.05)  # so that they are not merged into one
    (next(tmp_path.glob("runs/*")) / "may-end").touch()
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert said == "roco: interrupted\n"
    assert not folders.is_service(supervisor, *folders.SUPERVISORS)


@pytest.mark.parametrize("verb", ["up", "demo"])
def test_a_second_ctrl_c_does_not_wait_and_says_what_is_left(
    roco: Roco, tmp_path: Path, verb: str
) -> None:
    """The fleet was asked to end, and goes on ending."""
    process = roco("slow", verb)
    supervisor = fleet_of(tmp_path)

    def ended() -> bool:
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(2 * interrupts.AGAIN_S)
        return process.poll() is not None

    until(ended)
    _, said = process.communicate()
    assert process.returncode == 130
    assert "not waited for: the end of ta goes on" in said
    assert "roco down --run-dir runs/" in said
    assert folders.is_service(supervisor, *folders.SUPERVISORS)
    (next(tmp_path.glob("runs/*")) / "may-end").touch()
    until(lambda: not folders.is_service(supervisor, *folders.SUPERVISORS))


@pytest.mark.parametrize("number", ENDINGS)
def test_a_viewer_ends_with_the_command_that_shows_it(tmp_path: Path, number: int) -> None:
    """Also what it runs in its turn, as Rerun's command does."""
    process = subprocess.Popen(
        [sys.executable, "-c", SHOWING, VIEWER], cwd=tmp_path, stderr=subprocess.DEVNULL
    )
    file = tmp_path / "pids"
    until(lambda: file.exists() and file.read_text().endswith("\n"))
    child = int(file.read_text())
    process.send_signal(number)
    process.wait(PATIENCE_S)
    until(lambda: not proc.command_line(child))  # nor has one that nobody waited for any


def test_a_signal_waits_for_what_must_not_be_cut() -> None:
    """It comes when it is let go, not before, and not after it was."""
    reached = []
    with interrupts.heard(), pytest.raises(KeyboardInterrupt), interrupts.held() as let_go:  # noqa: PT012
        signal.raise_signal(signal.SIGTERM)
        reached.append("started")
        let_go()
        reached.append("never")
    assert reached == ["started"]


def test_a_line_is_there_at_once_for_a_program_that_reads() -> None:
    """Also in a pipe, while the verb goes on."""
    with running(PRINTING) as (_, said):
        assert said.readline() == b"line\n"


@pytest.mark.parametrize("size", [100, 10_000, 1_000_000])
def test_an_interrupt_cuts_no_line_for_programs(size: int) -> None:
    """Wherever it comes, and although the reader is slower; the last line stands by itself."""
    with running(TELLING, str(size)) as (process, said):
        said.readline()
        process.send_signal(signal.SIGINT)
        *lines, last = said
        assert process.wait(PATIENCE_S) == 0
    assert {len(line) for line in lines} <= {size + len('""\n')}
    assert last == b'"end"\n'


def test_a_second_ctrl_c_ends_a_line_that_nobody_reads() -> None:
    """The command stands in a full pipe."""
    with running(TELLING, "1000000") as (process, said):
        said.read(1)

        def interrupted() -> bool:
            process.send_signal(signal.SIGINT)
            return process.poll() is not None

        until(interrupted)


def test_handlers_are_as_before() -> None:
    """An ignored SIGHUP stays ignored: nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupts.heard():
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)

"""The fork server with real processes: what it makes runs as if an interpreter of its own ran it,
or not at all.
"""

import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from worker_entries import At, Count, counting

from agent_runtime.io import fork_server
from agent_runtime.io.fleet_processes import deleted_files, set_stop, started_in
from agent_runtime.io.fork_server import FORKS_VARIABLE, UNKNOWN, Forked, Handed, fork
from agent_runtime.io.run_files import FLEET_VARIABLE, RUN_FOLDER_VARIABLE, STOP_FILE, STOP_HELD
from agent_runtime.io.worker import Worker

pytestmark = pytest.mark.process

HERE = str(Path(__file__).parent)
TELLS = """
import os, sys, threading
word, threads = os.environ.get("WORD"), threading.active_count()
print(__name__, sys.argv[1:], word, os.getcwd(), threads, flush=True)
print("read", os.read(int(sys.argv[1]), 9), file=sys.stderr)
"""
ENDS = """
import os, signal, sys
match sys.argv[1]:
    case "killed": os.kill(os.getpid(), signal.SIGKILL)
    case "raises": raise LookupError("nothing found")
    case "text": sys.exit("no such scene")
    case "none": sys.exit()
    case number: sys.exit(int(number))
"""
WAITS = "import signal, sys; print('runs', flush=True); signal.pause()"


class Forks:
    """A fork server in a run folder whose path is longer than an address of a socket may be."""

    def __init__(self, folder: Path) -> None:
        self.run = folder / ("long" * 30)
        self.run.mkdir()
        self.code = folder / "code"
        self.code.mkdir()
        self.log = folder / "log"
        for name, text in (
            ("tells", TELLS),
            ("ends", ENDS),
            ("waits", WAITS),
            ("kept", "WORD = 1\n"),
        ):
            (self.code / f"{name}.py").write_text(text)
        self.environment = os.environ | {
            RUN_FOLDER_VARIABLE: str(self.run),
            FORKS_VARIABLE: str(self.run / "forks.sock"),
            "PYTHONPATH": f"{self.code}:{HERE}",
            "OMP_NUM_THREADS": "1",
            "PYTHONUNBUFFERED": "1",
        }
        command = [
            sys.executable,
            "-m",
            "agent_runtime.io.fork_server",
            "kept",
            "nowhere",
            "worker_entries",
        ]
        self.server = subprocess.Popen(command, env=self.environment, stdin=subprocess.DEVNULL)
        until(lambda: (self.run / "forks.ready").exists())

    def fork(self, module: str, *arguments: str, **more: str) -> Forked | None:
        """Ask for a process that writes into the log."""
        with self.log.open("ab") as log:
            hand = [Handed(log.fileno(), 1), Handed(log.fileno(), 2)]
            return fork(
                module, *arguments, environment=self.environment | more, hand=hand, session=True
            )

    def close(self) -> None:
        """End it."""
        self.server.send_signal(signal.SIGCONT)
        self.server.terminate()
        self.server.wait()


@pytest.fixture
def forks(tmp_path: Path) -> Iterator[Forks]:
    made = Forks(tmp_path)
    yield made
    made.close()


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def made(one: Forked | None) -> Forked:
    assert one is not None
    return one


def test_what_is_forked_runs_as_if_it_was_started(
    forks: Forks, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arguments, environment, folder and files are those asked for; the module is the main one; one
    thread runs.
    """
    monkeypatch.chdir(tmp_path)
    inside, outside = os.pipe()
    os.write(outside, b"a word")
    with forks.log.open("ab") as log:
        hand = [Handed(log.fileno(), 1), Handed(log.fileno(), 2), Handed(inside, 40)]
        one = made(
            fork("tells", "40", "two", environment=forks.environment | {"WORD": "here"}, hand=hand)
        )
    os.close(inside)
    os.close(outside)
    assert one.wait() == 0
    assert forks.log.read_text() == f"__main__ ['40', 'two'] here {tmp_path} 1\nread b'a word'\n"


def test_words_that_are_not_utf_8_arrive(forks: Forks) -> None:
    """A variable and an argument may be any bytes, as they may for a process that is started."""
    word = os.fsdecode(b"caf\xe9")
    one = made(forks.fork("ends", "text", word, WORD=word))
    assert one.wait() == 1
    assert forks.log.read_text() == "no such scene\n"
    assert made(forks.fork("tells", "1", word, WORD=word)).wait() == 1
    assert (
        f"__main__ ['1', {word!r}] {word} ".encode(errors="surrogateescape")
        in forks.log.read_bytes()
    )


@pytest.mark.parametrize("how", ["killed", "raises", "text", "none", "0", "3"])
def test_it_ends_as_one_that_was_started(how: str, forks: Forks) -> None:
    """Exit code and last words are those of `python -m`."""
    one = made(forks.fork("ends", how))
    alone = subprocess.run(
        [sys.executable, "-m", "ends", how], env=forks.environment, capture_output=True, text=True
    )
    assert one.wait() == alone.returncode
    assert forks.log.read_text().splitlines()[-1:] == alone.stderr.splitlines()[-1:]


def test_it_is_called_by_its_module(forks: Forks) -> None:
    """The tools tell a process by its command line and its run folder."""
    one = made(forks.fork("waits", "a", "b"))
    words, settings = (
        Path(f"/proc/{one.pid}/{file}").read_bytes() for file in ("cmdline", "environ")
    )
    assert words.rstrip(b"\0").split(b"\0") == [
        word.encode() for word in (sys.executable, "-P", "-m", "waits", "a", "b")
    ]
    assert f"{RUN_FOLDER_VARIABLE}={forks.run}".encode() in settings.split(b"\0")
    assert os.getsid(one.pid) == one.pid
    one.terminate()
    assert one.wait() == -signal.SIGTERM, forks.log.read_text()


def test_a_file_that_changed_is_not_run_from_memory(forks: Forks) -> None:
    """Who edits a service and starts it again gets what is in the file."""
    assert made(forks.fork("ends", "0")).wait() == 0
    kept = forks.code / "kept.py"
    os.utime(kept, ns=(0, kept.stat().st_mtime_ns + 1))
    assert forks.fork("ends", "0") is None
    assert forks.server.poll() is None


@pytest.mark.parametrize(
    "variable", ["LD_PRELOAD", "PYTHONHASHSEED", "OMP_NUM_THREADS", "GLIBC_TUNABLES"]
)
def test_what_counts_at_the_start_only_is_not_lost(variable: str, forks: Forks) -> None:
    """A library to be loaded first, such as a clock of its own, needs an interpreter of its own."""
    assert forks.fork("ends", "0", **{variable: "7"}) is None
    assert made(forks.fork("ends", "0", WORD="7")).wait() == 0


def test_nothing_runs_for_who_has_given_up(forks: Forks, monkeypatch: pytest.MonkeyPatch) -> None:
    """A server that hangs makes nothing later: the process would run twice."""
    monkeypatch.setattr(fork_server, "WITHIN_S", 0.2)
    forks.server.send_signal(signal.SIGSTOP)
    assert forks.fork("tells", "0") is None
    forks.server.send_signal(signal.SIGCONT)
    monkeypatch.undo()
    assert made(forks.fork("ends", "text")).wait() == 1  # served after the one before
    assert forks.log.read_text() == "no such scene\n"


def test_what_was_forked_outlives_the_server(forks: Forks) -> None:
    """Its end is seen, but its exit code is unknown. Nothing more is forked."""
    one = made(forks.fork("waits"))
    until(lambda: forks.log.exists() and "runs" in forks.log.read_text())
    forks.server.kill()
    forks.server.wait()
    assert one.poll() is None
    assert forks.fork("ends", "0") is None
    one.kill()
    assert (one.wait(), one.poll()) == (UNKNOWN, UNKNOWN)
    one.kill()  # of one that ended, nothing happens


def test_nonsense_does_not_end_the_server(forks: Forks) -> None:
    """A connection with no valid request is closed."""
    for words in (b"", b"nonsense", b'{"module":1}'):
        line = fork_server.socket.socket(
            fork_server.socket.AF_UNIX, fork_server.socket.SOCK_SEQPACKET
        )
        with line, fork_server.short(forks.run / "forks.sock") as address:
            line.connect(address)
            if words:
                line.send(words)
                assert line.recv(8) == b""
    assert made(forks.fork("ends", "3")).wait() == 3


def test_a_worker_is_forked_where_there_is_a_server(
    forks: Forks, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It talks and ends as one that was started, and it is a child of the server."""
    for name, value in forks.environment.items():
        monkeypatch.setenv(name, value)
    heard: queue.Queue[Any] = queue.Queue()
    ends: queue.Queue[str] = queue.Queue()
    worker = Worker("worker_entries:count", answers=At, on_message=heard.put, on_end=ends.put)
    for _ in counting(worker, heard, Count(2, b"x" * 100_000)):
        assert f"\nPPid:\t{forks.server.pid}\n" in Path(f"/proc/{worker.pid}/status").read_text()
    assert ends.get(timeout=20) == "exit status 0"
    worker.kill()


def test_any_thread_may_wait(forks: Forks) -> None:
    """All of them get the exit code, whichever sees the end first."""
    one, codes = made(forks.fork("waits")), queue.Queue[int]()
    threads = [threading.Thread(target=lambda: codes.put(one.wait())) for _ in range(8)]
    for thread in threads:
        thread.start()
    one.terminate()
    for thread in threads:
        thread.join()
    assert [codes.get() for _ in threads] == [-signal.SIGTERM] * 8


def test_without_a_server_nothing_is_forked(tmp_path: Path) -> None:
    """Then the process is started in the usual way."""
    assert fork("ends", environment={}, hand=[]) is None
    assert fork("ends", environment={FORKS_VARIABLE: str(tmp_path / "forks.sock")}, hand=[]) is None
    assert (
        fork("ends", environment={FORKS_VARIABLE: str(tmp_path / "no" / "forks.sock")}, hand=[])
        is None
    )


# --- Processes of a fleet that live ---------------------------------------------------------------


pytestmark = pytest.mark.process
LOOP = """
import mmap, os, sys, time
file = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT, 0o600)
os.pwrite(file, b"\\0", 0)
byte = mmap.mmap(file, 1)
print("mapped", flush=True)
while byte[:1] != b"\\1":
    time.sleep(0.001)
print("held", flush=True)
while byte[:1] != b"\\0":
    time.sleep(0.001)
print("released", flush=True)
"""
"""As the control loop does: it has the stop flag mapped."""
Loops = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run folder."""
    folder = tmp_path / "run"
    folder.mkdir()
    return folder


@pytest.fixture
def loop() -> Iterator[Loops]:
    """Starts a process with the stop flag of a run mapped, of a fleet or of none."""
    started: list[subprocess.Popen[str]] = []

    def begin(run: Path, fleet: str = "f1") -> "subprocess.Popen[str]":
        variables = os.environ | {RUN_FOLDER_VARIABLE: str(run), FLEET_VARIABLE: fleet}
        command = [sys.executable, "-P", "-c", LOOP, str(run / STOP_FILE)]
        started.append(subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, text=True))
        assert line(started[-1]) == "mapped"
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def line(process: "subprocess.Popen[str]") -> str:
    """The next line of a process; pytest's time-out ends a wait for ever."""
    assert process.stdout is not None
    return process.stdout.readline().strip()


@pytest.mark.parametrize("gone", [False, True])
def test_a_stop_reaches_a_loop_whose_folder_is_gone(run: Path, loop: Loops, gone: bool) -> None:
    """So does the release; in a folder that was made again the flag tells the same."""
    process = loop(run)
    if gone:
        shutil.rmtree(run)
        run.mkdir()
    set_stop(run, held=True)
    assert line(process) == "held"
    assert (run / STOP_FILE).read_bytes() == STOP_HELD
    set_stop(run, held=False)
    assert line(process) == "released"


def test_a_stop_without_any_folder_is_no_error_if_a_loop_hears_it(run: Path, loop: Loops) -> None:
    """Without a loop it is one."""
    process = loop(run)
    shutil.rmtree(run)
    set_stop(run, held=True)
    assert line(process) == "held"
    process.kill()
    process.wait()
    with pytest.raises(FileNotFoundError):
        set_stop(run, held=True)


def test_only_processes_of_the_fleet_are_meant(run: Path, loop: Loops, tmp_path: Path) -> None:
    """Neither a shell in which the run folder is set, nor what runs for another folder."""
    mine, shell = loop(run), loop(run, fleet="")
    (tmp_path / "other").mkdir()
    other = loop(tmp_path / "other")
    assert started_in(run) == (mine.pid,)
    shutil.rmtree(run)
    assert {file.parts[2] for file in deleted_files(run, STOP_FILE)} == {str(mine.pid)}
    assert {shell.poll(), other.poll()} == {None}

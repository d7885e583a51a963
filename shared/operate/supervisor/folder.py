"""The run folder as the supervisor keeps it: made, pointed at, and told the state of the fleet
(docs/run-folder.md).

The supervisor has all that it writes in memory. A disk that is full, or a folder that was deleted,
does not end it: what could not be written is written once that is possible.
"""

import fcntl
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

import msgspec

from agent_runtime.io.fleet_processes import started_in, variables
from agent_runtime.io.fork_server import Other
from agent_runtime.io.run_files import (
    RUN_FOLDER_VARIABLE,
    STOP_FILE,
    STOP_RELEASED,
    heartbeat_file,
    make_run,
    write_whole,
)
from operate import proc
from operate.file_names import FLEET_FILE, LATEST, LOCK_FILE, OFF_SUFFIX
from operate.fleet_file import Fleet
from operate.system import ORDERLY_STOP_S, Process

MOST_BYTES = 32 * 1024 * 1024
"""Of what a process prints, as of its log (agent_runtime.io.logs; estimate)."""

TRACEBACK = "Traceback (most recent call last):"
READ_BYTES = 16_384
"""Of the end of a log; estimate: four long tracebacks."""
LEAST_ROOM = 16 << 20
"""Bytes without which a process may fail to start: a loop's mapped files have 10 MB, a record some
kB (estimate).
"""
FAREWELL_LINES = 8
"""From the exception on which a process ends to the end of its log, at most: it closes what it has
(estimate).
"""


def make(run: Path, *, latest: bool = True) -> None:
    """Make the folder with its stop flag, nobody switched off, no fleet told.

    `latest`: let the link beside it point to it.
    """
    make_run(run)
    (run / FLEET_FILE).unlink(missing_ok=True)
    flag = run / STOP_FILE
    if not flag.exists():
        flag.write_bytes(STOP_RELEASED)
    for name in off(run):
        (run / f"{name}{OFF_SUFFIX}").unlink(missing_ok=True)
    link = run.parent / LATEST
    if latest and (link.is_symlink() or not link.exists()):
        beside = run.parent / f".{LATEST}-{os.getpid()}"
        beside.symlink_to(run.name)
        beside.replace(link)


class Files:
    """Files of the supervisor in its run folder, as they are wanted. No OSError leaves it."""

    def __init__(self, run: Path) -> None:
        self._run = run
        self._owed: dict[Path, bytes | None] = {}
        self._off: frozenset[str] = frozenset()
        self.why = ""
        """Why something could not be written; "" where nothing is owed."""

    def put(self, file: Path, data: bytes | None) -> None:
        """Have this in a file of the folder, which a reader sees whole; None: have no such file."""
        self._owed[file] = data
        self.settle()

    def tell(self, fleet: Fleet) -> None:
        """Have the fleet in fleet.json."""
        told = msgspec.json.format(msgspec.json.encode(fleet), indent=2)
        self.put(self._run / FLEET_FILE, told + b"\n")

    def settle(self) -> None:
        """Write what is owed, as far as that is possible now."""
        before, self.why = self.why, ""
        for file, data in list(self._owed.items()):
            try:
                _write(file, data)
                del self._owed[file]
            except OSError as error:
                self.why = f"{file} cannot be written: {error.strerror}"
        if self.why != before:
            again = f"{self.why}; the fleet goes on, and it is tried again"
            words = again if self.why else "all is written again"
            with suppress(OSError):  # the words go to the same disk
                print(words, flush=True)

    def no_room(self) -> str:
        """Return in words why a process that starts may find no room in the folder; "" where there
        is some.
        """
        with suppress(OSError):
            if (free := shutil.disk_usage(self._run).free) < LEAST_ROOM:
                return f"the disk of {self._run} has {free / 1e6:.1f} MB free"
        return self.why

    def off(self) -> frozenset[str]:
        """Return the processes that shall not run; as last seen, where the folder cannot be
        read.
        """
        with suppress(OSError):
            self._off = off(self._run)
        return self._off

    def log(self, name: str) -> IO[bytes]:
        """Return the open log of a process; where there can be none, what it writes is lost."""
        try:
            make_run(self._run)
            return log_file(self._run, name).open("ab")
        except OSError:
            return open(os.devnull, "ab")


def _write(file: Path, data: bytes | None) -> None:
    """Write a file, or remove it. Raise OSError."""
    if data is None:
        with suppress(FileNotFoundError):
            file.unlink()
        return
    make_run(file.parent)
    write_whole(file, data)


def ready_file(run: Path, name: str) -> Path:
    """The file a process makes when it can serve."""
    return run / f"{name}.ready"


def beat(run: Path, name: str) -> int:
    """Return the time of its last heartbeat [ns]; 0: none. Only whether it changes means
    anything.
    """
    try:
        return os.stat(heartbeat_file(run, name)).st_mtime_ns
    except OSError:
        return 0


def pid_file(run: Path, name: str) -> Path:
    """Return the file of the process id while a process runs."""
    return run / f"{name}.pid"


def log_file(run: Path, name: str) -> Path:
    """Return the file of a process's standard output and error."""
    return run / f"{name}.log"


def keep_small(log: Path) -> None:
    """Truncate a process's output file once it is too long, after a copy to LOG.1.

    The process appends to an open file, so the file stays; what it writes between the copy and the
    cut is lost.
    """
    with suppress(OSError):
        if log.stat().st_size > MOST_BYTES:
            shutil.copyfile(log, log.with_name(f"{log.name}.1"))
            os.truncate(log, 0)


def off(run: Path) -> frozenset[str]:
    """Return the processes that shall not run: each has a file NAME.off."""
    names = os.listdir(run)
    return frozenset(one.removesuffix(OFF_SUFFIX) for one in names if one.endswith(OFF_SUFFIX))


def last_words(log: Path) -> str:
    """The reason that a log ends with: the exception of a traceback near its end, else its last
    line, "" for none.
    """
    try:
        with log.open("rb") as file:
            file.seek(0, os.SEEK_END)
            file.seek(max(0, file.tell() - READ_BYTES))
            text = file.read().decode(errors="replace")
    except OSError:
        return ""
    lines = [line for line in text.split("\n") if line.strip()]
    if not lines:
        return ""
    begins = [number for number, line in enumerate(lines) if TRACEBACK in line]
    after = range(begins[-1] + 1, len(lines)) if begins else range(0)
    ends = next((number for number in after if not lines[number].startswith(" ")), 0)
    return lines[ends if ends and len(lines) - ends <= FAREWELL_LINES else -1].strip()


# --- Its owner: one supervisor at a time; and what a dead one left running ------------------------
# Children of a supervisor that is killed go on, as the robot must not drop the jar for it. The next
# one of the same folder ends them first, in order: a second router or control loop beside them
# would be two masters of one robot.


TAKE_S = 1.0  # estimate: who only looks whether the lock is held has it for some microseconds


class KeptError(Exception):
    """Another supervisor keeps this run folder."""

    def __init__(self, run: Path, pid: str) -> None:
        super().__init__(
            f"the fleet of {run} runs already (supervisor {pid or 'unknown'}); `roco down` ends it"
        )


@contextmanager
def kept(run: Path) -> Iterator[None]:
    """Keep this folder alone as long as the block lasts; it is made where missing. Raise KeptError,
    OSError.
    """
    make_run(run)
    # not inherited by children: it ends with this process
    with (run / LOCK_FILE).open("a+") as lock:
        _take(run, lock.fileno())
        lock.truncate(0)
        lock.write(f"{os.getpid()}\n")
        lock.flush()
        yield
        lock.truncate(0)


def _take(run: Path, lock: int) -> None:
    until = time.monotonic() + TAKE_S
    while True:
        try:
            return fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > until:
                raise KeptError(run, (run / LOCK_FILE).read_text().strip()) from None
        time.sleep(0.01)


class Left(Other):
    """A process that a dead supervisor left; as much of subprocess.Popen as the shell needs."""

    def poll(self) -> int | None:
        """Return 0 once it has ended; its exit code is its parent's to know."""
        return 0 if self.ended() else None


def left(run: Path, processes: tuple[Process, ...]) -> dict[str, Left]:
    """Return what lives of these processes, by the pid files of a run of which nobody keeps
    anything.
    """
    found = {}
    for process in processes:
        try:
            one = Left(int(pid_file(run, process.name).read_text()))
            # A number that somebody else uses again is not of a process that runs this module in
            # this folder.
            place = variables(one.pid).get(RUN_FOLDER_VARIABLE)
            if process.module in proc.command_line(one.pid) and place == str(run):
                found[process.name] = one
        except (OSError, ValueError):
            continue
    return found


def end_others(run: Path) -> None:
    """End what else fleets of this folder left: all that was started for one, but this process."""
    others = []
    for pid in started_in(run):
        with suppress(ProcessLookupError):  # it has ended since
            others += [Left(pid)] if pid != os.getpid() else []
    for one in others:
        one.terminate()
    until = time.monotonic() + ORDERLY_STOP_S
    for one in others:
        if not one.ended(max(0.0, until - time.monotonic())):
            one.kill()

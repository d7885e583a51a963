"""Names in a run folder, and the variables that name it (docs/run-folder.md); how its files are
written; the heartbeat file of a process that is no agent; addresses at which people are heard.
"""

import errno
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

import msgspec

RUN_FOLDER_VARIABLE = "ROCO_RUN_DIR"
FLEET_VARIABLE = "ROCO_FLEET"  # id of the fleet that a supervisor started a process for
KEYS_VARIABLE = "ROCO_TLS_DIR"  # a folder of keys; none: nothing is encrypted
KEYS_FOLDER = "keys"  # certificates and private keys of this run, mode 0700 (docs/security.md)
# The stop flag: one byte, written in place (a process may hold the file mapped; a rename would cut
# it off).
STOP_FILE = "stop"
STOP_RELEASED = b"\x00"
STOP_HELD = b"\x01"
LOOPBACK = ("127.0.0.1", 0)  # a free port


def heartbeat_file(run: Path, name: str) -> Path:
    """The file that a process writes or touches each second."""
    return run / f"{name}.heartbeat.json"


def ready_file(run: Path, name: str) -> Path:
    """The file that says that a process is ready."""
    return run / f"{name}.ready"


def make_run(run: Path) -> None:
    """Make a run folder that other users cannot enter: TLS would hide nothing from who reads the
    recording.

    One that is there keeps its mode. Raise OSError, also where its path is not UTF-8: files of the
    run would name it.
    """
    try:
        str(run).encode()
    except UnicodeEncodeError as error:
        raise OSError(
            errno.EILSEQ, "this path is not UTF-8; rename its folders, or name another path", run
        ) from error
    run.mkdir(mode=0o700, parents=True, exist_ok=True)


class LinkedError(OSError):
    """A symbolic link stands where a file of a run is written in place."""

    def __init__(self, path: Path) -> None:
        super().__init__(
            f"{path} is a symbolic link, and is not written through: remove it; a run's files are"
            " its own"
        )


def opened(path: Path, flags: int, mode: int = 0o666) -> int:
    """Open a file of a run that is written in place. Raise OSError; LinkedError where a symbolic
    link stands there: the run may be another user's, who would choose the file that is written.
    """
    try:
        return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, mode)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise LinkedError(path) from error
        raise


@contextmanager
def replaced(path: Path, mode: int = 0o666) -> Iterator[BinaryIO]:
    """A new file that takes the place of another by rename: a reader sees the old one or the new
    one, whole.

    A symbolic link in its place is replaced, and never followed. Raise OSError.
    """
    beside = f".{path.name}.new"
    folder = os.open(path.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(FileNotFoundError):
            os.unlink(beside, dir_fd=folder)  # left by one that was killed
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        try:
            with os.fdopen(os.open(beside, flags, mode, dir_fd=folder), "w+b") as file:
                yield file
            os.replace(beside, path.name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(FileNotFoundError):
                os.unlink(beside, dir_fd=folder)
            raise
    finally:
        os.close(folder)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file by `replaced`."""
    with replaced(path) as file:
        file.write(data)


def write_secret(path: Path, data: bytes) -> None:
    """Write a file that only its owner can read, by `replaced`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path, 0o600) as file:
        file.write(data)


def listen_at(text: str) -> tuple[str, int]:
    """Host and port of host:port; LOOPBACK for "". Raise ValueError for anything else."""
    if not text:
        return LOOPBACK
    host, colon, port = text.rpartition(":")
    if not (host and colon and port.isascii() and port.isdecimal() and int(port) < 65536):
        raise ValueError(
            f"{text!r} is not an address to listen at, expected host:port, such as 127.0.0.1:8350"
        )
    return host, int(port)


# --- The heartbeat of a process that is no agent --------------------------------------------------
# `<name>.heartbeat.json`, whose time of change is the last beat.
# Who supervises from outside (deploy/healthy) ends a process whose heartbeat stands still and
# starts another. An agent's heartbeat says more, and others hear it (shell.py); a router, a
# recorder and a control loop have this one.


PERIOD_S = 1.0
"""As an agent's."""


class ProcessHeartbeat:
    """Beats when asked to, at most once in PERIOD_S: for each turn of a loop."""

    def __init__(self, run: Path, name: str) -> None:
        """Write the file with the process id, which is the first beat. Raises OSError."""
        self.file = heartbeat_file(run, name)
        self._data = msgspec.json.encode({"name": name, "pid": os.getpid()})
        self._next = 0.0
        self._write()

    def beat(self) -> None:
        """Say that the process gets on: a change of the file's time, no more. A run folder that is
        gone is made again.

        A beat that cannot be written is missed.
        """
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + PERIOD_S
        try:
            os.utime(self.file)
        except OSError:
            with suppress(OSError):
                make_run(self.file.parent)
                self._write()

    def _write(self) -> None:
        write_whole(self.file, self._data)


class Turns:
    """Beats for a loop that may not wait for a disk: it counts its turns, a thread sees that they
    go on.

    Before the first turn it beats as long as the process runs.

    Start it before the loop takes a real-time priority, which a new thread would inherit.
    """

    def __init__(self, pulse: ProcessHeartbeat, period_s: float = PERIOD_S) -> None:
        self.count = 0
        self._pulse, self._period_s = pulse, period_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="pulse", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Beat no more."""
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        seen = -1
        while not self._ended.wait(self._period_s):
            if self.count != seen or not self.count:
                seen = self.count
                self._pulse.beat()

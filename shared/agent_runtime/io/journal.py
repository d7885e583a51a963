"""The journal: an append-only file with one synced record per durable step (write-ahead; the last
record wins).

Each record is the whole durable state, so the last one is the state. A torn tail (killed while
writing) was neither receipted nor sent, hence it is cut off; a damaged record with whole ones
behind it is not from a kill, and the file is refused (`repair`). At open, and whenever the file has
grown past COMPACT_BYTES, it is rewritten with one record. A write that fails leaves the file as it
was before, whatever part of it came through. It knows bytes only, not what they mean.
"""

import errno
import fcntl
import os
import secrets
import struct
import time
import zlib
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.core.errors import JournalError
from agent_runtime.core.peers import begin_again
from agent_runtime.core.state import Record
from agent_runtime.io.logs import Log
from agent_runtime.io.run_files import opened

# --- The bytes of a journal file: a first line with the format's version, then framed records.
# Knows no file
# A frame is <mark 4 bytes><length u32><crc32 u32><record>, little endian. The mark is searched for
# only where a frame is damaged, to see whether whole records follow: a tail that a kill tore off
# has none behind it.


VERSION = 3
NAME = b"roco-journal-"
MAGIC = NAME + b"%d\n" % VERSION
MARK = b"\xc1REC"  # 0xc1 begins no MessagePack value, so a record seldom holds it
HEAD = struct.Struct("<4sII")
LARGEST_RECORD = 256 * 1024 * 1024  # estimate: a length beyond it is garbage


class Scan(msgspec.Struct, frozen=True):
    """Contents of a file. `good`: records, `last`: the newest of them, `end`: the offset behind it.

    `damaged`: offsets at which bytes begin that are not a record and have whole records behind
    them.
    """

    good: int
    last: bytes | None
    end: int
    damaged: tuple[int, ...] = ()


def version(data: bytes) -> int | None:
    """The version in the first line; None where it is not that of a journal, or is not whole."""
    line = data[: len(NAME) + 8].partition(b"\n")
    number = line[0].removeprefix(NAME)
    return int(number) if line[1] and line[0].startswith(NAME) and number.isdigit() else None


def frame(record: bytes) -> bytes:
    """A record as it stands in the file."""
    return HEAD.pack(MARK, len(record), zlib.crc32(record)) + record


def records(data: bytes) -> Iterator[bytes]:
    """All whole records up to the first that is not, oldest first; none of a file of another
    version.
    """
    at = len(MAGIC) if data.startswith(MAGIC) else len(data)
    while (record := _record(data, at)) is not None:
        yield record
        at += HEAD.size + len(record)


def last_record(data: bytes) -> bytes | None:
    """The last whole record before anything damaged; None where there is none."""
    return next(iter(deque(records(data), maxlen=1)), None)


def scan(data: bytes) -> Scan:
    """Look through a whole file, also behind damaged places."""
    at = len(MAGIC) if data.startswith(MAGIC) else 0
    good, last, end = 0, None, at
    damaged: list[int] = [] if at else [0]
    while at < len(data):
        record = _record(data, at)
        if record is None:
            if not damaged or damaged[-1] < end:
                damaged.append(end)
            at = data.find(MARK, at + 1)
            if at < 0:
                break
            continue
        good, last = good + 1, record
        at = end = at + HEAD.size + len(record)
    return Scan(good, last, end, tuple(place for place in damaged if place < end))


def _record(data: bytes, at: int) -> bytes | None:
    """The whole record whose frame begins at an offset, None where none does."""
    if at + HEAD.size > len(data):
        return None
    mark, length, crc = HEAD.unpack_from(data, at)
    if mark != MARK or length > LARGEST_RECORD or at + HEAD.size + length > len(data):
        return None
    body = data[at + HEAD.size : at + HEAD.size + length]
    return body if zlib.crc32(body) == crc else None


# --- The journal ----------------------------------------------------------------------------------


COMPACT_BYTES = 64 * 1024 * 1024
"""Estimate: some hundred records of a full world model; rewriting takes well under 0.1 s."""
NAME_BYTES = 6


def new_name() -> str:
    """A random name for a new journal; two alike are as good as impossible."""
    return secrets.token_hex(NAME_BYTES)


def journal_file(run: Path, agent: str) -> Path:
    return run / "journal" / f"{agent}.journal"


def locked(path: Path) -> int:
    """Take a journal for this process alone; return the descriptor that holds it. Raise
    JournalError where it is held.

    Raise OSError where the lock cannot be made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = opened(path.with_name(path.name + ".lock"), os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(lock)
        raise JournalError(path, "another process holds it", "stop that agent first") from error
    return lock


def looked_through(path: Path, data: bytes) -> Scan:
    """What the file holds. Raise JournalError for another format; a torn first line is an empty
    journal.
    """
    if MAGIC.startswith(data[: len(MAGIC)]):
        return scan(data) if data.startswith(MAGIC) else Scan(0, None, 0)
    other = version(data)
    if other is None:
        what = "this file is not a journal"
        raise JournalError(path, what, "move it away or choose another run folder")
    what = f"it is of format {other}, this version of the software reads format {VERSION}"
    hint = (
        "use the version that wrote it, or delete it: the agent then begins with an empty memory,"
        " and its peers know"
    )
    raise JournalError(path, what, hint)


class Journal:
    """The open journal file of one agent; the process that holds it is the only one (flock)."""

    def __init__(self, path: Path) -> None:
        """Open or create. Raises JournalError where it is held, of another format or damaged,
        OSError for the disk.
        """
        self.path = path
        self._fd = -1
        self._size = 0
        self._lock = locked(path)
        try:
            found = looked_through(path, path.read_bytes() if path.exists() else b"")
            if found.damaged:
                what = f"the record at byte {found.damaged[0]} is damaged, and whole ones follow it"
                hint = f"look at the disk; then: roco agent repair {path.stem}"
                raise JournalError(path, what, hint)
            self.last = found.last
            self._rewrite(self.last)
        except BaseException:
            os.close(self._lock)
            raise

    def append(self, record: bytes) -> None:
        """Write one record; when this returns it is on the disk. Raises OSError, and the file is as
        it was.
        """
        if self._size > COMPACT_BYTES:
            self._rewrite(record)
        else:
            data = frame(record)
            try:
                _write(self._fd, data)
                os.fdatasync(self._fd)
            except OSError:
                os.ftruncate(self._fd, self._size)
                raise
            self._size += len(data)
        self.last = record

    def close(self) -> None:
        """Give the journal up; a second close does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            os.close(self._lock)
            self._fd = -1

    def _rewrite(self, record: bytes | None) -> None:
        """Put a file with at most one record in the place of the old one, atomically."""
        fd, size = put(self.path, record)
        if self._fd >= 0:
            os.close(self._fd)
        self._fd, self._size = fd, size


def put(path: Path, record: bytes | None) -> tuple[int, int]:
    """Put a journal with at most one record in the place of a file; return its descriptor and size.
    Raise OSError.
    """
    fresh, data = (
        path.with_name(path.name + ".new"),
        MAGIC + (frame(record) if record is not None else b""),
    )
    fd = opened(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o600)
    try:
        _write(fd, data)
        os.fsync(fd)
        os.replace(fresh, path)
    except OSError:
        os.close(fd)
        with suppress(OSError):
            fresh.unlink()
        raise
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
    return fd, len(data)


def _write(fd: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(fd, view) :]


# --- Repair: a damaged journal made usable again; its newest whole record is kept, and the damaged
# file beside it
# What came after the newest whole record cannot be known, and peers may have heard of it: then the
# agent goes on with that memory under another journal's name, so that its peers begin again with it
# (core.peers).


WHY = "this agent's journal was damaged, and what it knew of this conversation is not certain"


class Repaired(msgspec.Struct, frozen=True):
    """Result of a repair. `kept`: the journal's bytes as they were, "" where nothing was wrong.
    `lost`: in words.
    """

    path: str
    good: int
    damaged: tuple[int, ...]
    kept: str
    lost: str


def repair(path: Path) -> Repaired:
    """Repair a journal. Raise JournalError where there is none, an agent holds it, or it is of
    another version.
    """
    if not path.exists():
        raise JournalError(path, "there is none", "look with `roco runs` which run folder is meant")
    lock = locked(path)
    try:
        data = path.read_bytes()
        found = looked_through(path, data) if data.startswith(NAME) else scan(data)
        tail = len(data) - found.end
        if not (found.damaged or tail):
            return Repaired(str(path), found.good, (), "", "nothing: it is whole")
        beside = free_name(path)
        os.link(path, beside)
        record, lost = _goes_on(found.last, tail)
        os.close(put(path, record)[0])
        return Repaired(str(path), found.good, found.damaged, str(beside), lost)
    finally:
        os.close(lock)


def _goes_on(last: bytes | None, tail: int) -> tuple[bytes | None, str]:
    """The record to go on from, and what is lost in words."""
    if last is None:
        return None, "everything: no record is whole, so the agent begins with an empty memory"
    if not tail:
        return last, "nothing: the newest record is whole, and each one is the agent's whole memory"
    record = msgspec.msgpack.decode(last, type=Record)
    peers = {held.conversation.peer for held in record.conversations.values()} | {
        *record.issued,
        *record.taken,
    }
    for peer in peers:
        begin_again(record, peer, WHY)
    record.journal = new_name()
    what = (
        f"what the agent did after its newest whole record ({tail} bytes behind it cannot be read)"
    )
    return msgspec.msgpack.encode(record), f"{what}; open conversations end: {len(record.lost)}"


def free_name(path: Path) -> Path:
    """A name beside the file that nothing has."""
    names = (
        path.with_name(f"{path.name}.damaged{f'-{number}' if number else ''}")
        for number in range(1000)
    )
    return next(name for name in names if not name.exists())


# --- Behaviour of an agent whose disk is full -----------------------------------------------------
# It says so once, keeps the events in order, and tries again.
# A step whose record cannot be written has not happened: nothing of it was receipted, sent or told.
# So the event waits, with those behind it, until there is room; peers send again what no receipt
# covers.


PAUSES_S = (0.1, 0.2, 0.5, 1.0)
"""Between tries; the last one again and again. Estimate: people free a disk in minutes."""
DISK = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "the file may not grow any more",
    errno.EIO: "the disk fails",
    errno.EROFS: "the disk is read-only",
}


def worded(path: object, error: OSError) -> str:
    """What is wrong with the disk, in words."""
    what = DISK.get(error.errno or 0, "the disk cannot be used")
    return f"{what}: {path} cannot be written ({error.strerror or error})"


class FullDisk:
    """State of one agent. `why`: what is wrong now, "" where nothing is; `events`: those that wait,
    oldest first.
    """

    def __init__(self, log: Log) -> None:
        self._log = log
        self._tries = 0
        self.why = ""
        self.events: deque[Any] = deque()

    def failed(self, path: object, error: OSError) -> None:
        """Note a write that failed; said once."""
        if not self.why:
            self.why = worded(path, error)
            why = (
                f"{self.why}; nothing is receipted, said or done until there is room, then it goes"
                " on by itself"
            )
            self._log.write("no room", level="error", why=why)

    def freed(self) -> None:
        """Note a write that came through."""
        if self.why:
            self.why, self._tries = "", 0
            self._log.write("room again", why="what waited goes on")

    def pause_s(self) -> float:
        """The time until the next try."""
        self._tries += 1
        return PAUSES_S[min(self._tries, len(PAUSES_S)) - 1]

    def wait_for_room(
        self, happen: Callable[[Any], None], beat: Callable[[], None], stopped: Callable[[], bool]
    ) -> None:
        """Try the steps that could not be recorded again, until they can or a signal comes; beat on
        meanwhile.
        """
        while self.events and not stopped():
            beat()
            time.sleep(self.pause_s())
            waiting, self.events = self.events, deque()
            for event in waiting:
                happen(event)


def overwrite(path: Path, data: bytes) -> None:
    """Write over a small file where there is no room for another beside it; a longer one is only
    touched.

    Raise OSError.
    """
    fd = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    try:
        size = os.fstat(fd).st_size
        if len(data) <= size:
            os.pwrite(fd, data.ljust(size), 0)  # JSON may end in blanks
    finally:
        os.utime(fd)
        os.close(fd)

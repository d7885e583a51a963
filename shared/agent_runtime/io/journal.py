"""The journal: an append-only file with one synced record per durable step (write-ahead; the last record wins).

A record is <length u32><crc32 u32><bytes>, little endian, after a magic line. Each record is the whole durable state,
so the last whole one is the state; a torn tail (killed while writing) was neither receipted nor sent, hence it is cut
off. At open, and whenever the file has grown past `COMPACT_BYTES`, the file is rewritten with that one record. It
knows bytes only, not what they mean.
"""

import fcntl
import os
import struct
import zlib
from pathlib import Path

from agent_runtime.core.errors import JournalError

MAGIC = b"roco-journal-1\n"
HEAD = struct.Struct("<II")
COMPACT_BYTES = (
    64 * 1024 * 1024
)  # estimate: some hundred records of a full world model; rewriting takes well under 0.1 s
LARGEST_RECORD = 256 * 1024 * 1024  # estimate: a length beyond it is garbage


def frame(record: bytes) -> bytes:
    """A record as it stands in the file."""
    return HEAD.pack(len(record), zlib.crc32(record)) + record


def last_record(data: bytes) -> bytes | None:
    """The last whole record in the file's bytes; None where there is none (also where only a torn magic is there)."""
    if not data.startswith(MAGIC):
        return None
    at, last = len(MAGIC), None
    while at + HEAD.size <= len(data):
        length, crc = HEAD.unpack_from(data, at)
        body = data[at + HEAD.size : at + HEAD.size + length]
        if length > LARGEST_RECORD or len(body) < length or zlib.crc32(body) != crc:
            break
        last, at = body, at + HEAD.size + length
    return last


class Journal:
    """The open journal file of one agent; the process that holds it is the only one (flock)."""

    def __init__(self, path: Path) -> None:
        """Open or create. Raises JournalError where another process holds it or the file has another format."""
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(path.with_name(path.name + ".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._lock)
            raise JournalError(path, "another process holds it", "stop that agent first") from error
        data = path.read_bytes() if path.exists() else b""
        if data and not MAGIC.startswith(data[: len(MAGIC)]):
            os.close(self._lock)
            raise JournalError(path, "this file is not a journal", "move it away or choose another run folder")
        self.last = last_record(data)
        self._fd = -1
        self._size = 0
        self._rewrite(self.last)

    def append(self, record: bytes) -> None:
        """Write one record; when this returns it is on the disk."""
        if self._size > COMPACT_BYTES:
            self._rewrite(record)
        else:
            self._write(frame(record))
            os.fdatasync(self._fd)
        self.last = record

    def close(self) -> None:
        """Give the journal up; a second close does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            os.close(self._lock)
            self._fd = -1

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[os.write(self._fd, view) :]
        self._size += len(data)

    def _rewrite(self, record: bytes | None) -> None:
        """Put a file with at most one record in the place of the old one, atomically."""
        fresh = self.path.with_name(self.path.name + ".new")
        fd = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND | os.O_CLOEXEC, 0o600)
        if self._fd >= 0:
            os.close(self._fd)
        self._fd, self._size = fd, 0
        self._write(MAGIC + (frame(record) if record is not None else b""))
        os.fsync(fd)
        os.replace(fresh, self.path)
        folder = os.open(self.path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)

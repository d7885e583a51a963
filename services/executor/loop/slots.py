"""Shared memory between the loop and the rest: fixed slots in an mmap'ed file, each with a single
writer.

A slot is a sequence number, a length and bytes. Its writer makes the number odd, writes, and makes
it even; a reader that sees an odd or a changed number reads again, so nobody waits for a lock. The
file outlives a process that dies. A new loop puts a new file in the same place; `LoopFile.replaced`
tells those who still hold the old one.

    command   agent -> loop    a motion, cancel or release, numbered by the slot itself
    beat      agent -> loop    a counter: the agent lives
    state     loop -> agent    LoopState, every few cycles
    told      loop -> agent    Told: what became of the last command, the present report
    truth     loop -> monitor  true state of the simulation; no agent may read it
    timing    loop -> monitor  how late the cycles were
"""

import mmap
import os
import struct
from pathlib import Path

import msgspec

from agent_runtime.io.run_files import make_run
from velma.errors import SlotError

MAGIC = b"VELMALP2"
_HEAD = struct.Struct("<QQ")  # sequence number, length
_COUNT = struct.Struct("<Q")

# Capacities in bytes. A motion of two minutes has 12000 knots of 120 bytes.
SIZES = {
    "command": 4 << 20,
    "beat": 8,
    "state": 16 << 10,
    "told": 16 << 10,
    "truth": 16 << 10,
    "timing": 16 << 10,
}
# a write takes microseconds; after this many failed reads the writer must have died in the middle
READ_TRIES = 50


class Slot:
    """One slot of a mapped file."""

    def __init__(self, view: memoryview) -> None:
        self._view, self.capacity = view, len(view) - _HEAD.size

    @property
    def number(self) -> int:
        """The sequence number: grows by 2 with each record; 0 before the first, odd during a
        write.
        """
        return int(_HEAD.unpack_from(self._view)[0])

    def write(self, record: bytes | bytearray | memoryview) -> int:
        """Replace the record (only one writer per slot); return its number. Raises SlotError if it
        does not fit.
        """
        if len(record) > self.capacity:
            raise SlotError("", f"a record of {len(record)} bytes", f"at most {self.capacity}")
        number = self.number | 1  # correct also after a writer that died in the middle
        _COUNT.pack_into(self._view, 0, number)
        self._view[_HEAD.size : _HEAD.size + len(record)] = record
        _HEAD.pack_into(self._view, 0, number, len(record))
        _COUNT.pack_into(self._view, 0, number + 1)
        return number + 1

    def read(self) -> tuple[int, bytes] | None:
        """Return the record and its number; None before the first one, or if it cannot be read
        whole.
        """
        for _ in range(READ_TRIES):
            number, length = _HEAD.unpack_from(self._view)
            if number == 0:
                return None
            if number % 2 == 0 and length <= self.capacity:
                record = bytes(self._view[_HEAD.size : _HEAD.size + length])
                if self.number == number:
                    return number, record
        return None


def begun(path: Path, size: int) -> tuple[int, Path]:
    """Return a new file that will be mapped, open, and its name until it takes the place of `path`;
    its owner's alone.

    All of its `size` [bytes] is on the disk: a write to a mapped page for which there is no room
    ends the process with SIGBUS. Raise OSError where there is none.
    """
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    file = os.open(fresh, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        os.posix_fallocate(file, 0, size)
    except OSError:
        os.close(file)
        fresh.unlink()
        raise
    return file, fresh


class LoopFile:
    """A mapped slot file, `slots` by name."""

    def __init__(self, path: Path, file: int) -> None:
        self.path, self._identity = path, os.fstat(file).st_ino
        try:
            self._map = mmap.mmap(file, _layout()[1])
        finally:
            os.close(file)
        self._view = memoryview(self._map)
        self.slots = {
            name: Slot(self._view[start:end]) for name, (start, end) in _layout()[0].items()
        }

    @classmethod
    def create(cls, path: Path) -> "LoopFile":
        """Return a new, empty file in place of any old one; only its owner can read it."""
        make_run(path.parent)
        file, fresh = begun(path, _layout()[1])
        os.pwrite(file, MAGIC, 0)
        os.replace(fresh, path)
        return cls(path, file)

    @classmethod
    def open(cls, path: Path) -> "LoopFile":
        """Return the file of a running loop. Raises SlotError."""
        try:
            file = os.open(path, os.O_RDWR)
        except FileNotFoundError:
            raise SlotError(
                str(path), "no such file", "the file of a running loop; start the loop first"
            ) from None
        size, magic = os.fstat(file).st_size, os.pread(file, len(MAGIC), 0)
        if size != _layout()[1] or magic != MAGIC:
            os.close(file)
            expected = f"{_layout()[1]} bytes beginning {MAGIC!r}"
            raise SlotError(str(path), f"{size} bytes beginning {magic!r}", expected)
        return cls(path, file)

    @property
    def replaced(self) -> bool:
        """Whether another loop has replaced the file since; then open it again."""
        try:
            return self.path.stat().st_ino != self._identity
        except FileNotFoundError:
            return True

    def close(self) -> None:
        """Close the mapping."""
        for slot in self.slots.values():
            slot._view.release()
        self._view.release()
        self._map.close()


def _layout() -> tuple[dict[str, tuple[int, int]], int]:
    """Return start and end of each slot, and the size of the file. Slots start on cache lines."""
    places, at = {}, 64
    for name, size in SIZES.items():
        end = at + _HEAD.size + size
        places[name] = (at, end)
        at = -(-end // 64) * 64
    return places, at


class Counter:
    """A counter that only grows, 8 bytes in a slot."""

    def __init__(self, slot: Slot) -> None:
        self._slot = slot

    def read(self) -> int:
        """Return the count."""
        found = self._slot.read()
        return int(_COUNT.unpack(found[1])[0]) if found else 0

    def add(self) -> None:
        """Add one (only one writer per slot)."""
        self._slot.write(_COUNT.pack(self.read() + 1))


def packed(struct_: msgspec.Struct) -> bytes:
    """Return the bytes of a record."""
    return _ENCODE(struct_)


_ENCODE = msgspec.msgpack.Encoder().encode

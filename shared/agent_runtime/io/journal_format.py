"""The bytes of a journal file: a first line with the format's version, then framed records. Knows no file.

A frame is <mark 4 bytes><length u32><crc32 u32><record>, little endian. The mark is searched for only where a frame is
damaged, to see whether whole records follow: a tail that a kill tore off has none behind it.
"""

import struct
import zlib
from collections.abc import Iterator

import msgspec

VERSION = 3
NAME = b"roco-journal-"
MAGIC = NAME + b"%d\n" % VERSION
MARK = b"\xc1REC"  # 0xc1 begins no MessagePack value, so a record seldom holds it
HEAD = struct.Struct("<4sII")
LARGEST_RECORD = 256 * 1024 * 1024  # estimate: a length beyond it is garbage


class Scan(msgspec.Struct, frozen=True):
    """Contents of a file. `good`: records, `last`: the newest of them, `end`: the offset behind it.

    `damaged`: offsets at which bytes begin that are not a record and have whole records behind them.
    """

    good: int
    last: bytes | None
    end: int
    damaged: tuple[int, ...] = ()


def version(data: bytes) -> int | None:
    """Return the version in the first line; None where it is not that of a journal, or is not whole."""
    line = data[: len(NAME) + 8].partition(b"\n")
    number = line[0].removeprefix(NAME)
    return int(number) if line[1] and line[0].startswith(NAME) and number.isdigit() else None


def frame(record: bytes) -> bytes:
    """Return a record as it stands in the file."""
    return HEAD.pack(MARK, len(record), zlib.crc32(record)) + record


def records(data: bytes) -> Iterator[bytes]:
    """Return all whole records up to the first that is not, oldest first; none of a file of another version."""
    at = len(MAGIC) if data.startswith(MAGIC) else len(data)
    while (record := _record(data, at)) is not None:
        yield record
        at += HEAD.size + len(record)


def last_record(data: bytes) -> bytes | None:
    """Return the last whole record before anything damaged; None where there is none."""
    last = None
    for last in records(data):  # noqa: B007 - the last one is meant
        pass
    return last


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
    """Return the whole record whose frame begins at an offset, None where none does."""
    if at + HEAD.size > len(data):
        return None
    mark, length, crc = HEAD.unpack_from(data, at)
    if mark != MARK or length > LARGEST_RECORD or at + HEAD.size + length > len(data):
        return None
    body = data[at + HEAD.size : at + HEAD.size + length]
    return body if zlib.crc32(body) == crc else None

"""Analysis of the traffic.mcap left by a recorder that died, and the place where the next one goes on in it.

Of each message only the head is looked at, nothing is decoded or written again: while a recorder begins, nobody hears
the fleet, and its recording may have gigabytes. Chunks, as in one that was closed, are unpacked.
"""

import mmap
import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Message, MessageIndex, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from fipa_codec.communicate import UNREADABLE
from operate.recording.stored import RECORD_LIMIT, TORN, inside

LOOK_AFTER = 20_000
"""Records between two calls of `alive`: some 10 ms."""
_HEAD = struct.Struct("<BQ")  # kind of record, bytes behind the head
_MESSAGE = struct.Struct("<HIQQ")  # channel, number, when it was heard, when it was said [ns]
_READ: dict[int, Callable[[ReadDataStream], Any]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
    Opcode.MESSAGE_INDEX: MessageIndex.read,
}
"""Beside messages and chunks, the records that a recorder writes before the end of the data."""


class Left(msgspec.Struct, frozen=True):
    """The whole records of a recording: where they end, and the schemas and channels among them, in their order.

    `number`, `heard_ns`: of the last message; 0: there is none.
    """

    end: int
    said: tuple[Schema | Channel, ...]
    number: int = 0
    heard_ns: int = 0


def left(path: Path, alive: Callable[[], None] = lambda: None) -> Left | None:
    """Return what a recording has; None: there is none. `alive` is called again and again meanwhile."""
    if not path.exists() or not path.stat().st_size:
        return None
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        begins = len(MCAP0_MAGIC)
        found = _scanned(data, begins, alive) if data[:begins] == MCAP0_MAGIC else None
        return found if found is not None and found.end > begins else None


def _scanned(data: mmap.mmap, at: int, alive: Callable[[], None]) -> Left:
    size, count = len(data), 0
    before = last = b""  # heads of the last two messages
    begun = ends = 0  # where the content of the last one begins and ends, if it is in no chunk
    said: list[Schema | Channel] = []
    while at + _HEAD.size <= size:
        kind, length = _HEAD.unpack_from(data, at)
        begins, behind = at + _HEAD.size, at + _HEAD.size + length
        if behind > size or length > RECORD_LIMIT:
            break
        if kind == Opcode.MESSAGE and length >= _MESSAGE.size:
            before, last = last, data[begins : begins + _MESSAGE.size]
            begun, ends = begins, behind
        elif kind == Opcode.CHUNK:
            alive()
            found = _unpacked(data[begins:behind], said)
            if found is None:
                break
            before, last = last, found or last
        elif not _understood(kind, data[begins:behind], said):
            break
        at, count = behind, count + 1
        if count % LOOK_AFTER == 0:
            alive()
    if last and ends == at and not _decodes(data[begun + _MESSAGE.size : ends]):
        at, last = begun - _HEAD.size, before
    if not last:
        return Left(at, tuple(said))
    _, number, heard_ns, _ = _MESSAGE.unpack(last)
    return Left(at, tuple(said), number, heard_ns)


def _unpacked(data: bytes, said: list[Schema | Channel]) -> bytes | None:
    """Return the head of the last message in a chunk, b"" without one; None: it is damaged, or not as we write it."""
    last = b""
    try:
        for one in inside(Chunk.read(ReadDataStream(BytesIO(data)))):
            if isinstance(one, Message):
                last = _MESSAGE.pack(one.channel_id, one.sequence, one.log_time, one.publish_time)
            elif isinstance(one, Schema | Channel) and not _numbered(one, said):
                return None
    except TORN:
        return None
    return last


def _understood(kind: int, data: bytes, said: list[Schema | Channel]) -> bool:
    """Whether a record other than a message is as a recorder writes it; a schema or channel is added to `said`."""
    again = RecordBuilder()
    try:
        one = _READ[kind](ReadDataStream(BytesIO(data)))
        one.write(again)
    except (KeyError, McapError, struct.error, ValueError):
        return False
    if again.end()[_HEAD.size :] != data:  # a length inside is wrong, and readers would stop here
        return False
    return _numbered(one, said) if isinstance(one, Schema | Channel) else True


def _numbered(one: Schema | Channel, said: list[Schema | Channel]) -> bool:
    """Whether a schema or channel has the next number; then it is added to `said`."""
    numbered: bool = one.id == 1 + sum(isinstance(other, type(one)) for other in said)
    said += [one] * numbered
    return numbered


def _decodes(data: bytes) -> bool:
    """Whether the last message is whole inside; what follows a torn one is not a record."""
    try:
        msgspec.json.decode(data)
    except UNREADABLE:
        return False
    return True

"""MCAP files as such: their records in the order in which they stand there, within bounds, since a
file may be somebody else's; and the index, messages gathered in chunks, by which tools find them.
Rerun reads no others.

A recorder writes without chunks, so that a kill costs little. Who closes or repairs the file writes
it again in its place, by rename: a reader sees the old one or the new one. Must not know: what a
message says.
"""

import fcntl
import io
import os
import struct
from collections.abc import Container, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import lz4.frame
import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import (
    EndOfFile,
    InvalidMagic,
    McapError,
    RecordLengthLimitExceeded,
    UnsupportedCompressionError,
)
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    Footer,
    Header,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.writer import MCAP0_MAGIC, Writer

from agent_runtime.io.journal import free_name
from agent_runtime.io.run_files import replaced
from fipa_codec.communicate import UNREADABLE
from operate.structs import NothingToRead

# --- Records of a file ----------------------------------------------------------------------------


RECORD_LIMIT = 64 * 1024 * 1024
"""A longer record is damage: the longest communicate has 4 MiB, a third more in base64, plus its
fields.
"""
CHUNK_LIMIT = 16 * 1024 * 1024
"""Bytes of an unpacked chunk: tools gather 1 to 4 MiB in one, and the record that ends it may have
6.
"""
TORN = (McapError, struct.error, ValueError, MemoryError)
"""A damaged or unfinished file shows as any of them."""
NOTE = "recorded"
"""Metadata of a recording: what its recorder was."""
CONTENTS = "contents"
"""In that note: the version of what messages contain."""
GIVE = "give a run folder, or a recording (.mcap) of `roco record` or of a run"


class NoRecordingError(NothingToRead):
    """There is nothing to read at `path`, for this reason; `remedy`: what to do."""

    def __init__(self, path: Path, why: str, remedy: str = GIVE) -> None:
        super().__init__(f"{path} {why}; {remedy}")


# kind, bytes behind (MCAP specification, Records)
RECORD = struct.Struct("<BQ")
# channel, number, log and publish time [ns]; behind them its data (MCAP specification, Message)
MESSAGE = struct.Struct("<HIQQ")
READ: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
}
"""Records that are read; indexes and statistics only repeat what is in the others."""


def stored(file: IO[bytes], unwanted: Container[int] = ()) -> Iterator[McapRecord]:
    """The records of an MCAP file as they stand in it, those in chunks, too; of several one after
    the other. Messages of `unwanted` channels are left out; who reads may add to them meanwhile.

    Files are joined by `cat` as logs are. Raise one of TORN. The library's own reader takes ten
    times as long for a message.
    """
    size = os.fstat(file.fileno()).st_size
    while True:
        _read_magic(file)
        footer = False
        while not footer:
            opcode, length = RECORD.unpack(_exactly(file, RECORD.size))
            if length > RECORD_LIMIT:
                raise RecordLengthLimitExceeded(opcode, length, RECORD_LIMIT)
            footer = opcode == Opcode.FOOTER
            data = _exactly(file, length)
            if opcode == Opcode.CHUNK:
                yield from inside(Chunk.read(ReadDataStream(io.BytesIO(data))), unwanted)
            else:
                yield from _of(opcode, data, unwanted)
        _read_magic(file)
        if file.tell() >= size:
            return


def _read_magic(file: IO[bytes]) -> None:
    if (found := file.read(len(MCAP0_MAGIC))) != MCAP0_MAGIC:
        raise InvalidMagic(found)


def _exactly(file: IO[bytes], length: int) -> bytes:
    if len(data := file.read(length)) < length:
        raise EndOfFile
    return data


def inside(chunk: Chunk, unwanted: Container[int] = ()) -> list[McapRecord]:
    """Return the records in a chunk. Raise one of TORN."""
    data, at, found = memoryview(_unpacked(chunk)), 0, list[McapRecord]()
    while at < len(data):
        opcode, length = RECORD.unpack_from(data, at)
        begin, at = at + RECORD.size, at + RECORD.size + length
        if at > len(data):
            raise EndOfFile
        found += _of(opcode, data[begin:at], unwanted)
    return found


def _of(opcode: int, data: bytes | memoryview, unwanted: Container[int]) -> tuple[McapRecord, ...]:
    """The record of this kind, if it is one that is read."""
    if opcode == Opcode.MESSAGE:
        channel, number, logged, published = MESSAGE.unpack_from(data)
        if channel in unwanted:
            return ()
        return (Message(channel, logged, bytes(data[MESSAGE.size :]), published, number),)
    return (READ[opcode].read(ReadDataStream(io.BytesIO(data))),) if opcode in READ else ()


def _unpacked(chunk: Chunk) -> bytes:
    """What is in a chunk. No more than CHUNK_LIMIT is ever unpacked: a few bytes can stand for
    gigabytes.
    """
    data: bytes = chunk.data
    most = CHUNK_LIMIT + 1
    try:
        if chunk.compression == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most)
        elif chunk.compression == "zstd":
            unpacked = zstandard.ZstdDecompressor(max_window_size=CHUNK_LIMIT)
            data = unpacked.stream_reader(data).read(most)
        elif chunk.compression:
            raise UnsupportedCompressionError(chunk.compression)
    except (RuntimeError, zstandard.ZstdError) as error:  # lz4 has no error of its own
        raise McapError(str(error)) from error
    if len(data) > CHUNK_LIMIT:
        raise RecordLengthLimitExceeded(Opcode.CHUNK, len(data), CHUNK_LIMIT)
    return data


# --- The index ------------------------------------------------------------------------------------


# kind of record, bytes behind, checksum (MCAP specification, Data End)
DATA_END = struct.Struct("<BQI")
# kind, bytes behind, begin of the summary, of its offsets, checksum (Footer)
FOOTER = struct.Struct("<BQQQI")
REPAIRED = "repaired"
"""Name of the metadata in a recording that was not closed in order."""


class Written(msgspec.Struct, frozen=True):
    """A recording with its index: how many messages were written again, 0 where it had one;
    `whole`: it was closed in order. `lost`: bytes at its end that could not be read; `kept`: the
    file as it was, "" where none were lost.
    """

    file: str
    messages: int = 0
    whole: bool = True
    lost: int = 0
    kept: str = ""


def repaired(path: Path) -> Written:
    """Write a recording again with an index, if it has none. Raise OSError; NoRecordingError where
    nothing can be.
    """
    if not path.is_file():
        raise NoRecordingError(path, "is not there")
    try:
        done, _ = _written(path)
    except BlockingIOError as error:
        closes = "`roco down`, or Ctrl-C at `roco record`, closes it"
        raise NoRecordingError(path, "is being recorded", closes) from error
    if done is None:
        raise NoRecordingError(path, "holds no record that can be read")
    return done


def write(path: Path) -> int:
    """Write a recording again with an index, if it has none; return where its messages end [bytes],
    0 where there are none. Raise OSError, and BlockingIOError while a recorder writes it.
    """
    return _written(path)[1]


def _written(path: Path) -> tuple[Written | None, int]:
    """Return what was done, None where no message can be read, and where the messages end then."""
    with path.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if _is_indexed(file):
            return Written(str(path)), _end(path)
        if not _has_message(file):
            return None, 0
        with replaced(path, 0o600) as new:
            copy = _Copy(new)
            copy.take(file)
            lost = 0 if copy.whole else path.stat().st_size - copy.end
            done = Written(
                str(path), copy.messages, copy.whole, lost, str(free_name(path)) if lost else ""
            )
            copy.finish(done)
            if done.kept:
                os.link(path, done.kept)
    return done, _end(path)


def _has_message(file: IO[bytes]) -> bool:
    """Whether one can be read."""
    file.seek(0)
    with suppress(*TORN):
        return any(isinstance(one, Message) and _is_whole(one) for one in stored(file))
    return False


def _end(path: Path) -> int:
    """Return where the messages of a recording with a summary end: at the record that says so."""
    with path.open("rb") as file:
        file.seek(-FOOTER.size - len(MCAP0_MAGIC), os.SEEK_END)
        _, _, summary, *_ = FOOTER.unpack(file.read(FOOTER.size))
    return int(summary) - DATA_END.size


def _is_indexed(file: IO[bytes]) -> bool:
    """Whether a file was closed in order and has all of its messages in chunks that its index
    names.
    """
    try:
        summary = SeekingReader(file, record_size_limit=RECORD_LIMIT).get_summary()
    except (*TORN, OSError):
        return False
    if summary is None or summary.statistics is None:
        return False
    return bool(summary.statistics.chunk_count == len(summary.chunk_indexes) > 0)


def _is_whole(message: Message) -> bool:
    """Whether a message is whole inside; behind a torn one is no record."""
    try:
        msgspec.json.decode(message.data)
    except UNREADABLE:
        return False
    return True


class _Copy:
    """A file with the records of another one: their order stays, schemas and channels are numbered
    anew.
    """

    def __init__(self, new: IO[bytes]) -> None:
        self._writer = Writer(new)
        self._begun = False
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self.messages, self.whole, self.end = 0, False, 0
        """`end`: where the last message that can be read ends [bytes]."""

    def take(self, file: IO[bytes]) -> None:
        """Copy what can be read."""
        file.seek(0)
        with suppress(*TORN):
            for one in stored(file):
                if isinstance(one, Message) and not _is_whole(one):
                    return
                self._add(one)
                self.end = file.tell()

    def finish(self, done: Written) -> None:
        """Note what was lost, and write the index."""
        if not done.whole:
            self._writer.add_metadata(
                REPAIRED, {"messages": str(done.messages), "lost_bytes": str(done.lost)}
            )
        self._writer.finish()

    def _add(self, one: McapRecord) -> None:
        if not self._begun:
            self._begun = True
            self._writer.start(*((one.profile, one.library) if isinstance(one, Header) else ()))
        match one:
            case Schema() if one.id not in self._schemas:  # the summary at the end repeats them
                self._schemas[one.id] = self._writer.register_schema(
                    one.name, one.encoding, one.data
                )
            case Channel() if one.id not in self._channels:
                schema = self._schemas.get(one.schema_id, 0)
                self._channels[one.id] = self._writer.register_channel(
                    one.topic, one.message_encoding, schema, one.metadata
                )
            case Message() if one.channel_id in self._channels:
                channel, times = self._channels[one.channel_id], (one.publish_time, one.sequence)
                self._writer.add_message(channel, one.log_time, one.data, *times)
                self.messages += 1
            case Metadata():
                self._writer.add_metadata(one.name, one.metadata)
            case Attachment():
                self._writer.add_attachment(
                    one.create_time, one.log_time, one.name, one.media_type, one.data
                )
            case Footer():
                self.whole = True

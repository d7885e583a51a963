"""Records of an MCAP file in the order in which they stand in it, within bounds: the file may be
somebody else's.

Must not know: what a message says.
"""

import dataclasses
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import lz4.frame
import zstandard
from mcap.exceptions import McapError, RecordLengthLimitExceeded, UnsupportedCompressionError
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from operate.structs import NothingToRead

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


def stored(file: IO[bytes]) -> Iterator[McapRecord]:
    """The records of an MCAP file as they stand in it, those in chunks, too; of several one after
    the other.

    Files are joined by `cat` as logs are. Raise one of TORN.
    """
    size = os.fstat(file.fileno()).st_size
    while True:
        for found in StreamReader(file, emit_chunks=True, record_size_limit=RECORD_LIMIT).records:
            if isinstance(found, Chunk):
                yield from inside(found)
            else:
                yield found
        if file.tell() >= size:
            return


def inside(chunk: Chunk) -> list[McapRecord]:
    """Return the records in a chunk. Raise one of TORN."""
    found: list[McapRecord] = breakup_chunk(
        dataclasses.replace(chunk, compression="", data=_unpacked(chunk))
    )
    return found


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

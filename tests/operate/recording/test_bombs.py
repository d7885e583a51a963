"""Few bytes that unpack to gigabytes: a recording of somebody else costs no more than any file that cannot be read."""

import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from operate.recording import mcap_file
from operate.recording.mcap_file import Reading
from operate.recording.records import Token
from operate.recording.stored import CHUNK_LIMIT

GIGABYTE = 1 << 30
PIECE = bytes(1 << 20)
MOST_KB = 200_000
"""Of memory for a reader of such a file, most of it its libraries; unpacked, a bomb has a million."""


def by_lz4(size: int) -> bytes:
    """So many zeros, which its head does not tell."""
    packed = lz4.frame.LZ4FrameCompressor()
    return packed.begin() + b"".join(packed.compress(PIECE) for _ in range(size // len(PIECE))) + packed.flush()


def by_zstd(size: int) -> bytes:
    """So many zeros, in a stream that does not tell."""
    packed = zstandard.ZstdCompressor(level=1).compressobj()
    return b"".join(packed.compress(PIECE) for _ in range(size // len(PIECE))) + packed.flush()


def by_zstd_telling(size: int) -> bytes:
    """So many zeros, as the head of the frame tells: a reader may make room for them at once."""
    packed = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    return b"".join(packed.compress(PIECE) for _ in range(size // len(PIECE))) + packed.flush()


BOMBS: dict[str, Callable[[], tuple[str, bytes]]] = {
    "lz4": lambda: ("lz4", by_lz4(GIGABYTE)),
    "zstd": lambda: ("zstd", by_zstd(GIGABYTE)),
    "zstd that tells": lambda: ("zstd", by_zstd_telling(GIGABYTE)),
    "no lz4": lambda: ("lz4", b"no frame of lz4"),
    "no zstd": lambda: ("zstd", b"no frame of zstd"),
    "another": lambda: ("brotli", b"?"),
}


def recording(path: Path, compression: str, packed: bytes, says: int) -> Path:
    """A file that begins with such a chunk, which says so many bytes of itself."""
    head = struct.pack("<QQQII", 0, 0, says, 0, len(compression)) + compression.encode()
    chunk = head + struct.pack("<Q", len(packed)) + packed
    path.write_bytes(MCAP0_MAGIC + struct.pack("<BQ", Opcode.CHUNK, len(chunk)) + chunk)
    return path


MEASURED = """
import atexit, re, runpy, sys
def tell():
    (peak,) = re.findall(r"VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())
    print("most memory:", peak, file=sys.stderr)
atexit.register(tell)
runpy.run_module("operate.recording", run_name="__main__", alter_sys=True)
"""
"""The peak that wait4 and getrusage tell is at least that of the process that started it, a worker of pytest."""


def asked(*words: object) -> tuple[int, str, int]:
    """Exit code of a process of the recorder, its last words, and the most memory that it had [kB]."""
    command = [sys.executable, "-P", "-c", MEASURED, *map(str, words)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said, _, memory = done.stderr.rpartition("most memory: ")
    return done.returncode, said, int(memory)


@pytest.mark.process
@pytest.mark.parametrize("says", [1000, 1 << 60])
@pytest.mark.parametrize("bomb", BOMBS)
def test_a_bomb_is_a_file_that_cannot_be_read(tmp_path: Path, bomb: str, says: int) -> None:
    """Exit code 2 and the usual sentence, with the memory that such a process has anyway."""
    file = recording(tmp_path / "traffic.mcap", *BOMBS[bomb](), says)
    code, said, memory = asked("judge", file)
    assert code == 2, said
    assert f"{file} holds no record that can be read; give a run folder" in said
    assert memory < MOST_KB


@pytest.mark.process
@pytest.mark.parametrize("verb", ["said", "info"])
def test_every_reader_has_the_bound(tmp_path: Path, verb: str) -> None:
    """Those that do not judge, too."""
    file = recording(tmp_path / "traffic.mcap", *BOMBS["lz4"](), 1000)
    code, said, memory = asked(verb, file)
    assert code == 2, said
    assert "that can be read; give a run folder, or a recording" in said
    assert memory < MOST_KB


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_a_recording_that_another_tool_packed_is_read(tmp_path: Path, compression: CompressionType) -> None:
    """With chunks as large as they may be, and in their order."""
    file, many = tmp_path / "traffic.mcap", 500
    records = [Token("co", number, True, float(number)) for number in range(many)]
    with file.open("wb") as opened:
        writer = Writer(opened, compression=compression, chunk_size=CHUNK_LIMIT // 4)
        writer.start()
        channel = writer.register_channel("tokens", "json", 0)
        for record in records:
            data = mcap_file._encoder.encode(record)
            writer.add_message(channel, 0, data + b" " * (CHUNK_LIMIT // 100), 0)
        writer.finish()
    reading = Reading(file)
    assert list(reading) == records
    assert reading.whole

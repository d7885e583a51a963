"""Files that are no recording, or several, or out of order: every verb says so, or reads what is
there.
"""

import json
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from planting import POUR
from typer.testing import CliRunner

from companion.tools.system import SYSTEM
from companion.tools.verbs.ask import known
from console.__main__ import app
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.index import CHUNK_LIMIT
from operate.recording.mcap_file import Reading
from operate.recording.records import Spoken, Token
from operate.recording.run import opened

VERBS = (
    ("export", "--out", "tables"),
    ("report",),
    ("ask", "SELECT ?s WHERE { ?s ?p ?o }", "--run"),
    ("traffic", "judge"),
    ("record", "info"),
    ("replay",),
)


def planted(folder: Path, content: bytes) -> Path:
    """A file of that content."""
    path = folder / "some.mcap"
    path.write_bytes(content)
    return path


def in_a_run(folder: Path, content: bytes) -> Path:
    """A run folder with it."""
    planted(folder, content).rename(folder / TRAFFIC_FILE)
    return folder


@pytest.mark.parametrize("place", [planted, in_a_run])
def test_what_is_no_recording_is_said_by_every_verb(
    place: Callable[[Path, bytes], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Text, or nothing at all: exit code 2, the file, and what to give; nothing is written."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path)
    wrong = []
    for content in (b"hello\n", b""):
        file = place(tmp_path / "here", content)
        for words in VERBS:
            done = CliRunner().invoke(app, [*words, str(file)])
            told = "here/" in done.stderr and "give " in done.stderr
            if (done.exit_code, done.stdout, told) != (2, "", True):
                wrong.append((words, content, done.exit_code, done.output, done.exception))
    assert wrong == []
    assert [one.name for one in tmp_path.iterdir()] == ["here"]


def test_recordings_joined_are_read_one_after_the_other(tmp_path: Path) -> None:
    """As logs are joined by cat; twice the same file has twice the records."""
    once = mcap_file.read(POUR, SYSTEM)
    twice = mcap_file.read(planted(tmp_path, 2 * POUR.read_bytes()), SYSTEM)
    assert len(twice.records) == 2 * len(once.records) > 0
    assert twice.whole is once.whole is True
    assert not mcap_file.read(planted(tmp_path, 2 * POUR.read_bytes()[:-100]), SYSTEM).whole


def test_the_order_in_the_file_does_not_matter(tmp_path: Path) -> None:
    """Records in reverse order are the same recording, and km knew the same in the end."""
    reversed_file = mcap_file.Recording(tmp_path / "some.mcap")
    for record in reversed(mcap_file.read(POUR).records):
        reversed_file.add(record)
    reversed_file.finish()
    one, other = opened(POUR, SYSTEM), opened(tmp_path / "some.mcap", SYSTEM)
    said = lambda run: [(it.sender, it.id) for it in run.records if isinstance(it, Spoken)]  # noqa: E731
    assert said(one) == said(other)
    assert known(POUR).words == known(tmp_path / "some.mcap").words


# --- Few bytes that unpack to gigabytes -----------------------------------------------------------


GIGABYTE = 1 << 30
PIECE = bytes(1 << 20)
MOST_KB = 200_000
"""Of memory for a reader of such a file, most of it its libraries; unpacked, a bomb has a
million.
"""


def by_lz4(size: int) -> bytes:
    """So many zeros, which its head does not tell."""
    packed = lz4.frame.LZ4FrameCompressor()
    return bytes(packed.begin()) + zeros(packed, size)


def by_zstd(count: int, size: int = -1) -> bytes:
    """So many zeros, in a stream that does not tell; `size`: as the head of the frame tells, so
    that a reader may make room for them at once.
    """
    return zeros(zstandard.ZstdCompressor(level=1).compressobj(size=size), count)


def zeros(packed: Any, size: int) -> bytes:
    """So many, packed, to the end of it."""
    return b"".join(packed.compress(PIECE) for _ in range(size // len(PIECE))) + packed.flush()


BOMBS: dict[str, Callable[[], tuple[str, bytes]]] = {
    "lz4": lambda: ("lz4", by_lz4(GIGABYTE)),
    "zstd": lambda: ("zstd", by_zstd(GIGABYTE)),
    "zstd that tells": lambda: ("zstd", by_zstd(GIGABYTE, size=GIGABYTE)),
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
import json, re, sys
from typer.testing import CliRunner
from console.__main__ import app
for words in json.loads(sys.argv[1]):
    done = CliRunner().invoke(app, words)
    (peak,) = re.findall(r"VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())
    print(json.dumps([words, done.exit_code, done.output, int(peak)]))
"""
"""The peak that wait4 and getrusage tell is at least that of the process that started it, a worker
of pytest.
"""


@pytest.mark.process
@pytest.mark.timeout(120)
def test_a_bomb_is_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    """Exit code 2 and the usual sentence, with the memory that such a process has anyway; by
    whatever verb.
    """
    calls = []
    for number, bomb in enumerate(BOMBS):
        for says in (1000, 1 << 60):
            file = recording(tmp_path / f"{number}-{says}.mcap", *BOMBS[bomb](), says)
            calls.append(["traffic", "judge", str(file)])
    calls += [["traffic", "echo", "--run", calls[0][-1]], ["record", "info", calls[0][-1]]]
    command = [sys.executable, "-P", "-c", MEASURED, json.dumps(calls)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert [words for words, *_ in told] == calls
    for words, code, output, peak in told:
        assert code == 2, words
        assert f"{words[-1]} holds no record that can be read; give a run folder" in output
        assert peak < MOST_KB, words


@pytest.mark.parametrize(
    "compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]
)
def test_a_recording_that_another_tool_packed_is_read(
    tmp_path: Path, compression: CompressionType
) -> None:
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

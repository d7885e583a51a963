"""Files that are no recording, or several, or out of order: every verb says so, or reads what is there."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from planting import POUR

from companion.tools.asking import known
from companion.tools.system import SYSTEM
from operate.recording import mcap_file, reading
from operate.recording.records import Spoken


def planted(folder: Path, content: bytes) -> Path:
    """A file of that content."""
    path = folder / "some.mcap"
    path.write_bytes(content)
    return path


def in_a_run(folder: Path, content: bytes) -> Path:
    """A run folder with it."""
    planted(folder, content).rename(folder / mcap_file.FILE)
    return folder


@pytest.mark.process
@pytest.mark.timeout(120)
@pytest.mark.parametrize(
    "words",
    [
        ["export", "--out", "tables"],
        ["report"],
        ["ask", "SELECT ?s WHERE { ?s ?p ?o }", "--run"],
        ["traffic", "judge"],
        ["record", "info"],
        ["replay"],
    ],
    ids=lambda words: words[0],
)
@pytest.mark.parametrize("place", [planted, in_a_run])
def test_what_is_no_recording_is_said_by_every_verb(
    words: list[str], place: Callable[[Path, bytes], Path], tmp_path: Path
) -> None:
    """Text, or nothing at all: exit code 2, the file, and what to give; nothing is written."""
    (tmp_path / "here").mkdir()
    for content in (b"hello\n", b""):
        file = place(tmp_path / "here", content)
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_RUN")}
        done = subprocess.run(
            [sys.executable, "-P", "-m", "operate.cli", *words, str(file)],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=60,
        )  # fmt: skip
        assert (done.returncode, done.stdout) == (2, ""), done
        assert "here/" in done.stderr
        assert "give " in done.stderr
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
    one, other = reading.of(POUR, SYSTEM), reading.of(tmp_path / "some.mcap", SYSTEM)
    said = [[(it.sender, it.id) for it in found.records if isinstance(it, Spoken)] for found in (one, other)]
    assert said[0] == said[1]
    assert known(POUR).words == known(tmp_path / "some.mcap").words

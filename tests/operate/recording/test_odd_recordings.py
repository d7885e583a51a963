"""Files that are no recording, or several, or out of order: every verb says so, or reads what is
there.
"""

from collections.abc import Callable
from pathlib import Path

import pytest
from planting import POUR
from typer.testing import CliRunner

from companion.tools.system import SYSTEM
from companion.tools.verbs.ask import known
from console.__main__ import app
from operate.recording import mcap_file
from operate.recording.records import Spoken
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
    planted(folder, content).rename(folder / mcap_file.FILE)
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

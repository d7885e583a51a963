"""Contents of a recording by `roco record info`: counted again by hand, also of one that a kill
tore.
"""

from collections import Counter
from pathlib import Path

import msgspec
import pytest
from synthetic import Run
from typer.testing import CliRunner

from companion.tools.system import SYSTEM
from console.__main__ import app
from operate.recording import mcap_file
from operate.recording.contents import Contents, contents, digest, versions_now
from operate.recording.index import CONTENTS, NOTE, NoRecordingError
from operate.recording.mcap_file import Recording, topic
from operate.recording.records import Record, understood


@pytest.fixture(scope="module")
def records(pouring: Run) -> list[Record]:
    """The first records of a run, of several topics."""
    return [understood(sample, SYSTEM) for sample in pouring.samples[:2000]]


@pytest.fixture
def file(tmp_path: Path, records: list[Record]) -> Path:
    """A recording as a recorder writes it, closed in order."""
    recording = Recording(tmp_path / "traffic.mcap")
    recording.note(NOTE, versions_now(SYSTEM))
    recording.note("filter", {"channels": "C4"})
    for record in records:
        recording.add(record)
    recording.finish()
    return tmp_path / "traffic.mcap"


def test_each_topic_is_counted_once_with_its_times(file: Path, records: list[Record]) -> None:
    """The summary at the end of the file, which repeats the topics, adds none."""
    told = contents(file)
    assert {one.name: one.count for one in told.topics} == Counter(map(topic, records))
    for one in told.topics:
        heard = [record.received for record in records if topic(record) == one.name]
        assert (one.first, one.last) == pytest.approx((min(heard), max(heard)), abs=1e-3)
    assert told.whole
    assert told.bytes == file.stat().st_size


def test_the_keys_of_a_topic_add_up_to_it(file: Path, pouring: Run) -> None:
    """They are the keys on the router, behind the system's name."""
    told = contents(file)
    for one in told.topics:
        assert sum(key.count for key in one.keys.values()) == one.count, one.name
        assert sum(key.bytes for key in one.keys.values()) == one.bytes
    heard = {sample.key.split("/", 2)[2] for sample in pouring.samples[:2000] if not sample.token}
    keys = {key for one in told.topics for key in one.keys}
    assert heard == {key for key in keys if not key.startswith("_/alive")}


def test_versions_and_notes_are_told(file: Path) -> None:
    """Of the format, of its writer, of the recorder and of the design that it had."""
    told = contents(file)
    assert told.versions["format"] == mcap_file.PROFILE
    assert told.versions["library"].startswith("mcap-python/")
    assert told.versions["system"] == SYSTEM.design.file.system.name
    assert told.versions["design"] == digest(SYSTEM.design.text) != digest(SYSTEM.design.text + " ")
    assert told.notes == {"filter": {"channels": "C4"}}


def test_of_a_torn_recording_all_before_the_tear_is_told(file: Path, records: list[Record]) -> None:
    """And that it was not closed in order."""
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    told = contents(file)
    assert not told.whole
    assert 0 < sum(one.count for one in told.topics) < len(records)


@pytest.mark.process
def test_the_verb_tells_it(file: Path, records: list[Record]) -> None:
    """Both forms, and the keys where they are asked for."""

    def roco(*words: str) -> str:
        command = ["record", "info", str(file), *words]
        done = CliRunner().invoke(app, command, env={"COLUMNS": "200"})
        assert done.exit_code == 0, done.output
        return done.output

    said = roco()
    assert f"{len(records)} messages in" in said
    assert "filter: channels C4" in said
    assert "C6/" not in said
    assert "  C6/ta/km/" in roco("--keys")
    assert msgspec.json.decode(roco("--format", "json"), type=Contents) == contents(file)


@pytest.mark.parametrize(
    ("noted", "version"), [({"version": "0.0.9"}, "1"), ({CONTENTS: "99"}, "99")]
)
def test_messages_of_another_version_are_refused_with_the_reason(
    noted: dict[str, str], version: str, tmp_path: Path, records: list[Record]
) -> None:
    """Older ones did not note it. What is in the recording can be counted all the same."""
    recording = Recording(tmp_path / "traffic.mcap")
    recording.note(NOTE, noted)
    for record in records[:50]:
        recording.add(record)
    recording.finish()
    why = rf"messages of version {version}\b.*read it with the version that"
    with pytest.raises(NoRecordingError, match=why):
        mcap_file.read(tmp_path / "traffic.mcap", SYSTEM)
    assert sum(one.count for one in contents(tmp_path).topics) == 50
    assert len(mcap_file.read(tmp_path / "traffic.mcap").records) == 50

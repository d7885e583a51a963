"""A closed or repaired recording is read by other tools, which count what we count: by Rerun, and
by mcap's reader.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Footer, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import IndexType, Writer
from synthetic import Run
from typer.testing import CliRunner

from companion.tools.system import SYSTEM
from console.__main__ import app
from operate.file_names import TRAFFIC_FILE
from operate.recording.contents import contents
from operate.recording.index import stored
from operate.recording.mcap_file import Recording, read, topic
from operate.recording.recorder import Recorder
from operate.recording.records import Record, understood

POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7" / "traffic.mcap"
RERUN = (sys.executable, "-m", "rerun")
DEADLINE_S = 60.0
KINDS = (Channel, Footer, Header, Message, Metadata, Schema)


@pytest.fixture(scope="module")
def records(pouring: Run) -> list[Record]:
    """The first records of a run, of several topics."""
    return [understood(sample, SYSTEM) for sample in pouring.samples[:500]]


def by_rerun(path: Path) -> int:
    """Return the number of messages that Rerun reads: rows of a time."""
    rrd = path.with_suffix(".rrd")
    subprocess.run(
        [*RERUN, "mcap", "convert", path, "-o", rrd],
        check=True,
        capture_output=True,
        timeout=DEADLINE_S,
    )
    done = subprocess.run(
        [*RERUN, "rrd", "stats", rrd],
        check=True,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
    )
    rows, static = (
        int(re.sub(r"\D", "", re.findall(rf"^{name} = (.+)$", done.stdout, re.MULTILINE)[0]))
        for name in ("num_rows", "num_static")
    )
    return rows - static


def by_mcap(path: Path) -> int:
    """Return the number of messages that mcap's reader finds by the index."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.chunk_indexes
        found = sum(1 for _ in reader.iter_messages())
        assert found == summary.statistics.message_count
        return found


def roco(*words: str, code: int = 0) -> str:
    """Return the output of `roco record repair`, whose exit code must be `code`."""
    done = CliRunner().invoke(app, ["record", "repair", *words], env={"COLUMNS": "200"})
    assert done.exit_code == code, done.output
    return done.output


@pytest.mark.process
def test_other_tools_count_what_was_recorded(pouring: Run, tmp_path: Path) -> None:
    """This holds for a recorder that ends in order, also for one that went on in the file of
    another.
    """
    path = tmp_path / TRAFFIC_FILE
    for samples in (pouring.samples[:300], pouring.samples[300:400]):
        recorder = Recorder(tmp_path, SYSTEM)
        for sample in samples:
            recorder.take(sample)
        recorder.finish()
        assert read(path).whole
        assert by_mcap(path) == len(read(path).records) >= len(samples)
    assert by_rerun(path) == len(read(path).records)
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    "behind", [b"", b"\x05 a record that a kill cut off"], ids=["whole", "torn"]
)
def test_a_recording_that_was_not_closed_is_repaired(
    behind: bytes, records: list[Record], tmp_path: Path
) -> None:
    """Nothing that could be read is lost; it says that it was repaired, and what was torn off is
    kept beside.
    """
    path, other = tmp_path / "a" / TRAFFIC_FILE, tmp_path / TRAFFIC_FILE
    recording = Recording(path)
    for record in records:
        recording.add(record)
    recording.flush()
    other.write_bytes(path.read_bytes() + behind)
    before, torn = read(other), other.read_bytes()
    assert f"{len(records)} messages, now with an index" in roco(str(tmp_path))
    after = read(other)
    assert after.records == before.records
    assert not after.whole, "what came after the kill is still not in it"
    assert not contents(other).whole
    assert by_mcap(other) == len(records)
    kept = [one.read_bytes() for one in tmp_path.glob("*.damaged")]
    assert kept == ([torn] if behind else [])
    assert "nothing to repair" in roco(str(other))
    recording.finish()


def older(path: Path) -> None:
    """Write the recorded pour as the first versions did."""
    writer = Writer(
        str(path), use_chunking=False, index_types=IndexType.NONE, repeat_channels=False,
        repeat_schemas=False,
        use_statistics=False, use_summary_offsets=False,
    )  # fmt: skip
    writer.start(profile="robot-companion")
    with POUR.open("rb") as file:
        for one in stored(file):
            match one:
                case Schema():
                    writer.register_schema(one.name, one.encoding, one.data)
                case Channel():
                    writer.register_channel(one.topic, one.message_encoding, one.schema_id)
                case Message():
                    writer.add_message(
                        one.channel_id, one.log_time, one.data, one.publish_time, one.sequence
                    )
                case Footer():
                    break
    writer.finish()


@pytest.mark.parametrize("topics", [{"communicates/C4", "tokens"}, {"house/state"}, set[str]()])
def test_topics_that_are_wanted_are_read_alone(topics: set[str], tmp_path: Path) -> None:
    """In their order, also of files that were joined, whose channels have other numbers."""
    other = Recording(tmp_path / "other.mcap")
    for record in reversed(read(POUR, SYSTEM).records):
        other.add(record)
    other.finish()
    both = tmp_path / "both.mcap"
    both.write_bytes(POUR.read_bytes() + (tmp_path / "other.mcap").read_bytes())
    every, some = (read(both, SYSTEM, wanted) for wanted in (lambda _: True, topics.__contains__))
    assert some.records == tuple(one for one in every.records if topic(one) in topics)
    assert some.whole is every.whole is True


def test_records_are_read_as_the_library_reads_them(tmp_path: Path) -> None:
    """In chunks and without; of what only repeats others nothing is read."""
    older(tmp_path / "older.mcap")
    for path in (POUR, tmp_path / "older.mcap"):
        with path.open("rb") as ours, path.open("rb") as theirs:
            found = [one for one in StreamReader(theirs).records if isinstance(one, KINDS)]
            assert list(stored(ours)) == found


@pytest.mark.process
def test_a_recording_of_an_older_version_is_repaired(tmp_path: Path) -> None:
    """It was closed in order, without chunks: Rerun read nothing from it, and said nothing."""
    path = tmp_path / TRAFFIC_FILE
    older(path)
    before = read(path)
    assert by_rerun(path) == 0
    roco(str(path))
    assert read(path) == before
    assert by_rerun(path) == by_mcap(path) == len(before.records)


def test_a_recording_that_goes_on_is_left_alone(records: list[Record], tmp_path: Path) -> None:
    """Else what its recorder hears from then on would go to a file that has no name any more."""
    path = tmp_path / TRAFFIC_FILE
    recording = Recording(path)
    recording.add(records[0])
    recording.flush()
    before = path.read_bytes()
    assert "is being recorded; `roco down`" in roco(str(path), code=2)
    assert path.read_bytes() == before
    recording.finish()
    assert "nothing to repair" in roco(str(path))


def test_what_is_no_recording_is_left_alone(tmp_path: Path) -> None:
    """Exit code 2, and the file stays as it is."""
    for number, data in enumerate((b"", b"a text\n", POUR.read_bytes()[:100])):
        path = tmp_path / f"{number}.mcap"
        path.write_bytes(data)
        assert "holds no record that can be read" in roco(str(path), code=2)
        assert path.read_bytes() == data
    assert "is not there" in roco(str(tmp_path), code=2)


def test_where_there_is_no_room_for_the_index_the_recording_stays(
    records: list[Record], tmp_path: Path
) -> None:
    """It is whole, and says why it has no index."""
    path = tmp_path / TRAFFIC_FILE
    recording = Recording(path)
    for record in records:
        recording.add(record)
    (tmp_path / f".{path.name}.new").mkdir()
    assert f"{path} cannot be written" in recording.finish()
    found = read(path)
    assert (list(found.records), found.whole) == (records, True)

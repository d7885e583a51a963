"""A recorder goes on in the file that another one left, wherever that one was killed, without writing it again."""

from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from synthetic import Run

from companion.tools.system import SYSTEM
from operate.recording import last_recording, mcap_file
from operate.recording.contents import NOTE, contents, versions_now
from operate.recording.mcap_file import Recording, read
from operate.recording.recorder import Recorder, Recorders
from operate.recording.records import Record, Resumed, understood


@pytest.fixture(scope="module")
def records(pouring: Run) -> list[Record]:
    """The first records of a run, of several topics."""
    return [understood(sample, SYSTEM) for sample in pouring.samples[:200]]


@pytest.fixture(scope="module")
def written(records: list[Record], tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A recording of them that was not closed."""
    path = tmp_path_factory.mktemp("written") / mcap_file.FILE
    recording = Recording(path)
    recording.note(NOTE, versions_now(SYSTEM))
    for record in records:
        recording.add(record)
    recording.flush()
    data = path.read_bytes()
    recording.finish()
    return data


def gone_on(path: Path, records: list[Record]) -> list[Record]:
    """Record more in this file, and return what can be read then."""
    second = Recording(path)
    for record in records:
        second.add(record)
    second.finish()
    found = read(path)
    assert found.whole
    return list(found.records)


@pytest.mark.parametrize("behind", [b"", bytes(4096), b"\xff" * 100], ids=["nothing", "zeros", "ones"])
def test_all_that_was_whole_stays_and_what_follows_is_read(
    behind: bytes, records: list[Record], written: bytes, tmp_path: Path
) -> None:
    """This holds wherever the first one was cut off, and whatever stands in the blocks behind."""
    cuts = [
        *range(150),
        *range(150, len(written), len(written) // 61),
        len(written),
    ]  # in head and notes, then anywhere
    for number, cut in enumerate(cuts):
        path = tmp_path / f"{number}.mcap"
        path.write_bytes(written[:cut] + behind)
        before, found = read(path).records, gone_on(path, records[195:])
        between = found[len(before) :]
        if before:
            assert isinstance(between[0], Resumed), cut
            assert between[0].since == pytest.approx(before[-1].received, abs=1e-6)
            del between[0]
        assert (tuple(found[: len(before)]), between) == (before, records[195:]), cut


@pytest.mark.parametrize("closed", [False, True])
def test_not_a_byte_of_it_is_written_again(closed: bool, records: list[Record], written: bytes, tmp_path: Path) -> None:
    """A recording of days would take minutes, in which nobody hears the fleet; the file stays the same one."""
    path = tmp_path / mcap_file.FILE
    path.write_bytes(written)
    if closed:
        gone_on(path, [])
    before, inode, count = path.read_bytes(), path.stat().st_ino, len(read(path).records)
    kept = before[: before.rindex(bytes([Opcode.DATA_END, 4, 0, 0]))] if closed else before
    second = Recording(path)
    for record in records[150:]:
        second.add(record)
    second.flush()
    assert path.read_bytes().startswith(kept)
    assert path.stat().st_ino == inode
    assert len(read(path).records) == count + 1 + 50, "what a kill would leave now"
    second.finish()


def test_one_that_was_closed_is_gone_on_with_twice(records: list[Record], written: bytes, tmp_path: Path) -> None:
    """Each end is cut off again; a topic is one channel throughout; other readers count the same."""
    path = tmp_path / mcap_file.FILE
    path.write_bytes(written)
    gone_on(path, records[150:])
    found = gone_on(path, records[:50])
    with path.open("rb") as file:
        reader = make_reader(file)
        topics = [channel.topic for channel in reader.get_summary().channels.values()]
        assert sum(1 for _ in reader.iter_messages()) == len(found) == 200 + 1 + 50 + 1 + 50
    assert len(topics) == len(set(topics))
    told = contents(path)
    assert (told.whole, told.versions["system"]) == (True, SYSTEM.design.file.system.name)


def test_who_looks_for_long_lives(written: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A supervisor would end it else, and the next one, and the next."""
    monkeypatch.setattr(last_recording, "LOOK_AFTER", 50)
    (tmp_path / mcap_file.FILE).write_bytes(written)
    calls = []
    recorders = Recorders({"roco": tmp_path}, SYSTEM, lambda *_, **__: None, lambda: calls.append(1))
    recorders.each(Recorder.finish)
    assert len(calls) == 200 // 50


def test_damage_inside_a_record_costs_that_one_alone(records: list[Record], written: bytes, tmp_path: Path) -> None:
    """Records behind the damage are intact."""
    path = tmp_path / mcap_file.FILE
    at = written.index(b'"received"', len(written) // 2)
    path.write_bytes(written[:at] + b"\xff" * 10 + written[at + 10 :])
    assert len(gone_on(path, records[195:])) == 199 + 1 + 5

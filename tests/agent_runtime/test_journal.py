"""The journal: whatever byte a kill stops it at, what is read back is the state before or the state
after.
"""

import errno
import os
from pathlib import Path

import pytest
from driven import Driven, quiet
from hypothesis import given
from hypothesis import strategies as st
from toy_agents import Want, wirings

from agent_runtime.core.errors import JournalError
from agent_runtime.core.events import Local, PeerChanged, Started
from agent_runtime.core.turn import Turn
from agent_runtime.io import journal
from agent_runtime.io.journal import MAGIC, Journal, frame, last_record, repair, scan
from fipa_codec.performatives import Performative as P


def written(path: Path, *records: bytes) -> bytes:
    """The file after these records."""
    book = Journal(path)
    for record in records:
        book.append(record)
    book.close()
    return path.read_bytes()


def test_every_truncation_of_the_tail(tmp_path: Path) -> None:
    """Cut the last record off at every byte: the record before; not cut: the last one."""
    path = tmp_path / "a.journal"
    whole = written(path, b"first", b"second record")
    before = len(whole) - len(frame(b"second record"))
    for end in range(before, len(whole)):
        path.write_bytes(whole[:end])
        book = Journal(path)
        assert book.last == b"first", end
        book.append(b"third")
        book.close()
        assert last_record(path.read_bytes()) == b"third"
    assert last_record(whole) == b"second record"


def test_every_truncation_of_the_head(tmp_path: Path) -> None:
    """A file torn before its first whole record is an empty journal, not an error."""
    path = tmp_path / "a.journal"
    whole = MAGIC + frame(b"only")
    for end in range(len(whole)):
        path.write_bytes(whole[:end])
        book = Journal(path)
        assert book.last is None
        book.close()


@given(records=st.lists(st.binary(max_size=40), min_size=1, max_size=5), data=st.data())
def test_a_spoilt_byte_is_never_believed(records: list[bytes], data: st.DataObject) -> None:
    """Flip any byte behind the magic: what is read is one of the records written, or none."""
    whole = bytearray(MAGIC + b"".join(frame(record) for record in records))
    at = data.draw(st.integers(len(MAGIC), len(whole) - 1))
    whole[at] ^= data.draw(st.integers(1, 255))
    assert last_record(bytes(whole)) in (None, *records)


def test_opening_compacts(tmp_path: Path) -> None:
    """After an opening the file holds the last record only; past the bound an append does the
    same.
    """
    path = tmp_path / "a.journal"
    written(path, *(b"x" * 1000 for _ in range(50)), b"last")
    book = Journal(path)
    assert path.read_bytes() == MAGIC + frame(b"last")
    book.close()


def test_growing_compacts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file does not grow for ever."""
    monkeypatch.setattr(journal, "COMPACT_BYTES", 10_000)
    path = tmp_path / "a.journal"
    book = Journal(path)
    for number in range(100):
        book.append(str(number).encode() * 500)
        assert path.stat().st_size < 12_000
        assert last_record(path.read_bytes()) == str(number).encode() * 500
    book.close()


def test_one_holder(tmp_path: Path) -> None:
    """A second process is told that the first one holds it; after the first is gone it may."""
    path = tmp_path / "a.journal"
    first = Journal(path)
    with pytest.raises(JournalError, match="another process holds it"):
        Journal(path)
    first.close()
    Journal(path).close()


def test_another_file_is_left_alone(tmp_path: Path) -> None:
    """A file that is not a journal is refused and stays as it was."""
    path = tmp_path / "a.journal"
    path.write_bytes(b"a letter to a friend")
    with pytest.raises(JournalError, match="not a journal"):
        Journal(path)
    assert path.read_bytes() == b"a letter to a friend"


# --- damaged, and of another version --------------------------------------------------------------


@pytest.mark.parametrize("middle", range(len(frame(b"second"))))
def test_a_damaged_record_before_a_whole_one_is_refused(tmp_path: Path, middle: int) -> None:
    """Whichever of its bytes is spoilt: in words that name file, offset and verb; the file stays as
    it is.
    """
    path = tmp_path / "ta.journal"
    whole = bytearray(written(path, b"first", b"second", b"third"))
    at = whole.index(frame(b"second"))
    whole[at + middle] ^= 0x10
    path.write_bytes(whole)
    with pytest.raises(
        JournalError, match=rf"ta.journal: the record at byte {at} is .*roco agent repair ta"
    ):
        Journal(path)
    assert path.read_bytes() == whole
    done = repair(path)
    assert Path(done.kept).read_bytes() == whole
    assert (done.damaged, done.good) == ((at,), 2)
    assert "nothing" in done.lost
    book = Journal(path)
    assert book.last == b"third"
    book.close()


@given(junk=st.binary(max_size=60), cut=st.integers(0, 12))
def test_whatever_is_behind_the_last_record_is_a_torn_tail(junk: bytes, cut: int) -> None:
    """Unless a whole record is in it, it is no reason to refuse."""
    data = MAGIC + frame(b"first") + junk + frame(b"second")[:cut]
    assert scan(data).damaged == ()
    assert scan(data).last == b"first"


def test_repair_of_a_lost_end_begins_the_streams_again(tmp_path: Path) -> None:
    """Peers may know of what is lost: memory is kept, the journal's name is new, conversations end
    by Broken.
    """
    one = Driven(quiet(ask, name="asker"), wirings()[0])
    one.state = one.core.boot(one.core.first("old"))
    one.step(PeerChanged("server", 1, "peer"))
    one.step(Local(Want(1)))
    path = tmp_path / "asker.journal"
    whole = written(path, one.core.record(one.state), b"the newest")
    path.write_bytes(whole[:-1] + b"!")
    done = repair(path)
    assert "open conversations end: 1" in done.lost
    book = Journal(path)
    assert book.last is not None
    state = one.core.boot(book.last)
    book.close()
    assert state.journal not in ("", "old")
    assert (state.conversations, state.outbox, state.issued) == ({}, {}, {})
    assert [(lost.held.conversation.id, lost.told) for lost in state.lost.values()] == [
        ("asker-1-1", False)
    ]
    one.state = state
    assert type(one.step(Started(first=False)).handled).__name__ == "Broken"


def ask(turn: Turn) -> None:
    """Ask what a person wants."""
    if isinstance(turn.event, Local):
        turn.open("server", "request", P.REQUEST)


def test_repair_keeps_every_damaged_file_and_refuses_a_living_agent(tmp_path: Path) -> None:
    """Nothing readable: begin with nothing; a whole file is left alone; who holds it is not
    disturbed.
    """
    path = tmp_path / "a.journal"
    for _ in range(2):
        path.write_bytes(b"#" * 40)
        assert "everything" in repair(path).lost
    assert {one.name for one in tmp_path.glob("*damaged*")} == {
        "a.journal.damaged",
        "a.journal.damaged-1",
    }
    assert repair(path).kept == ""
    book = Journal(path)
    with pytest.raises(JournalError, match="another process holds it"):
        repair(path)
    book.close()


@pytest.mark.parametrize("number", [2, 4, 12])
def test_another_format_is_refused_in_words(tmp_path: Path, number: int) -> None:
    """Older or newer: named, with what to do; the file stays."""
    path = tmp_path / "a.journal"
    path.write_bytes(data := b"roco-journal-%d\nwhatever" % number)
    for use in (Journal, repair):
        with pytest.raises(
            JournalError, match=f"of format {number}, this version of the software reads format 3"
        ):
            use(path)
    assert path.read_bytes() == data


def test_a_failed_write_leaves_the_file_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A part came through, then the disk was full: the next record follows the last whole one."""
    path = tmp_path / "a.journal"
    book = Journal(path)
    book.append(b"first")
    before = path.read_bytes()
    write = os.write
    told: list[int] = []

    def full(fd: int, data: bytes) -> int:
        if told:
            raise OSError(errno.ENOSPC, "No space left on device")
        told.append(write(fd, data[:5]))
        return told[0]

    for action in (book.append, lambda record: book._rewrite(record)):
        told.clear()
        monkeypatch.setattr(os, "write", full)
        with pytest.raises(OSError, match="No space"):
            action(b"second")
        monkeypatch.setattr(os, "write", write)
        assert path.read_bytes() == before
        assert [one.name for one in tmp_path.iterdir() if one.suffix == ".new"] == []
    book.append(b"third")
    book.close()
    assert path.read_bytes() == before + frame(b"third")

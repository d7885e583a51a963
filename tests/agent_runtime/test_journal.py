"""The journal: whatever byte a kill stops it at, what is read back is the state before or the state after."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.core.errors import JournalError
from agent_runtime.io import journal
from agent_runtime.io.journal import MAGIC, Journal, frame, last_record


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
    """After an opening the file holds the last record only; past the bound an append does the same."""
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
    """What is no journal is refused and stays as it was."""
    path = tmp_path / "a.journal"
    path.write_bytes(b"a letter to a friend")
    with pytest.raises(JournalError, match="not a journal"):
        Journal(path)
    assert path.read_bytes() == b"a letter to a friend"

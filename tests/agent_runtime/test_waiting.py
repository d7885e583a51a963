"""Samples that wait: in order, bounded in number and in bytes, whoever puts them."""

import threading

import msgspec
import pytest

from agent_runtime.io import tap
from agent_runtime.io.tap import Sample, Waiting


def sample(size: int, at: float = 0.0) -> Sample:
    """Of `size` bytes."""
    return Sample("k", b"x" * size, at)


def test_what_finds_no_room_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """By number or by bytes, whichever is reached first; what is taken makes room."""
    monkeypatch.setattr(tap, "MOST_WAITING", 3)
    monkeypatch.setattr(tap, "MOST_BYTES", 100)
    one = Waiting()
    for size in (60, 60, 40, 1):
        one.put(sample(size))
    assert one.dropped == 2
    assert [len(each.data) for each in one.left()] == [60, 40]
    for _ in range(5):
        one.put(sample(1))
    assert one.dropped == 4
    taken = one.get(1.0)
    assert taken is not None
    one.put(sample(98))
    assert one.dropped == 4


def test_all_room_is_there_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """After several threads put and one took everything."""
    monkeypatch.setattr(tap, "MOST_BYTES", 3000)
    one = Waiting()
    threads = [
        threading.Thread(target=lambda: [one.put(sample(3)) for _ in range(500)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    taken = 0
    while any(thread.is_alive() for thread in threads):
        taken += one.get(0.001) is not None
    taken += len(one.left())
    assert taken + one.dropped == 2000
    one.put(sample(3000))
    assert len(one.left()) == 1


def test_stop_ends_the_wait() -> None:
    """At once, and what waits is there still."""
    one = Waiting()
    one.stop()
    one.put(sample(1))
    assert one.get(60.0) is None
    assert one.stopped
    assert len(one.left()) == 1


def test_what_another_process_wrote_waits_and_its_end_stops() -> None:
    """A last line that is cut off is left out."""
    one, lines = Waiting(), [msgspec.json.encode(sample(size)) for size in (1, 2)]
    one.fill([*lines, lines[0][:9]])
    assert one.stopped
    assert [len(each.data) for each in one.left()] == [1, 2]

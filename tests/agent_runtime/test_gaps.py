"""Numbers of what a sender puts: a gap that stays is told once, with its time; what is only overtaken is none."""

import random

import pytest

from agent_runtime.io import gaps, waiting
from agent_runtime.io.gaps import SETTLED_S, Gaps
from agent_runtime.io.tap import Sample
from agent_runtime.io.waiting import Waiting
from agent_runtime.io.zenoh_wire import LINK

KEY = "roco/depot/C1/mule/traffic/passage/request"
STATE = "roco/depot/_/state/mule"


def said(number: int, at: float, key: str = KEY, source: str = "a") -> Sample:
    """Something that was numbered."""
    return Sample(key, b"", at, source=source, number=number)


def told(*samples: Sample) -> list[tuple[float, float, str]]:
    """Since when, until when and of whom something is missing."""
    heard = Gaps()
    found = [one for one in map(heard.heard, samples) if one is not None]
    return [(one.deaf_since, one.at, one.sender) for one in found]


def test_a_gap_is_told_once_by_the_next_that_is_late_enough() -> None:
    """With the time since the last one before it; of what the sender says beside communicates, too."""
    later = 3.0 + SETTLED_S + 0.01
    assert told(said(1, 1.0), said(2, 2.0), said(5, 3.0)) == []
    assert told(said(1, 1.0), said(2, 2.0), said(5, 3.0), said(6, later, STATE), said(7, later + 9)) == [
        (2.0, later, "mule")
    ]


@pytest.mark.parametrize("seed", range(20))
def test_what_is_overtaken_is_not_missing(seed: int) -> None:
    """Each is up to SETTLED_S late, whatever its order."""
    chance = random.Random(seed)
    delayed = sorted((n * 0.01 + chance.uniform(0.0, SETTLED_S), n) for n in range(1, 500))
    assert told(*(said(n, at) for at, n in delayed)) == []
    (at, _), delayed = delayed[250], [*delayed[:250], *delayed[251:]]
    found = told(*(said(n, at) for at, n in delayed))
    assert len(found) == 1
    assert found[0][0] - SETTLED_S <= at <= found[0][1]


def test_a_source_that_begins_again_has_lost_nothing() -> None:
    """After a reconnect, or as another process; what is not numbered says nothing; each sender has its own numbers."""
    again = said(LINK + 1, 5.0), said(LINK + 2, 9.0)
    assert told(said(8, 1.0), said(9, 2.0), *again) == []
    assert told(said(8, 1.0), said(700, 2.0, source="b"), said(9, 3.0)) == []
    assert told(said(8, 1.0), Sample(KEY, b"", 2.0), said(9, 3.0)) == []
    assert told(said(8, 1.0), said(70, 2.0, STATE.replace("mule", "ox")), said(9, 3.0)) == []


def test_where_the_first_ones_after_a_reconnect_are_lost_that_is_told() -> None:
    """Of numbers 1 to 4 only the last was heard."""
    assert told(said(9, 1.0), said(LINK + 4, 2.0), said(LINK + 5, 9.0)) == [(1.0, 9.0, "mule")]


def test_a_large_gap_is_told_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody remembers a million missing numbers; nor more sources than are known."""
    monkeypatch.setattr(gaps, "SOURCES", 2)
    assert told(said(1, 1.0), said(1_000_000, 2.0), said(1_000_001, 2.1), said(999_500, 2.2)) == [(1.0, 2.0, "mule")]
    one = Gaps()
    for n in range(9):
        one.heard(said(1, 1.0, source=str(n)))
    assert len(one._sources) == 2


def test_what_finds_no_room_in_a_queue_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reader gets the mark before the sample by which it is seen, also of what is left at the end."""
    monkeypatch.setattr(waiting, "MOST_WAITING", 2)
    queue = Waiting()
    for n in (1, 2, 3):
        queue.put(said(n, float(n)))
    assert [queue.get(0.0), queue.get(0.0), queue.get(0.0)] == [said(1, 1.0), said(2, 2.0), None]
    queue.put(said(4, 4.0))
    queue.put(said(5, 5.0))
    assert queue.get(0.0) == said(4, 4.0)
    assert queue.get(0.0) == Sample("", b"", 5.0, deaf_since=2.0, missed=KEY)
    assert queue.left() == [said(5, 5.0)]

"""The judge on a whole recorded run: no false alarm, and each planted violation is found, named,
and nothing else.
"""

import random
from collections import Counter

import msgspec
import pytest
from planting import PLANTS, Traffic

from agent_runtime.io.tap import Sample
from operate.recording.records import Token
from topdown.judge.verdicts import VIOLATIONS, Verdict

MISSED_S, NOTICED_S = 0.9, 2.0
"""A gap in what a sender said is noticed at its next heartbeat but one."""
UNTOLD_S = 0.02
"""Delay within which each communicate is heard here [s]; on one host it is less than a ms."""


def test_a_whole_run_is_as_designed() -> None:
    """Every communicate of the pour is judged, none is against the design, and none is left
    unjudged.
    """
    traffic = Traffic()
    verdicts = Counter(traffic.verdicts())
    assert traffic.found() == []
    assert sum(verdicts.values()) == sum(isinstance(item, Sample) for item in traffic.items)
    assert verdicts["copy"] == 4
    assert verdicts[Verdict.NOT_JUDGED] == 0


def test_there_are_plants_of_every_verdict() -> None:
    """At least twenty, and each kind of violation that one communicate shows
    (tests/operate/recording/test_ends.py has those that two logs show).
    """
    assert len(PLANTS) >= 20
    found = {plant(Traffic())[0] for plant in PLANTS.values()}
    assert found == VIOLATIONS - {Verdict.NOT_SAID, Verdict.ALTERED}


@pytest.mark.parametrize("why", PLANTS)
def test_a_planted_violation_is_found_and_named(why: str) -> None:
    """The right verdict about the right communicate, and nothing else is flagged."""
    traffic = Traffic()
    expected = PLANTS[why](traffic)
    assert traffic.found() == [expected]


@pytest.mark.parametrize("part", range(1, 12))
def test_who_begins_in_the_middle_alarms_about_nothing(part: int) -> None:
    """Communicates after a start in the middle are as designed, or not judged."""
    traffic = Traffic()
    cut = part * len(traffic.items) // 12
    traffic.items = [
        item for n, item in enumerate(traffic.items) if n >= cut or isinstance(item, Token)
    ]
    assert traffic.found() == []


@pytest.mark.parametrize("seed", range(10))
def test_the_order_of_hearing_need_not_be_that_of_saying(seed: int) -> None:
    """A stream keeps its order; all else may be heard some ms sooner or later than the other side's
    words.
    """
    traffic, chance = Traffic(), random.Random(seed)
    last: dict[tuple[str, ...], float] = {}
    for n, item in enumerate(traffic.items):
        if isinstance(item, Sample):
            pair = tuple(item.key.split("/")[3:5])
            last[pair] = at = max(last.get(pair, 0.0), item.at + chance.uniform(0.0, UNTOLD_S))
            traffic.items[n] = msgspec.structs.replace(item, at=at)
    traffic.items.sort(key=lambda item: item.at if isinstance(item, Sample) else item.received)
    assert traffic.found() == []


@pytest.mark.parametrize("nth", range(1, 99, 4))
def test_a_number_that_was_not_heard_is_no_violation(nth: int) -> None:
    """Of a durable stream nobody can skip a number: the tap missed it, and what it was about is not
    judged.
    """
    traffic = Traffic()
    keys = [item.key.split("/") if isinstance(item, Sample) else [] for item in traffic.items]
    durable = [n for n, key in enumerate(keys) if key[2:3] in (["C1"], ["C2"], ["C5"])]
    traffic.remove(durable[nth])
    assert traffic.found() == []
    assert Verdict.NOT_JUDGED in traffic.verdicts()

"""Two sets of runs side by side: what became worse, by how much, and where they begin to say
different things. Pure.

A quantity is worse only when the whole 95 % interval of the difference lies beyond the threshold.
With one or two runs a side there is none, so it stays open; but of two single runs one that
succeeded and one that did not is a regression.
"""

from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from itertools import zip_longest
from typing import Any

import msgspec

from operate.experiments import intervals
from operate.experiments.intervals import Difference, Interval
from operate.experiments.measures import Quantity, Runs, values
from operate.experiments.run_figures import Result, SentMessage

# --- First differences in the exchanges of two runs, aligned by conversation and not by time. Pure
# Conversations of the same kind (who opens, to whom, by which protocol, about what) are paired in
# the order in which they were opened; within a pair each side's communicates are compared one by
# one by what they mean (saying.Said.meaning). So neither another order of conversations side by
# side, nor two words that cross, nor a slow machine count as a difference.


Kind = tuple[str, str, str]


class Divergence(msgspec.Struct, frozen=True):
    """The first communicate in which they differ: in A, in B (None: it was not said there).

    `of`: the kind of the conversation in words; `conversation`: which one of that kind, `position`:
    which communicate of its sender in it, both from 1.
    """

    of: str
    conversation: int
    position: int
    a: SentMessage | None
    b: SentMessage | None


def first(a: Sequence[SentMessage], b: Sequence[SentMessage]) -> Divergence | None:
    """The earliest difference by the time at which it was said in A (where only B said it: in B);
    None: none.
    """
    differing = list(_differences(conversations(a), conversations(b)))
    return min(differing, key=_when, default=None)


def conversations(said: Sequence[SentMessage]) -> dict[Kind, list[list[SentMessage]]]:
    """All conversations by kind, each kind's in the order of opening."""
    talks: dict[tuple[str, str], list[SentMessage]] = {}
    for one in said:
        talks.setdefault((one.protocol, one.conversation), []).append(one)
    kinds: dict[Kind, list[list[SentMessage]]] = {}
    for talk in talks.values():
        opening = talk[0]
        kinds.setdefault((opening.sender, opening.receiver, opening.protocol), []).append(talk)
    return kinds


def _differences(
    a: dict[Kind, list[list[SentMessage]]], b: dict[Kind, list[list[SentMessage]]]
) -> Iterator[Divergence]:
    """The first one of each kind."""
    for kind in {**a, **b}:
        silence: list[SentMessage] = []
        pairs = zip_longest(a.get(kind, []), b.get(kind, []), fillvalue=silence)
        found = (
            _in_pair(kind, number, one, other) for number, (one, other) in enumerate(pairs, start=1)
        )
        divergence = next((one for one in found if one is not None), None)
        if divergence is not None:
            yield divergence


def _in_pair(
    kind: Kind, number: int, a: Sequence[SentMessage], b: Sequence[SentMessage]
) -> Divergence | None:
    sender, receiver, protocol = kind
    found: list[Divergence] = []
    for side in (sender, receiver):
        ours, theirs = ([one for one in some if one.sender == side] for some in (a, b))
        for position, (one, other) in enumerate(zip_longest(ours, theirs), start=1):
            if one is None or other is None or one.meaning != other.meaning:
                found.append(
                    Divergence(f"{sender} to {receiver}, {protocol}", number, position, one, other)
                )
                break
    return min(found, key=_when, default=None)


def _when(found: Divergence) -> float:
    one = found.a or found.b
    assert one is not None
    return one.t


# --- Two sets of runs side by side ----------------------------------------------------------------


SUCCESS = "success"
THRESHOLDS: dict[str, float] = {SUCCESS: 5.0, "latency": 10.0, "energy": 10.0, "traffic": 10.0}
"""Success in points of per cent, the others in per cent of A's mean; estimates: below, nobody would
act on it.
"""


def thresholds(words: Sequence[str]) -> dict[str, float]:
    """THRESHOLDS with some set: "latency=20", or "20" for all. ValueError names what is none."""
    found = dict(THRESHOLDS)
    for word in words:
        kind, equals, number = word.rpartition("=")
        if (equals and kind not in THRESHOLDS) or not _is_percent(number):
            raise ValueError(
                f"{word!r} is no threshold; give PERCENT, or {', '.join(THRESHOLDS)} with =PERCENT"
            )
        found |= {kind: float(number)} if equals else dict.fromkeys(THRESHOLDS, float(number))
    return found


class Verdict(StrEnum):
    """Verdict on a difference, held against its threshold."""

    WORSE = "worse"
    BETTER = "better"
    SAME = "same"  # with 95 % within the threshold
    OPEN = "open"  # the interval reaches over the threshold: more runs would tell
    SHOWN = "shown"  # not judged
    UNKNOWN = "unknown"  # a side has no figure, or A's is zero


class Compared(msgspec.Struct, frozen=True):
    """One quantity. `percent`: the difference in per cent of A's mean (success: in points); so
    `low`, `high`.
    """

    name: str
    kind: str
    unit: str
    a: Interval | None
    b: Interval | None
    difference: Difference | None
    percent: float | None
    low: float | None
    high: float | None
    threshold: float
    verdict: Verdict


class Lost(msgspec.Struct, frozen=True):
    """A seed that succeeded in A and not in B, and why."""

    seed: int
    why: str


class Diverged(msgspec.Struct, frozen=True):
    """Of a seed that both sets have: where its runs begin to differ; None: in nothing that was
    said.
    """

    seed: int
    first: Divergence | None


class Comparison(msgspec.Struct, frozen=True):
    """Everything. `regression`: something judged is worse."""

    a: str
    b: str
    runs: tuple[int, int]
    rows: tuple[Compared, ...]
    lost: tuple[Lost, ...]
    diverged: tuple[Diverged, ...]
    regression: bool


def compared(a: Runs, b: Runs, thresholds: Mapping[str, float] = THRESHOLDS) -> Comparison:
    """B against A; `thresholds`: kind -> per cent, one for each key of THRESHOLDS."""
    measured = (_quantity(one, a, b, thresholds[one.kind]) for one in a.measures.all_quantities)
    success = _success(a.results, b.results, thresholds[SUCCESS])
    rows = (success, *(row for row in measured if row.a is not None or row.b is not None))
    return Comparison(
        a=a.name,
        b=b.name,
        runs=(len(a.results), len(b.results)),
        rows=rows,
        lost=_lost(a.results, b.results) if _paired(a, b) else (),
        diverged=_diverged(a, b),
        regression=any(row.verdict is Verdict.WORSE for row in rows),
    )


def verdict(
    percent: float | None, low: float | None, high: float | None, threshold: float
) -> Verdict:
    """Of a difference whose growth is bad; without an interval it stays open."""
    if percent is None:
        return Verdict.UNKNOWN
    if low is None or high is None:
        return Verdict.OPEN
    if low > threshold:
        return Verdict.WORSE
    if high < -threshold:
        return Verdict.BETTER
    return Verdict.SAME if -threshold <= low and high <= threshold else Verdict.OPEN


def _is_percent(text: str) -> bool:
    try:
        return 0.0 <= float(text) < float("inf")
    except ValueError:
        return False


def _success(a: tuple[Result[Any], ...], b: tuple[Result[Any], ...], threshold: float) -> Compared:
    counts = [(sum(one.success for one in side), len(side)) for side in (a, b)]
    sides = intervals.share(*counts[0]), intervals.share(*counts[1])
    row = _row(SUCCESS, SUCCESS, "", sides, intervals.difference_of_shares(*counts), 1.0, threshold)
    least, most = (
        (row.percent, row.percent) if row.low is None or row.high is None else (row.low, row.high)
    )
    # a growth is good
    loss = [None if value is None else -value for value in (row.percent, most, least)]
    return msgspec.structs.replace(row, verdict=verdict(loss[0], loss[1], loss[2], threshold))


def _quantity(quantity: Quantity, a: Runs, b: Runs, threshold: float) -> Compared:
    first, second = values(quantity, a.results), values(quantity, b.results)
    sides = intervals.mean(list(first.values())), intervals.mean(list(second.values()))
    apart = intervals.difference(first, second, seeded=a.seeded and b.seeded)
    of = abs(sides[0].value) if sides[0] else 0.0
    row = _row(quantity.name, quantity.kind, quantity.unit, sides, apart, of, threshold)
    return row if quantity.judged else msgspec.structs.replace(row, verdict=Verdict.SHOWN)


def _row(
    name: str, kind: str, unit: str, sides: tuple[Interval | None, Interval | None],
    apart: Difference | None, of: float, threshold: float,
) -> Compared:  # fmt: skip
    """A quantity of which a growth is bad; `of`: what the difference is told in per cent of."""
    percent, low, high = _percent(apart, of)
    found = verdict(percent, low, high, threshold)
    return Compared(name, kind, unit, *sides, apart, percent, low, high, threshold, found)


def _percent(
    apart: Difference | None, of: float
) -> tuple[float | None, float | None, float | None]:
    """A difference in per cent of something; all None where it cannot be said."""
    if apart is None or of == 0.0:
        return None, None, None
    low = None if apart.low is None else 100 * apart.low / of
    high = None if apart.high is None else 100 * apart.high / of
    return 100 * apart.value / of, low, high


def _lost(a: tuple[Result[Any], ...], b: tuple[Result[Any], ...]) -> tuple[Lost, ...]:
    fine = {one.seed for one in a if one.success}
    failed = ((one.seed or 0, one.failure) for one in b if one.seed in fine)
    return tuple(Lost(seed, why) for seed, why in failed if why is not None)


def _diverged(a: Runs, b: Runs) -> tuple[Diverged, ...]:
    """Of the seeds that both have."""
    common = sorted(set(a.said) & set(b.said)) if _paired(a, b) else []
    return tuple(Diverged(seed, first(a.said[seed], b.said[seed])) for seed in common)


def _paired(a: Runs, b: Runs) -> bool:
    """Whether runs of one number belong together: of one seed, or two single ones of unknown
    seeds.
    """
    return (a.seeded and b.seeded) or len(a.results) == len(b.results) == 1

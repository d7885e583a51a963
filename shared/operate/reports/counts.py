"""Figures of the traffic: who told whom how often (the paper's Table 8), sizes, bytes over time, how long answers take.

All from a History's communicates; re-sent copies are counted apart. Times are those at which the monitor heard things.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable

import msgspec
import numpy as np

from fipa_codec.communicate import number_of
from fipa_codec.performatives import Performative
from operate.recording.history import History, Told
from operate.recording.records import Spoken
from topdown.model.design import Design

OPENING = (Performative.REQUEST, Performative.QUERY_REF, Performative.SUBSCRIBE)
SMALL_BYTES = 500
"""The paper: 86 % of its communicates are smaller (section 5.7)."""


class Sizes(msgspec.Struct, frozen=True):
    """Sizes of some communicates [bytes]."""

    count: int
    total: int
    least: int
    mean: float
    largest: int


class Communicates(msgspec.Struct, frozen=True):
    """All communicates of a run. `matrix`: sender -> receiver -> how many; `bytes`: channel -> bytes.

    `over_budget`: channel -> communicates larger than the design allows; `small`: share of those under 500 bytes.
    """

    total: int
    matrix: dict[str, dict[str, int]]
    bytes: dict[str, int]
    per_channel: dict[str, Sizes]
    over_budget: dict[str, int]
    copies: int
    garbage: int
    small: float | None


class Spans(msgspec.Struct, frozen=True):
    """Durations [ms]."""

    count: int
    p50: float
    p99: float
    max: float


class Latency(msgspec.Struct, frozen=True):
    """One use of a protocol: from the opening to its answer, from a durable communicate to its receipt.

    `budget_ms`: what the design allows for the answer.
    """

    channel: str
    use: str
    budget_ms: float
    answer: Spans | None
    receipt: Spans | None


def communicates(history: History, design: Design, order: tuple[str, ...] = ()) -> Communicates:
    """Count a history. `order`: of the agents in the matrix; else the design's."""
    said, agents = history.said, order or tuple(design.agents)
    matrix: dict[str, dict[str, int]] = {a: dict.fromkeys(agents, 0) for a in agents}
    for one in said:
        matrix[one.sender][one.receiver] += 1
    per_channel = {channel: _sizes([o.size for o in said if o.channel == channel]) for channel in design.channels}
    over = Counter(one.channel for one in said if one.size > design.rule(one.communicate).bytes)
    return Communicates(
        total=len(said),
        matrix=matrix,
        bytes={channel: sizes.total for channel, sizes in per_channel.items()},
        per_channel=per_channel,
        over_budget=dict(over),
        copies=len(history.copies),
        garbage=len(history.garbage),
        small=sum(one.size < SMALL_BYTES for one in said) / len(said) if said else None,
    )


def latencies(history: History, design: Design) -> tuple[Latency, ...]:
    """Of each use of a protocol in which something was asked, in the order of the design."""
    answers = _by_use(history.said, _answers(history.said, design), design)
    receipts = _by_use(history.said, _receipted(history, design), design)
    return tuple(
        Latency(
            channel=use.channel,
            use=use.name,
            budget_ms=1000 * use.latency_s,
            answer=_spans(answers[use.name]),
            receipt=_spans(receipts[use.name]),
        )
        for use in design.file.protocol
        if answers[use.name] or receipts[use.name]
    )


def bandwidth(said: Iterable[Spoken], start: float, end: float, bin_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Edges of the bins [s after `start`], (n+1,), and what was said in them [bit/s], (n,)."""
    some = [one for one in said if start <= one.received <= end]
    edges = np.arange(0.0, max(end - start, bin_s) + bin_s, bin_s)
    at = [one.received - start for one in some]
    bits, _ = np.histogram(at, bins=edges, weights=[8.0 * one.size for one in some])
    return edges, bits / bin_s


def _sizes(sizes: list[int]) -> Sizes:
    if not sizes:
        return Sizes(0, 0, 0, 0.0, 0)
    return Sizes(len(sizes), sum(sizes), min(sizes), sum(sizes) / len(sizes), max(sizes))


def _spans(seconds: list[float]) -> Spans | None:
    if not seconds:
        return None
    ms = 1000 * np.array(seconds)
    p50, p99 = np.percentile(ms, (50, 99))
    return Spans(len(ms), float(p50), float(p99), float(ms.max()))


def _by_use(
    said: Iterable[Spoken], measure: Callable[[Spoken], float | None], design: Design
) -> dict[str, list[float]]:
    found: dict[str, list[float]] = defaultdict(list)
    for one in said:
        seconds = measure(one)
        if seconds is not None:
            found[design.rule(one.communicate).use].append(seconds)
    return found


def _answers(said: tuple[Spoken, ...], design: Design) -> Callable[[Spoken], float | None]:
    """For an opening: time to the first word (or the result) in the same conversation; None for all else.

    The result counts in uses whose budget in the design is that of the result; elsewhere the first word does, an agree.
    """
    result = {use.name for use in design.file.protocol if use.answer}
    first: dict[tuple[str, str], float] = {}
    for one in said:
        if one.performative != Performative.AGREE or design.rule(one.communicate).use not in result:
            first.setdefault((one.conversation, one.sender), one.received)

    def measure(one: Spoken) -> float | None:
        answer = first.get((one.conversation, one.receiver))
        if one.performative not in OPENING or answer is None or answer < one.received:
            return None
        return answer - one.received

    return measure


def _receipted(history: History, design: Design) -> Callable[[Spoken], float | None]:
    """For a durable communicate: time to the first receipt that covers its number; None for all else."""
    told: dict[tuple[str, str], list[Told]] = defaultdict(list)
    for receipt in history.receipts:
        told[receipt.owner, receipt.peer].append(receipt)

    def measure(one: Spoken) -> float | None:
        number = number_of(one.id) if design.rule(one.communicate).durable else None
        if number is None:
            return None
        covering = (t.at for t in told[one.receiver, one.sender] if t.receipt.taken >= number)
        at = next(covering, None)
        return at - one.received if at is not None and at >= one.received else None

    return measure

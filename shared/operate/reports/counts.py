"""Figures of the traffic: who told whom how often (the paper's Table 8), sizes, bytes over time,
how long answers take.

The defaults are for reports of older versions, which lack a figure. All from a History's
communicates; re-sent copies are counted apart. A latency is what the sender waited, by its own step
log; without one, as the recorder heard it. All other times are the recorder's.
"""

from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from operator import attrgetter
from statistics import median

import msgspec
import numpy as np

from fipa_codec.communicate import number_of
from fipa_codec.performatives import Performative
from operate.quantiles import tail
from operate.recording.ends import HeardReceipt
from operate.recording.history import History
from operate.recording.records import Spoken
from topdown.model.design import Design

OPENING = (Performative.REQUEST, Performative.QUERY_REF, Performative.SUBSCRIBE)
SMALL_BYTES = 500
"""The paper: 86 % of its communicates are smaller (section 5.7)."""


class Sizes(msgspec.Struct, frozen=True):
    """Sizes of some communicates [bytes]."""

    count: int = 0
    total: int = 0
    least: int = 0
    mean: float = 0.0
    largest: int = 0


class Communicates(msgspec.Struct, frozen=True):
    """All communicates of a run. `matrix`: sender -> receiver -> how many; `bytes`: channel ->
    bytes.

    `over_budget`: channel -> communicates larger than the design allows; `small`: share of those
    under 500 bytes.
    """

    total: int = 0
    matrix: dict[str, dict[str, int]] = {}
    bytes: dict[str, int] = {}
    per_channel: dict[str, Sizes] = {}
    over_budget: dict[str, int] = {}
    copies: int = 0
    garbage: int = 0
    small: float | None = None


class Spans(msgspec.Struct, frozen=True):
    """Durations [ms], from an agent's sending to its hearing, by its own log.

    `p95`, `p99`: null where there are too few of them (operate.quantiles).
    """

    count: int = 0
    p50: float = 0.0
    p95: float | None = None
    p99: float | None = None
    max: float = 0.0

    @property
    def most(self) -> tuple[float, float]:
        """Return a share and the time [ms] that it does not exceed: 0.99 or 0.95 with enough
        values, else 1.
        """
        told = ((0.99, self.p99), (0.95, self.p95), (1.0, self.max))
        return next((share, ms) for share, ms in told if ms is not None)


class Latency(msgspec.Struct, frozen=True):
    """One use of a protocol: from the opening to its answer, from a durable communicate to its
    receipt.

    `budget_ms`: what the design allows for the answer.
    """

    channel: str
    use: str
    budget_ms: float = 0.0
    answer: Spans | None = None
    receipt: Spans | None = None


def communicates(history: History, design: Design, order: tuple[str, ...] = ()) -> Communicates:
    """Count a history. `order`: of the agents in the matrix; else the design's. Guests of the
    design that spoke, and their channels, stand behind them.
    """
    said, agents = history.said, order or tuple(design.agents)
    guests = (name for one in said for name in (one.sender, one.receiver) if name in design.guests)
    agents = tuple(dict.fromkeys((*agents, *guests)))
    matrix: dict[str, dict[str, int]] = {a: dict.fromkeys(agents, 0) for a in agents}
    for one in said:
        matrix[one.sender][one.receiver] += 1
    of_channel: dict[str, list[int]] = {name: [] for name in design.channels}
    for one in said:
        of_channel.setdefault(one.channel, []).append(one.size)
    per_channel = {name: _sizes(sizes) for name, sizes in of_channel.items()}
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
    answers = _by_use(history.said, _answers(history, design), design)
    receipts = _by_use(history.said, _receipted(history, design), design)
    found = []
    for use in design.file.protocol:
        some = spans(answers[use.name]), spans(receipts[use.name])
        if any(some):
            found.append(Latency(use.channel, use.name, 1000 * use.latency_s, *some))
    return tuple(found)


def spans(some: list[float]) -> Spans | None:
    """Return what is told of some times [s]; None without any."""
    if not some:
        return None
    ms = [1000 * one for one in some]
    return Spans(len(ms), median(ms), tail(ms, 0.95), tail(ms, 0.99), max(ms))


def bandwidth(
    said: Iterable[Spoken], start: float, end: float, bin_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Edges of the bins [s after `start`], (n+1,), and what was said in them [bit/s], (n,)."""
    some = [one for one in said if start <= one.received <= end]
    edges = np.arange(0.0, max(end - start, bin_s) + bin_s, bin_s)
    at = [one.received - start for one in some]
    bits, _ = np.histogram(at, bins=edges, weights=[8.0 * one.size for one in some])
    return edges, bits / bin_s


def _sizes(sizes: list[int]) -> Sizes:
    if not sizes:
        return Sizes()
    return Sizes(len(sizes), sum(sizes), min(sizes), sum(sizes) / len(sizes), max(sizes))


def _by_use(
    said: Iterable[Spoken], measure: Callable[[Spoken], float | None], design: Design
) -> dict[str, list[float]]:
    found: dict[str, list[float]] = defaultdict(list)
    for one in said:
        took = measure(one)
        if took is not None:
            found[design.rule(one.communicate).use].append(took)
    return found


def _answers(history: History, design: Design) -> Callable[[Spoken], float | None]:
    """For an opening: time to the first word (or the result) in the same conversation; None for all
    else.

    The result counts in uses whose budget in the design is that of the result; elsewhere the first
    word does, an agree.
    """
    result = {use.name for use in design.file.protocol if use.answer}
    first: dict[tuple[str, str], Spoken] = {}
    for one in history.said:
        if one.performative != Performative.AGREE or design.rule(one.communicate).use not in result:
            first.setdefault((one.conversation, one.sender), one)

    def measure(one: Spoken) -> float | None:
        answer = first.get((one.conversation, one.receiver))
        if one.performative not in OPENING or answer is None:
            return None
        return history.answered(one, answer)

    return measure


def _receipted(history: History, design: Design) -> Callable[[Spoken], float | None]:
    """For a durable communicate: time to the first receipt that covers its number; None for all
    else.
    """
    told: dict[tuple[str, str], list[HeardReceipt]] = defaultdict(list)
    for receipt in history.receipts:
        told[receipt.owner, receipt.peer].append(receipt)

    def measure(one: Spoken) -> float | None:
        number = number_of(one.id) if design.rule(one.communicate).durable else None
        if number is None:
            return None
        later = told[one.receiver, one.sender]
        since = range(bisect_left(later, one.sent, key=attrgetter("at")), len(later))
        covering = (later[place].at for place in since if later[place].receipt.taken >= number)
        return history.took(one, next(covering, None))

    return measure

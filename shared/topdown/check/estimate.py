"""Load of a design before anything runs: how many communicates, how large, how fast, where it is
narrow.

A small model of typical figures that the designer states. Conversations of a use are opened within
those of another (`within`, `per`); the roots are opened by a person or the start. A message is said
`count` times in a conversation of its use, or of the use `each`, and has `typical_bytes`. A
conversation takes `typical_s` and, one after the other, whatever is opened within it, but for what
goes on `alongside`. Beside the typical figures stand the most that the budgets allow. Where figures
are missing, there is one conversation of a use, the shortest that its table allows with the listed
acts, and each communicate is as large as its budget. Left out: what is said in parallel, waiting in
queues, faults and what is said again because of them.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable
from functools import reduce
from operator import add
from statistics import median

import msgspec

from fipa_codec.exploration import shortest
from fipa_codec.tables import Role, Way
from topdown.check.protocols import listed, restricted
from topdown.check.recorded import Observation, Observed, answers, use_of
from topdown.model import elements
from topdown.model.design import Design


class Load(msgspec.Struct, frozen=True):
    """Load of a channel or a use: how many communicates, their bytes, the most the budgets allow.

    `mean_bit_s`: over the whole run; `busy_bit_s`: while the conversations go on within which it is
    said (of a channel that of its busiest use).
    """

    communicates: float
    bytes: float
    most_bytes: float
    mean_bit_s: float
    busy_bit_s: float


class UseEstimate(msgspec.Struct, frozen=True):
    """A use of a protocol: its conversations, what one takes [s], what its answer takes [s] beside
    its budget (0: none) and `share`: of the whole time the part that passes in it and in nothing
    opened within it.
    """

    use: str
    channel: str
    conversations: float
    seconds: float
    latency_s: float
    budget_s: float
    share: float
    load: Load


class Estimate(msgspec.Struct, frozen=True):
    """`seconds`: from the first opening to the end of the roots; `missing`: uses that lack figures,
    in whose place one shortest conversation with the sizes of the budgets is counted.
    """

    seconds: float
    channels: dict[str, Load]
    uses: tuple[UseEstimate, ...]
    missing: tuple[str, ...]

    @property
    def narrowest(self) -> str:
        """The channel that carries most while it is busy; "" where nothing is known."""
        every = ((name, load.busy_bit_s) for name, load in self.channels.items())
        busy = {name: rate for name, rate in every if rate > 0}
        return max(busy, key=lambda name: busy[name], default="")

    @property
    def slowest(self) -> str:
        """The use in which most of the time passes."""
        shares = {one.use: one.share for one in self.uses if one.share > 0}
        return max(shares, key=lambda name: shares[name], default="")


def estimate(design: Design) -> Estimate:
    """The estimate of a sound design; a use without figures counts nothing and is named under
    `missing`.
    """
    return _Model(design).estimate()


class _Model:
    """Conversations, durations and messages of each use."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.uses = design.protocols
        self.opened = {name: self._conversations(name, ()) for name in self.uses}
        self.took = {name: self._seconds(name, ()) for name in self.uses}
        roots = [use for use in self.uses.values() if not use.within and not use.alongside]
        self.seconds = total(self.opened[use.name] * self.took[use.name] for use in roots)

    def estimate(self) -> Estimate:
        uses = tuple(self._use(use) for use in self.uses.values())
        missing = tuple(use.name for use in self.uses.values() if _lacks_figures(use))
        channels = {name: _channel(name, uses, self.seconds) for name in self.design.channels}
        return Estimate(self.seconds, channels, uses, missing)

    def _conversations(self, name: str, below: tuple[str, ...]) -> float:
        use = self.uses.get(name)
        if use is None or name in below:
            return 0.0
        return _per(use) * (self._conversations(use.within, (*below, name)) if use.within else 1.0)

    def _seconds(self, name: str, above: tuple[str, ...]) -> float:
        """The duration of one conversation, with all that is opened within it."""
        if name in above:
            return 0.0
        children = [use for use in self.uses.values() if use.within == name and not use.alongside]
        within = total(_per(use) * self._seconds(use.name, (*above, name)) for use in children)
        return self.uses[name].typical_s + within

    def _said(self, use: elements.Protocol) -> list[tuple[elements.Message, float]]:
        """Each message and how often it is said in all."""
        given = [message.count or 0.0 for message in use.message]
        counts = given if _has_counts(use) else self._shortest(use)
        opened = [self.opened.get(message.each or use.name, 0.0) for message in use.message]
        times = (count * often for count, often in zip(counts, opened, strict=True))
        return list(zip(use.message, times, strict=True))

    def _shortest(self, use: elements.Protocol) -> list[float]:
        """The count of each message in the shortest conversation; an act that is listed twice
        counts once.
        """
        table = self.design.tables.get(use.follows)
        steps = shortest(restricted(table, listed(use))) if table else ()
        ends = {Role.INITIATOR: use.initiator, Role.PARTICIPANT: use.participant}
        sent = (step for step in steps if step.row.way is Way.SEND)
        said = Counter((ends[step.role], step.row.performative) for step in sent)
        return [float(said.pop((one.sender, one.performative), 0)) for one in use.message]

    def _use(self, use: elements.Protocol) -> UseEstimate:
        said = self._said(use)
        count = total(times for _, times in said)
        size = total(times * (message.typical_bytes or message.bytes) for message, times in said)
        most = total(times * message.bytes for message, times in said)
        rates = (_rate(size, self.seconds), _rate(size, self._going_on(use)))
        opened, took = self.opened[use.name], self.took[use.name]
        latency_s = took if use.answer else use.typical_latency_s
        counted = self.seconds and not use.alongside
        share = opened * use.typical_s / self.seconds if counted else 0.0
        times = (opened, took, latency_s, use.latency_s, share)
        return UseEstimate(use.name, use.channel, *times, Load(count, size, most, *rates))

    def _going_on(self, use: elements.Protocol) -> float:
        """The duration of the uses within which this one's conversations are opened [s]."""
        around = use.within
        while around and self.uses[around].alongside:
            around = self.uses[around].within
        return self.opened[around] * self.took[around] if around else self.seconds


def _channel(name: str, uses: Iterable[UseEstimate], seconds: float) -> Load:
    """The load of a channel: that of its uses."""
    loads = [one.load for one in uses if one.channel == name]
    size = total(load.bytes for load in loads)
    count = total(load.communicates for load in loads)
    most = total(load.most_bytes for load in loads)
    busy = max((load.busy_bit_s for load in loads), default=0.0)
    return Load(count, size, most, _rate(size, seconds), busy)


def total(some: Iterable[float]) -> float:
    """The sum; what is too large is infinite, where math.fsum would raise."""
    return reduce(add, some, 0.0)


def _per(use: elements.Protocol) -> float:
    return 1.0 if use.per is None else use.per


def _has_counts(use: elements.Protocol) -> bool:
    return any(message.count is not None for message in use.message)


def _lacks_figures(use: elements.Protocol) -> bool:
    """Whether figures are missing; `per = 0` says that nobody opens it."""
    return use.per is None or (use.per > 0 and not _has_counts(use))


def _rate(size: float, seconds: float) -> float:
    """Bit per second; 0 where no time passes."""
    return 8 * size / seconds if seconds > 0 else 0.0


# --- The figures of a recording in the words of an estimate, and how far the estimate was from them


class Measured(msgspec.Struct, frozen=True):
    """One figure of a channel or use: estimated, recorded, and the error as a share of what was
    recorded (None: nothing was recorded).
    """

    where: str
    what: str
    unit: str
    estimated: float
    recorded: float

    @property
    def error(self) -> float | None:
        """Signed; +0.3: thirty per cent too much."""
        return (self.estimated - self.recorded) / self.recorded if self.recorded else None


def measure(design: Design, estimated: Estimate, run: Observed) -> tuple[Measured, ...]:
    """Every figure that both have: per channel communicates, bytes, bandwidth, per use latency, and
    the whole time.
    """
    recorded = recorded_as_estimate(design, run)
    found = [Measured("run", "time", "s", estimated.seconds, recorded.seconds)]
    for name, load in estimated.channels.items():
        real = recorded.channels[name]
        found += [
            Measured(name, "communicates", "", load.communicates, real.communicates),
            Measured(name, "bytes", "B", load.bytes, real.bytes),
            Measured(name, "mean bandwidth", "bit/s", load.mean_bit_s, real.mean_bit_s),
            Measured(name, "busy bandwidth", "bit/s", load.busy_bit_s, real.busy_bit_s),
        ]
    real_uses = {one.use: one for one in recorded.uses}
    for one in estimated.uses:
        if one.use in real_uses and real_uses[one.use].conversations:
            found.append(
                Measured(one.use, "latency", "s", one.latency_s, real_uses[one.use].latency_s)
            )
    return tuple(found)


def recorded_as_estimate(design: Design, run: Observed) -> Estimate:
    """The figures with which an estimate would have been right; latencies are medians."""
    heard: dict[str, list[Observation]] = defaultdict(list)
    for one in run.communicates:
        if (use := use_of(design, one)) is not None:
            heard[use.name].append(one)
    spans = {name: _spans(some) for name, some in heard.items()}
    roots = (use for use in design.file.protocol if not use.within and not use.alongside)
    seconds = total(total(spans[use.name]) for use in roots if use.name in spans)
    answered = answers(design, run.communicates)
    uses = []
    for use in design.file.protocol:
        some, took_s = heard.get(use.name, []), spans.get(use.name, [])
        size = sum(one.bytes for one in some)
        took = [one.latency_s for one in answered.get(use.name, ()) if one.latency_s is not None]
        around = total(spans.get(use.within, [])) if use.within else seconds
        load = Load(len(some), size, 0.0, _rate(size, seconds), _rate(size, around))
        mean, middle = total(took_s) / (len(took_s) or 1), median(took) if took else 0.0
        times = (len(answered.get(use.name, ())), mean, middle, use.latency_s, 0.0)
        uses.append(UseEstimate(use.name, use.channel, *times, load))
    channels = {name: _channel(name, uses, seconds) for name in design.channels}
    return Estimate(seconds, channels, tuple(uses), ())


def _spans(some: Iterable[Observation]) -> list[float]:
    """The duration of each conversation, from its first message to its last [s]."""
    first: dict[str, float] = {}
    last: dict[str, float] = {}
    for one in some:
        first.setdefault(one.conversation, one.at)
        last[one.conversation] = one.at
    return [last[name] - first[name] for name in first]

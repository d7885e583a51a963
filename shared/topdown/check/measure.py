"""The figures of a recording in the words of an estimate, and how far the estimate was from them."""

from collections import defaultdict
from collections.abc import Iterable
from statistics import median

import msgspec

from topdown.check.estimate import Estimate, Load, UseEstimate, total
from topdown.check.observe import Observation, Observed, answers, use_of
from topdown.model.design import Design


class Measured(msgspec.Struct, frozen=True):
    """One figure of a channel or use: estimated, recorded, and the error as a share of what was recorded (None: nothing
    was recorded).
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
    """Every figure that both have: per channel communicates, bytes, bandwidth, per use latency, and the whole time."""
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
            found.append(Measured(one.use, "latency", "s", one.latency_s, real_uses[one.use].latency_s))
    return tuple(found)


def recorded_as_estimate(design: Design, run: Observed) -> Estimate:
    """Return the figures with which an estimate would have been right; latencies are medians."""
    heard: dict[str, list[Observation]] = defaultdict(list)
    for one in run.communicates:
        if (use := use_of(design, one)) is not None:
            heard[use.name].append(one)
    spans = {name: _spans(some) for name, some in heard.items()}
    roots = [use.name for use in design.file.protocol if not use.within and not use.alongside and use.name in spans]
    seconds = total(total(spans[name]) for name in roots)
    answered = answers(design, run.communicates)
    uses = []
    for use in design.file.protocol:
        some = heard.get(use.name, [])
        took = [one.latency_s for one in answered.get(use.name, ()) if one.latency_s is not None]
        around = total(spans.get(use.within, [])) if use.within else seconds
        uses.append(
            UseEstimate(
                use=use.name,
                channel=use.channel,
                conversations=len(answered.get(use.name, ())),
                seconds=_mean(spans.get(use.name, [])),
                latency_s=median(took) if took else 0.0,
                budget_s=use.latency_s,
                share=0.0,
                load=_load(some, seconds, around),
            )
        )
    return Estimate(seconds, {name: _sum(name, uses, seconds) for name in design.channels}, tuple(uses), ())


def _spans(some: Iterable[Observation]) -> list[float]:
    """Return the duration of each conversation, from its first message to its last [s]."""
    first: dict[str, float] = {}
    last: dict[str, float] = {}
    for one in some:
        first.setdefault(one.conversation, one.at)
        last[one.conversation] = one.at
    return [last[name] - first[name] for name in first]


def _load(some: list[Observation], seconds: float, around: float) -> Load:
    size = sum(one.bytes for one in some)
    mean, busy = (8 * size / span if span > 0 else 0.0 for span in (seconds, around))
    return Load(len(some), size, 0.0, mean, busy)


def _sum(channel: str, uses: list[UseEstimate], seconds: float) -> Load:
    loads = [one.load for one in uses if one.channel == channel]
    size = total(load.bytes for load in loads)
    mean = 8 * size / seconds if seconds > 0 else 0.0
    busy = max((load.busy_bit_s for load in loads), default=0.0)
    return Load(total(load.communicates for load in loads), size, 0.0, mean, busy)


def _mean(some: Iterable[float]) -> float:
    values = list(some)
    return total(values) / len(values) if values else 0.0

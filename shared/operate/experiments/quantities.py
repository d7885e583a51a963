"""What is measured of a run, one row each: name, kind, unit, how it is read of a Result. Pure.

All of them are better when smaller, but success, which is a share of runs and stands apart. The paper's figure stands
beside ours where the text we have prints one.
"""

from collections.abc import Callable

import msgspec

from companion.design import DESIGN
from companion.tools.report.paper import PAPER
from operate.experiments.exchanges import Said
from operate.experiments.results import Figures, Plan, Result

Value = float | int | None


class Quantity(msgspec.Struct, frozen=True):
    """`kind`: latency, energy or traffic, by which a threshold is given; `judged`: a regression of it counts."""

    name: str
    kind: str
    unit: str
    read: Callable[[Figures], Value]
    paper: float | None = None
    judged: bool = True
    digits: int = 1


def _plan(number: int, read: Callable[[Plan], Value]) -> Callable[[Figures], Value]:
    def of(figures: Figures) -> Value:
        plan = figures.plan(number)
        return None if plan is None else read(plan)

    return of


def _rate(plan: Plan) -> Value:
    """Mean bandwidth of C4 while the plan is made [kbit/s]."""
    return 8 * plan.bytes / plan.wall_s / 1000 if plan.bytes is not None and plan.wall_s else None


def _latency(use: str, part: str) -> Callable[[Figures], Value]:
    def of(figures: Figures) -> Value:
        row = next((one for one in figures.latency if one.use == use), None)
        return None if row is None or row.answer is None else getattr(row.answer, part)

    return of


def _channel(name: str, part: str) -> Callable[[Figures], Value]:
    def of(figures: Figures) -> Value:
        sizes = figures.communicates.per_channel.get(name)
        return None if sizes is None else getattr(sizes, part)

    return of


def _bytes(figures: Figures) -> Value:
    sizes = figures.communicates.per_channel.values()
    return sum(one.total for one in sizes) / 1000 if sizes else None


def _largest(figures: Figures) -> Value:
    sizes = figures.communicates.per_channel.values()
    return max((one.largest for one in sizes), default=None)


def _planning() -> tuple[Quantity, ...]:
    rows: list[Quantity] = []
    for number in (1, 2):
        theirs = PAPER.made(number)
        name = f"plan {number}"
        rows += [
            Quantity(
                f"{name}: time", "latency", "s", _plan(number, lambda p: p.wall_s), theirs.wall_s if theirs else None
            ),
            Quantity(
                f"{name}: waiting for km", "latency", "s", _plan(number, lambda p: p.km_s), judged=False, digits=2
            ),
            Quantity(
                f"{name}: communicates of C4",
                "traffic",
                "",
                _plan(number, lambda p: p.communicates),
                theirs.communicates if theirs else None,
            ),
            Quantity(
                f"{name}: mean bandwidth of C4",
                "traffic",
                "kbit/s",
                _plan(number, _rate),
                theirs.mean_kbit_s if theirs else None,
                judged=False,
            ),
        ]
    return tuple(rows)


def _answers() -> tuple[Quantity, ...]:
    uses = [use.name for use in DESIGN.file.protocol]
    return tuple(
        Quantity(f"{use}: answer, {words}", "latency", "ms", _latency(use, part), judged=part == "p50")
        for use in uses
        for part, words in (("p50", "half within"), ("p99", "99 % within"))
    )


QUANTITIES: tuple[Quantity, ...] = (
    Quantity("command to end", "latency", "s", lambda f: f.wall_time_s, PAPER.times["finished"] - 83),
    Quantity("simulated acts", "latency", "s", lambda f: f.sim_time_s),
    Quantity("energy of the body's joints", "energy", "J", lambda f: f.energy_J, digits=0),
    Quantity("communicates", "traffic", "", lambda f: f.communicates.total, PAPER.total_table),
    Quantity("communicates sent again", "traffic", "", lambda f: f.communicates.copies, judged=False),
    Quantity("all bytes", "traffic", "kB", _bytes),
    Quantity(
        "share below 0.5 kB",
        "traffic",
        "%",
        lambda f: None if f.communicates.small is None else 100 * f.communicates.small,
        100 * PAPER.small,
        judged=False,
    ),
    Quantity("largest communicate", "traffic", "B", _largest, PAPER.largest_bytes, judged=False, digits=0),
    Quantity("C4: smallest", "traffic", "B", _channel("C4", "least"), PAPER.c4_least_bytes, judged=False, digits=0),
    Quantity("C4: mean size", "traffic", "B", _channel("C4", "mean"), PAPER.c4_mean_bytes, judged=False, digits=0),
    Quantity("C4: largest", "traffic", "B", _channel("C4", "largest"), PAPER.c4_largest_bytes, judged=False, digits=0),
    *_planning(),
    *_answers(),
)
"""In the order in which they are shown."""


def values(quantity: Quantity, results: tuple[Result, ...]) -> dict[int, float]:
    """Seed -> value, by seed, of the successful runs that have it: one that broke off would pull every mean down."""
    found: dict[int, float] = {}
    for result in results:
        if result.success and result.figures is not None and result.seed is not None:
            value = quantity.read(result.figures)
            if value is not None:
                found[result.seed] = float(value)
    return dict(sorted(found.items()))


def peak_kbit_s(said: tuple[Said, ...], plan: Plan, step_s: float) -> float | None:
    """Peak bandwidth of C4 while a plan is made, in steps of so many seconds; None where it was not."""
    if plan.wall_s is None:
        return None
    bits: dict[int, float] = {}
    for one in said:
        if one.channel == "C4" and plan.t <= one.t <= plan.t + plan.wall_s:
            slot = int((one.t - plan.t) / step_s)
            bits[slot] = bits.get(slot, 0.0) + 8 * one.size
    return max(bits.values(), default=0.0) / step_s / 1000

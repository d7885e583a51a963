"""Figures of a pour that its report.json has beyond the traffic, and how plans were made. Pure."""

from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from operate.experiments.exchanges import Said
from operate.experiments.measures import Quantity, Value
from operate.experiments.run_figures import Figures


class Plan(msgspec.Struct, frozen=True):
    """The making of a plan (companion.tools.report.report.Plan)."""

    number: int
    t: float = 0.0
    wall_s: float | None = None
    queries: int | None = None
    communicates: int | None = None
    bytes: int | None = None
    km_s: float | None = None


class PourFigures(Figures, frozen=True):
    """The fields that are used of a pour's report.json, which has more."""

    poured_fraction: float | None = None
    sim_time_s: float | None = None
    wall_time_s: float | None = None
    energy_J: float | None = None
    plans: tuple[Plan, ...] = ()

    def plan(self, number: int) -> Plan | None:
        """Return the plan of this number."""
        return next((plan for plan in self.plans if plan.number == number), None)


def quantities(number: int) -> tuple[Quantity, ...]:
    """Return what is measured of the making of a plan."""
    name = f"plan {number}"
    return (
        Quantity(f"{name}: time", "latency", "s", _plan(number, lambda p: p.wall_s)),
        Quantity(f"{name}: waiting for km", "latency", "s", _plan(number, lambda p: p.km_s), judged=False, digits=2),
        Quantity(f"{name}: communicates of C4", "traffic", "", _plan(number, lambda p: p.communicates)),
        Quantity(f"{name}: mean bandwidth of C4", "traffic", "kbit/s", _plan(number, _rate), judged=False),
    )


def peak_kbit_s(said: Sequence[Said], plan: Plan, step_s: float) -> float | None:
    """Return the peak bandwidth of C4 while a plan is made, in steps of `step_s`; None where it was not made."""
    if plan.wall_s is None:
        return None
    bits = kbit_s(plan, said, step_s, int(np.ceil(plan.wall_s / step_s)) or 1)
    return float(bits.max())


def kbit_s(plan: Plan, said: Sequence[Said], step: float, bins: int) -> np.ndarray:
    """Return the bandwidth of C4 in each step [kbit/s], (bins,); 0 after the plan is there."""
    some = [one for one in said if one.channel == "C4" and plan.t <= one.t <= plan.t + (plan.wall_s or 0.0)]
    at, weights = [one.t - plan.t for one in some], [8.0 * one.size / 1000 for one in some]
    counted, _ = np.histogram(at, bins=bins, range=(0.0, bins * step), weights=weights)
    return np.asarray(counted / step)


def _plan(number: int, read: Callable[[Plan], Value]) -> Callable[[PourFigures], Value]:
    def of(figures: PourFigures) -> Value:
        plan = figures.plan(number)
        return None if plan is None else read(plan)

    return of


def _rate(plan: Plan) -> Value:
    """Mean bandwidth of C4 while the plan is made [kbit/s]."""
    return 8 * plan.bytes / plan.wall_s / 1000 if plan.bytes is not None and plan.wall_s else None

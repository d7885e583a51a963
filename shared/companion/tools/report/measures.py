"""Measures of pours, with the paper's figures beside (operate.experiments.measures).

Figures of a pour that its report.json has beyond the traffic, and how plans were made. Pure.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from companion.design import DESIGN
from companion.sentences import happened
from companion.tools.report.report import PAPER, TABLE_8
from operate.experiments import intervals
from operate.experiments.measures import (
    LARGEST,
    SMALL,
    Drawing,
    Measures,
    Published,
    Quantity,
    Row,
    Runs,
    Value,
    channel_size,
)
from operate.experiments.run_figures import Figures, SentMessage
from operate.experiments.summary import row_of
from operate.recording.history import History

if TYPE_CHECKING:
    import pyarrow


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
        Quantity(
            f"{name}: waiting for km",
            "latency",
            "s",
            _plan(number, lambda p: p.km_s),
            judged=False,
            digits=2,
        ),
        Quantity(
            f"{name}: communicates of C4", "traffic", "", _plan(number, lambda p: p.communicates)
        ),
        Quantity(
            f"{name}: mean bandwidth of C4", "traffic", "kbit/s", _plan(number, _rate), judged=False
        ),
    )


def peak_kbit_s(said: Sequence[SentMessage], plan: Plan, step_s: float) -> float | None:
    """Return the peak bandwidth of C4 while a plan is made, in steps of `step_s`; None where it was
    not made.
    """
    if plan.wall_s is None:
        return None
    bits = kbit_s(plan, said, step_s, int(np.ceil(plan.wall_s / step_s)) or 1)
    return float(bits.max())


def kbit_s(plan: Plan, said: Sequence[SentMessage], step: float, bins: int) -> np.ndarray:
    """Return the bandwidth of C4 in each step [kbit/s], (bins,); 0 after the plan is there."""
    until = plan.t + (plan.wall_s or 0.0)
    some = [one for one in said if one.channel == "C4" and plan.t <= one.t <= until]
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


# --- Figure 13 of the paper over many runs: bandwidth of C4 while a plan is made, means with 95 %
# intervals. SVG


def planning(runs: Runs, number: int) -> str:
    """Return Figure 13: bandwidth of C4 while plan `number` is made, from the request on; "" where
    no run made it.
    """
    some = _made(runs, number)
    longest = max((plan.wall_s or 0.0 for plan, _ in some), default=0.0)
    if not longest:
        return ""
    # half a second to import, and most reports draw nothing over many runs
    from operate.experiments.page import BINS, SHADE
    from operate.reports.figures import ACCENT, FAINT, INK, drawing

    step = longest / BINS
    bits = np.array([kbit_s(plan, said, step, BINS) for plan, said in some])
    middle, half = intervals.band(bits)
    edges = np.arange(BINS + 1) * step
    with drawing(
        f"all-plan{number}", 2.7, f"Bandwidth of C4 while plan {number} is made, all runs"
    ) as (axes, svg):
        band = (np.maximum(middle - half, 0.0), middle + half)
        low, high = (np.append(one, one[-1]) for one in band)
        axes.fill_between(edges, low, high, step="post", color=ACCENT, alpha=SHADE, linewidth=0)
        axes.stairs(middle, edges, color=ACCENT, linewidth=1.5)
        times = [plan.wall_s or 0.0 for plan, _ in some]
        axes.plot(times, [0.0] * len(times), "|", color=INK, markersize=9, clip_on=False, zorder=5)
        axes.set_title(_caption(number, step, len(some)), loc="left", fontsize=9, color=FAINT)
        axes.set_xlabel(f"time after the request for plan {number} [s]    |: a run's plan is there")
        axes.set_ylabel("kbit/s")
        axes.set_xlim(0, longest)
        axes.set_ylim(bottom=0)
    return svg[0]


def _made(runs: Runs, number: int) -> list[tuple[Plan, tuple[SentMessage, ...]]]:
    found = []
    for one in runs.results:
        plan = one.figures.plan(number) if one.success and one.figures else None
        if plan is not None and plan.wall_s and one.seed in runs.said:
            found.append((plan, runs.said[one.seed]))
    return found


def _caption(number: int, step: float, runs: int) -> str:
    theirs = PAPER.made(number)
    text = f"plan {number}, mean over {runs} run{'s' * (runs != 1)} in steps of {step:.2g} s"
    if theirs is None or theirs.mean_kbit_s is None or theirs.peak_kbit_s is None:
        return text
    paper = f"mean {theirs.mean_kbit_s:.0f}, peak {theirs.peak_kbit_s:.0f} kbit/s"
    return f"{text}   (paper, one run of {theirs.wall_s:.0f} s: {paper})"


# --- Measures of pours, with the paper's figures beside (operate.experiments.measures) ------------


PLANS = (1, 2)
PEAK_STEP_S = 1.0
"""The paper does not say the step of its peak; a second is what its drawing could show
(estimate).
"""
POUR = (
    Quantity(
        "in the bowl",
        "success",
        "%",
        lambda f: None if f.poured_fraction is None else 100 * f.poured_fraction,
        judged=False,
        digits=0,
    ),
    Quantity("command to end", "latency", "s", lambda f: f.wall_time_s),
    Quantity("simulated acts", "latency", "s", lambda f: f.sim_time_s),
    Quantity("energy of the body's joints", "energy", "J", lambda f: f.energy_J, digits=0),
)
C4 = tuple(
    Quantity(f"C4: {words}", "traffic", "B", channel_size("C4", part), judged=False, digits=0)
    for words, part in (("smallest", "least"), ("mean size", "mean"), ("largest", "largest"))
)


def _tables(history: History) -> "dict[str, pyarrow.Table]":
    # pyarrow: 0.4 s to import, and only an export makes tables
    from companion.tools.report import tables

    return tables.of_history(history)


def _paper() -> Published:
    """The paper's figures by the names of ours."""
    figures = {
        "command to end": PAPER.times["finished"] - PAPER.times["command-received"],
        "communicates": float(PAPER.total_table),
        SMALL: 100 * PAPER.small,
        LARGEST: float(PAPER.largest_bytes),
        "C4: smallest": float(PAPER.c4_least_bytes),
        "C4: mean size": float(PAPER.c4_mean_bytes),
        "C4: largest": float(PAPER.c4_largest_bytes),
    }
    for plan in PAPER.plan:
        figures |= {f"plan {plan.number}: time": plan.wall_s}
        figures |= {f"plan {plan.number}: communicates of C4": float(plan.communicates)}
        if plan.mean_kbit_s is not None:
            figures |= {f"plan {plan.number}: mean bandwidth of C4": plan.mean_kbit_s}
    events = {one.id: happened(one.event, one.of) for one in PAPER.time}
    return Published("paper", PAPER.source, figures, PAPER.times, events, PAPER.matrix)


def peaks(runs: Runs) -> Iterator[Row]:
    """Peak bandwidth of C4 while plans are made."""
    for number in PLANS:
        some = []
        for one in runs.results:
            plan = one.figures.plan(number) if one.success and one.figures else None
            said = runs.said.get(one.seed or 0, ())
            peak = peak_kbit_s(said, plan, PEAK_STEP_S) if plan and said else None
            some += [] if peak is None else [peak]
        theirs = PAPER.made(number)
        name = f"plan {number}: peak bandwidth of C4, in steps of {PEAK_STEP_S:g} s"
        row = row_of(name, "kbit/s", some, theirs.peak_kbit_s if theirs else None, 1)
        if row is not None:
            yield row


MEASURES = Measures(
    design=DESIGN,
    done="poured",
    agents=TABLE_8,
    figures=PourFigures,
    quantities=(*POUR, *C4, *(one for number in PLANS for one in quantities(number))),
    rows=peaks,
    told=tuple(one.name for one in POUR),
    published=_paper(),
    notes={
        "run": (
            "Energy: work of the 15 body joints, the integral of |torque × speed| that the control"
            " loop keeps."
        ),
        "events": (
            "Table 7 of the paper, which counts from the start of its run, in which a person gave"
            " the command 83 s later."
        ),
        "counts": (
            "Table 8 of the paper, one run with a longer search of its planner; what it has between"
            " ex and km goes through ta here, as its own design says."
        ),
        "sizes": "Figure 12 of the paper.",
    },
    drawings=(
        Drawing(
            "How much while planning",
            "Figure 13 of the paper: bandwidth of C4 from the request for a plan on, mean over runs"
            " with 95 % interval; a run whose plan is there counts as zero from then on.",
            lambda runs: [planning(runs, number) for number in PLANS],
        ),
    ),
    tables=_tables,
)

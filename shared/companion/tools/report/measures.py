"""Measures of pours, with the paper's figures beside (operate.experiments.measures)."""

from collections.abc import Iterator

from companion.design import DESIGN
from companion.sentences import happened
from companion.tools.report import planning_runs
from companion.tools.report.paper import PAPER, TABLE_8
from companion.tools.report.plan_figures import PourFigures, peak_kbit_s, quantities
from companion.tools.report.tables import of_history
from operate.experiments.measures import (
    LARGEST,
    SMALL,
    Drawing,
    Measures,
    Published,
    Quantity,
    Row,
    Runs,
    channel_size,
)
from operate.experiments.summary import row_of

PLANS, IN_BOWL = (1, 2), "in the bowl"
PEAK_STEP_S = 1.0
"""The paper does not say the step of its peak; a second is what its drawing could show (estimate)."""
POUR = (
    Quantity(IN_BOWL, "success", "%", lambda f: _percent(f.poured_fraction), judged=False, digits=0),
    Quantity("command to end", "latency", "s", lambda f: f.wall_time_s),
    Quantity("simulated acts", "latency", "s", lambda f: f.sim_time_s),
    Quantity("energy of the body's joints", "energy", "J", lambda f: f.energy_J, digits=0),
)
C4 = tuple(
    Quantity(f"C4: {words}", "traffic", "B", channel_size("C4", part), judged=False, digits=0)
    for words, part in (("smallest", "least"), ("mean size", "mean"), ("largest", "largest"))
)


def _percent(share: float | None) -> float | None:
    return None if share is None else 100 * share


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
        "run": "Energy: work of the 15 body joints, the integral of |torque × speed| that the control loop keeps.",
        "events": "Table 7 of the paper, which counts from the start of its run, in which a person gave the command "
        "83 s later.",
        "counts": "Table 8 of the paper, one run with a longer search of its planner; what it has between ex and km "
        "goes through ta here, as its own design says.",
        "sizes": "Figure 12 of the paper.",
    },
    drawings=(
        Drawing(
            "How much while planning",
            "Figure 13 of the paper: bandwidth of C4 from the request for a plan on, mean over runs with 95 % "
            "interval; a run whose plan is there counts as zero from then on.",
            lambda runs: [planning_runs.planning(runs, number) for number in PLANS],
        ),
    ),
    tables=of_history,
)

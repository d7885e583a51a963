"""Figure 13 of the paper over many runs: bandwidth of C4 while a plan is made, means with 95 % intervals. SVG."""

import numpy as np

from companion.tools.report.paper import PAPER
from companion.tools.report.plan_figures import Plan, kbit_s
from operate.experiments import intervals
from operate.experiments.exchanges import Said
from operate.experiments.measures import Runs
from operate.experiments.pictures import BINS, SHADE
from operate.reports.figures import ACCENT, FAINT, INK, drawing


def planning(runs: Runs, number: int) -> str:
    """Return Figure 13: bandwidth of C4 while plan `number` is made, from the request on; "" where no run made it."""
    some = _made(runs, number)
    longest = max((plan.wall_s or 0.0 for plan, _ in some), default=0.0)
    if not longest:
        return ""
    step = longest / BINS
    bits = np.array([kbit_s(plan, said, step, BINS) for plan, said in some])
    middle, half = intervals.band(bits)
    edges = np.arange(BINS + 1) * step
    with drawing(f"all-plan{number}", 2.7, f"Bandwidth of C4 while plan {number} is made, all runs") as (axes, svg):
        low, high = np.maximum(middle - half, 0.0), middle + half
        axes.fill_between(edges, _stair(low), _stair(high), step="post", color=ACCENT, alpha=SHADE, linewidth=0)
        axes.stairs(middle, edges, color=ACCENT, linewidth=1.5)
        times = [plan.wall_s or 0.0 for plan, _ in some]
        axes.plot(times, [0.0] * len(times), "|", color=INK, markersize=9, clip_on=False, zorder=5)
        axes.set_title(_words(number, step, len(some)), loc="left", fontsize=9, color=FAINT)
        axes.set_xlabel(f"time after the request for plan {number} [s]    |: a run's plan is there")
        axes.set_ylabel("kbit/s")
        axes.set_xlim(0, longest)
        axes.set_ylim(bottom=0)
    return svg[0]


def _made(runs: Runs, number: int) -> list[tuple[Plan, tuple[Said, ...]]]:
    found = []
    for one in runs.results:
        plan = one.figures.plan(number) if one.success and one.figures else None
        if plan is not None and plan.wall_s and one.seed in runs.said:
            found.append((plan, runs.said[one.seed]))
    return found


def _stair(values: np.ndarray) -> np.ndarray:
    return np.append(values, values[-1])


def _words(number: int, step: float, runs: int) -> str:
    theirs = PAPER.made(number)
    text = f"plan {number}, mean over {runs} run{'s' * (runs != 1)} in steps of {step:.2g} s"
    if theirs is None or theirs.mean_kbit_s is None or theirs.peak_kbit_s is None:
        return text
    paper = f"mean {theirs.mean_kbit_s:.0f}, peak {theirs.peak_kbit_s:.0f} kbit/s"
    return f"{text}   (paper, one run of {theirs.wall_s:.0f} s: {paper})"

"""Figures 12 and 13 of the paper over many runs, as SVG to stand inside a page: means with 95 % intervals over runs."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from companion.design import DESIGN
from companion.tools.report.paper import PAPER
from operate.experiments import intervals
from operate.experiments.exchanges import Said
from operate.experiments.results import Plan, Runs
from operate.reports.figures import ACCENT, FAINT, INK, drawing, mark_of

BINS = 40
"""Steps of time in a figure; estimate: fine enough for a shape, wide enough for some communicates of every run."""
SHADE = 0.22
POINT_DPI = 110
"""Points of all runs are one picture inside the figure: thousands of shapes would be megabytes (estimate)."""


def sizes(runs: Runs) -> str:
    """Figure 12: size of each communicate over time, all runs; the mean in steps of time. "" where nothing was said."""
    told = _told(runs)
    if not told:
        return ""
    with drawing("all-sizes", 3.9, "Size of each communicate over time, all runs, by channel") as (axes, svg):
        for channel, entry in DESIGN.channels.items():
            points = [(one.t, one.size) for said in told for one in said if one.channel == channel]
            if points:
                mark, colour = mark_of(channel, DESIGN)
                label = f"{channel} {'-'.join(entry.ends)}"
                t, size = zip(*points, strict=True)
                dots = axes.scatter(t, size, marker=mark, c=colour, s=11, alpha=0.3, linewidths=0, rasterized=True)
                dots.set_zorder(2)
                axes.scatter([], [], marker=mark, c=colour, s=15, linewidths=0, label=label)
        axes.figure.set_dpi(POINT_DPI)
        _mean_size(axes, told)
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(_in_bytes)
        axes.set_xlabel("time after the first communicate [s]")
        axes.set_ylabel("size")
        axes.margins(x=0.01)
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1.01), ncols=7, frameon=False, columnspacing=1.2)
    return svg[0]


def shares(runs: Runs) -> str:
    """How many of the communicates of a run are smaller than so many bytes, beside what the paper says of its run."""
    told = _told(runs)
    if not told:
        return ""
    edges = np.logspace(1.8, 6, 120)
    below = np.array([[np.mean([one.size < edge for one in said]) for edge in edges] for said in told])
    middle, half = intervals.band(100 * below)
    with drawing("all-shares", 2.6, "Share of communicates smaller than so many bytes") as (axes, svg):
        axes.fill_between(edges, middle - half, middle + half, color=ACCENT, alpha=SHADE, linewidth=0)
        axes.plot(edges, middle, color=ACCENT, linewidth=1.6)
        axes.plot((500,), (100 * PAPER.small,), "D", color="#d97706", markersize=6, zorder=5)
        note = {"xytext": (8, -12), "textcoords": "offset points", "color": "#d97706", "fontsize": 8}
        axes.annotate(f"paper: {100 * PAPER.small:.0f} % below 0.5 kB", (500, 100 * PAPER.small), **note)  # type: ignore[arg-type]
        axes.axvline(PAPER.largest_bytes, color="#d97706", linewidth=1, linestyle=(0, (4, 3)))
        axes.text(PAPER.largest_bytes, 8, "paper: largest ", ha="right", color="#d97706", fontsize=8)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(_in_bytes)
        axes.set_xlabel("size")
        axes.set_ylabel("smaller [%]")
        axes.set_ylim(0, 102)
    return svg[0]


def planning(runs: Runs, number: int) -> str:
    """Figure 13: bandwidth of C4 while plan `number` is made, from the request on; "" where no run made it."""
    some = _made(runs, number)
    longest = max((plan.wall_s or 0.0 for plan, _ in some), default=0.0)
    if not longest:
        return ""
    step = longest / BINS
    bits = np.array([_kbit_s(plan, said, step) for plan, said in some])
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


def _told(runs: Runs) -> list[tuple[Said, ...]]:
    """What was said in the successful runs."""
    return [runs.said[one.seed] for one in runs.results if one.success and one.seed in runs.said]


def _made(runs: Runs, number: int) -> list[tuple[Plan, tuple[Said, ...]]]:
    found = []
    for one in runs.results:
        plan = one.figures.plan(number) if one.success and one.figures else None
        if plan is not None and plan.wall_s and one.seed in runs.said:
            found.append((plan, runs.said[one.seed]))
    return found


def _mean_size(axes: Axes, told: Sequence[tuple[Said, ...]]) -> None:
    """The mean size in steps of time: each run's own mean, then over the runs that said something then."""
    until = max(one.t for said in told for one in said)
    edges = np.linspace(0.0, until, BINS + 1)
    for start, end in pairwise(edges):
        inside = [[one.size for one in said if start <= one.t < end] for said in told]
        found = intervals.mean([float(np.mean(some)) for some in inside if some])
        if found is None or found.low is None or found.high is None:
            continue
        low, high = max(found.low, 50.0), found.high
        axes.fill_between((start, end), (low, low), (high, high), color=INK, alpha=SHADE, linewidth=0, zorder=3)
        axes.plot((start, end), (found.value, found.value), color=INK, linewidth=1.3, zorder=4)
    axes.plot([], [], color=INK, linewidth=1.3, label="mean")


def _kbit_s(plan: Plan, said: Sequence[Said], step: float) -> np.ndarray:
    """Bandwidth of C4 in each step [kbit/s], (BINS,); nothing after the plan is there."""
    some = [one for one in said if one.channel == "C4" and plan.t <= one.t <= plan.t + (plan.wall_s or 0.0)]
    at, weights = [one.t - plan.t for one in some], [8.0 * one.size / 1000 for one in some]
    counted, _ = np.histogram(at, bins=BINS, range=(0.0, BINS * step), weights=weights)
    return np.asarray(counted / step)


def _stair(values: np.ndarray) -> np.ndarray:
    return np.append(values, values[-1])


def _words(number: int, step: float, runs: int) -> str:
    theirs = PAPER.made(number)
    text = f"plan {number}, mean over {runs} run{'s' * (runs != 1)} in steps of {step:.2g} s"
    if theirs is None or theirs.mean_kbit_s is None or theirs.peak_kbit_s is None:
        return text
    paper = f"mean {theirs.mean_kbit_s:.0f}, peak {theirs.peak_kbit_s:.0f} kbit/s"
    return f"{text}   (paper, one run of {theirs.wall_s:.0f} s: {paper})"


def _in_bytes(value: float, _: float) -> str:
    return f"{value:g} B" if value < 1e3 else f"{value / 1e3:g} kB" if value < 1e6 else f"{value / 1e6:g} MB"

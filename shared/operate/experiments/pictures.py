"""Sizes of communicates over many runs, as SVG to stand inside a page: means with 95 % intervals over runs."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from operate.experiments import intervals
from operate.experiments.exchanges import Said
from operate.experiments.measures import LARGEST, SMALL, Published, Runs
from operate.reports.counts import SMALL_BYTES
from operate.reports.figures import ACCENT, INK, drawing, mark_of

BINS = 40
"""Steps of time in a figure; estimate: fine enough for a shape, wide enough for some communicates of every run."""
SHADE = 0.22
THEIRS = "#d97706"
"""Colour of published figures."""
POINT_DPI = 110
"""Points of all runs are one picture inside the figure: thousands of shapes would be megabytes (estimate)."""


def sizes(runs: Runs) -> str:
    """Size of each communicate over time, all runs; the mean in steps of time. "" where nothing was said."""
    told, design = _told(runs), runs.measures.design
    if not told:
        return ""
    with drawing("all-sizes", 3.9, "Size of each communicate over time, all runs, by channel") as (axes, svg):
        for channel, entry in design.channels.items():
            points = [(one.t, one.size) for said in told for one in said if one.channel == channel]
            if points:
                mark, colour = mark_of(channel, design)
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
    """Share of the communicates of a run below each size, beside what was published."""
    told = _told(runs)
    if not told:
        return ""
    edges = np.logspace(1.8, 6, 120)
    below = np.array([[np.mean([one.size < edge for one in said]) for edge in edges] for said in told])
    middle, half = intervals.band(100 * below)
    with drawing("all-shares", 2.6, "Share of communicates below each size") as (axes, svg):
        axes.fill_between(edges, middle - half, middle + half, color=ACCENT, alpha=SHADE, linewidth=0)
        axes.plot(edges, middle, color=ACCENT, linewidth=1.6)
        _published(axes, runs.measures.published)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(_in_bytes)
        axes.set_xlabel("size")
        axes.set_ylabel("smaller [%]")
        axes.set_ylim(0, 102)
    return svg[0]


def _published(axes: Axes, published: Published) -> None:
    """Mark somebody else's share below 500 bytes and largest communicate."""
    small, largest = published.figures.get(SMALL), published.figures.get(LARGEST)
    if small is not None:
        axes.plot((SMALL_BYTES,), (small,), "D", color=THEIRS, markersize=6, zorder=5)
        note = {"xytext": (8, -12), "textcoords": "offset points", "color": THEIRS, "fontsize": 8}
        axes.annotate(f"{published.by}: {small:.0f} % below 0.5 kB", (SMALL_BYTES, small), **note)  # type: ignore[arg-type]
    if largest is not None:
        axes.axvline(largest, color=THEIRS, linewidth=1, linestyle=(0, (4, 3)))
        axes.text(largest, 8, f"{published.by}: largest ", ha="right", color=THEIRS, fontsize=8)


def _told(runs: Runs) -> list[tuple[Said, ...]]:
    """Return the traffic of the successful runs."""
    return [runs.said[one.seed] for one in runs.results if one.success and one.seed in runs.said]


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


def _in_bytes(value: float, _: float) -> str:
    return f"{value:g} B" if value < 1e3 else f"{value / 1e3:g} kB" if value < 1e6 else f"{value / 1e6:g} MB"

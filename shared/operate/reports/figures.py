"""The report's figures, as SVG to stand inside a page: sizes (the paper's Figure 12), bandwidth
(13), latencies.

Light ground, one accent for what a figure is about, grey for the rest, channels told apart by
colour and mark.
"""

import io
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from operate.recording.history import History
from operate.reports.counts import Latency
from topdown.model.design import Design

ACCENT, INK, FAINT, GRID = "#0e7490", "#1f2937", "#6b7280", "#e5e7eb"
BAND, FAULT = "#ecfeff", "#fca5a5"
SHORTEST = 0.003
"""Width of a bar of no length, as a share of the axis; estimate: it is seen."""
MARKS = (
    ("s", "#d97706"),
    ("D", "#be185d"),
    ("^", "#6d28d9"),
    ("o", ACCENT),
    ("v", "#475569"),
    ("P", "#15803d"),
)
"""Of channels, in the order of the design; a seventh one looks like the first."""
CROWDED = 1 / 3
"""A channel with more than this share of all communicates is drawn half transparent; estimate."""
WIDTH_IN = 9.2
LETTER = 0.012
"""Width of a letter in a bar, as a share of the axis; estimate, on the safe side."""
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "svg.fonttype": "path",
}


def mark_of(channel: str, design: Design) -> tuple[str, str]:
    """Return the mark of a channel and its colour."""
    return MARKS[list(design.channels).index(channel) % len(MARKS)]


def sizes(
    history: History, design: Design, stretches: Iterable[tuple[float, float, str]] = ()
) -> str:
    """Size of each communicate over time, a mark per channel; "" without communicates.

    `stretches`: shaded, each with its begin, its end [s after the first communicate] and its name.
    """
    if not history.said:
        return ""
    with drawing("sizes", 3.6, "Size of each communicate over time, by channel") as (axes, svg):
        for start, end, name in stretches:
            axes.axvspan(start, end, color=BAND, zorder=0, linewidth=0)
            place = axes.get_xaxis_transform()
            axes.text(start, 0.985, f" {name}", transform=place, va="top", color=ACCENT, fontsize=8)
        dots = [(one.channel, one.received - history.begin, one.size) for one in history.said]
        sizes_over_time(axes, dots, design)
        axes.yaxis.set_minor_formatter(NullFormatter())
        above(axes, 6)
    return svg[0]


def sizes_over_time(
    axes: Axes, dots: Iterable[tuple[str, float, int]], design: Design, alpha: float = 0.0
) -> None:
    """Draw (channel, time [s], size [bytes]), a mark per channel. `alpha`: of every dot; 0: of the
    dots of a channel by how crowded it is.
    """
    some = list(dots)
    for channel, entry in design.channels.items():
        said = [(at, size) for name, at, size in some if name == channel]
        if said:
            mark, colour = mark_of(channel, design)
            at, size = zip(*said, strict=True)
            axes.scatter(
                at,
                size,
                marker=mark,
                c=colour,
                s=15,
                alpha=alpha or (0.5 if len(said) > CROWDED * len(some) else 0.9),
                linewidths=0,
                zorder=2 if alpha else 3,
                rasterized=bool(alpha),  # dots of many runs
            )
            label = f"{channel} {'-'.join(entry.ends)}"
            axes.scatter([], [], marker=mark, c=colour, s=15, linewidths=0, label=label)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(in_bytes)
    axes.set_ylabel("size")
    _over_time(axes)


def above(axes: Axes, columns: int) -> None:
    """Put the legend above the axes, in so many columns."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1.01),
        ncols=columns,
        frameon=False,
        handletextpad=0.1,
        columnspacing=1.3,
    )


def _over_time(axes: Axes) -> None:
    axes.set_xlabel("time after the first communicate [s]")
    axes.margins(x=0.01)


def latencies(rows: tuple[Latency, ...]) -> str:
    """From an opening to its first answer: half, most, the longest, and what the design allows. ""
    without any.
    """
    answered = [row for row in rows if row.answer is not None]
    if not answered:
        return ""
    lanes = [f"{row.channel}  {row.use}" for row in answered]
    with _laned("latency", lanes, "Time to the first answer, by protocol") as (axes, svg):
        for y, row in enumerate(reversed(answered)):
            spans = row.answer
            assert spans is not None
            line: dict[str, Any] = {"color": "#94a3b8", "linewidth": 2, "zorder": 2}
            axes.plot((spans.p50, spans.max), (y, y), solid_capstyle="round", **line)
            axes.plot((spans.most[1],), (y,), "|", color=FAINT, markersize=9, zorder=3)
            axes.plot((spans.p50,), (y,), "o", color=ACCENT, markersize=6, zorder=4)
            axes.plot((row.budget_ms,), (y,), marker=9, color="#d97706", markersize=7, zorder=3)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(
            lambda value, _: f"{value / 1000:g} s" if value >= 1000 else f"{value:g} ms"
        )
        key = "dot: half of them    |: most    line: to the longest    ▶: what the design allows"
        axes.set_title(key, loc="left", fontsize=9, color=FAINT)
    return svg[0]


def busy(stretches: Iterable[tuple[str, str, float, float]], design: Design) -> str:
    """States of the agents over time: (agent, state, start, end [s]); "" without any."""
    found = [one for one in stretches if one[0] in design.agents]
    if not found:
        return ""
    lanes, last = list(design.agents), max(one[3] for one in found)
    with _laned("busy", lanes, "The state of each agent over time") as (axes, svg):
        for agent, state, start, end in found:
            names = [one.name for one in design.agents[agent].state]
            rests = state in (design.agents[agent].rest or (design.agents[agent].initial,))
            colour = (
                GRID if rests or state not in names else MARKS[names.index(state) % len(MARKS)][1]
            )
            lane = lanes[::-1].index(agent)
            axes.barh(lane, max(end - start, 0.0), 0.62, left=start, color=colour, zorder=3)
            if end - start > LETTER * len(state) * last:
                ink = INK if rests else "white"
                there: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 4}
                axes.text((start + end) / 2, lane, state, color=ink, fontsize=7, **there)
        _over_time(axes)
    return svg[0]


def faults(stretches: Iterable[tuple[str, str, float, float]], end: float) -> str:
    """Faults over time, a lane for each process: (process, fault, start, end [s]), or ""; `end`: of
    the run.
    """
    found = list(stretches)
    if not found:
        return ""
    lanes = list(dict.fromkeys(one[0] for one in found))
    text = "Faults done on purpose over time, by process"
    with _laned("faults", lanes, text) as (axes, svg):
        for target, kind, start, until in found:
            lane, long = lanes[::-1].index(target), max(until - start, SHORTEST * end)
            axes.barh(lane, long, 0.62, left=start, color=FAULT, zorder=3)
            axes.text(start, lane, f" {kind}", ha="left", va="center", fontsize=7, zorder=4)
        _over_time(axes)
        axes.set_xlim(-0.01 * end, 1.01 * end)
    return svg[0]


@contextmanager
def _laned(name: str, lanes: list[str], text: str) -> Iterator[tuple[Axes, list[str]]]:
    """A drawing with a lane for each name, the first one at the top."""
    with drawing(name, 0.8 + 0.36 * len(lanes), text) as (axes, svg):
        yield axes, svg
        axes.set_yticks(range(len(lanes)), lanes[::-1])
        axes.set_ylim(-0.6, len(lanes) - 0.4)
        axes.grid(visible=False, axis="y")


@contextmanager
def drawing(name: str, height_in: float, text: str) -> Iterator[tuple[Axes, list[str]]]:
    """A figure with one pair of axes; when the block ends, the list holds its SVG. `text`: what it
    shows, in words.
    """
    svg: list[str] = []
    style: Any = {**STYLE, "svg.hashsalt": name}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
        axes = figure.add_subplot()
        yield axes, svg
        buffer = io.StringIO()
        undated = {"Date": None, "Creator": None}
        figure.savefig(buffer, format="svg", transparent=True, metadata=undated)
    svg.append(_inline(buffer.getvalue(), name, text))


def _inline(svg: str, name: str, text: str) -> str:
    """Without the XML head, as wide as its place, with ids that no other figure of the page has."""
    body = svg[svg.index("<svg") :]
    body = re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{name}-", body)
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    sized = r'<svg ([^>]*?)height="[^"]*"([^>]*?)width="[^"]*"'
    return re.sub(sized, rf'<svg role="img" aria-label="{text}" \1\2', body, count=1)


def in_bytes(value: float, _: float) -> str:
    """A tick of an axis of sizes."""
    step, unit = next((one for one in ((1e6, "MB"), (1e3, "kB")) if value >= one[0]), (1.0, "B"))
    return f"{value / step:g} {unit}"

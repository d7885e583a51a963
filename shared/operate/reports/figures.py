"""The report's figures, as SVG to stand inside a page: sizes (the paper's Figure 12), bandwidth (13), latencies.

Light ground, one accent for what a figure is about, grey for the rest, channels told apart by colour and mark.
"""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.design import DESIGN
from companion.tools.report.paper import PAPER
from companion.tools.report.plans import Made
from operate.recording.history import History
from operate.reports.counts import Latency, bandwidth
from operate.reports.report import Plan, Report

ACCENT, INK, FAINT, GRID = "#0e7490", "#1f2937", "#6b7280", "#e5e7eb"
BAND = "#ecfeff"
MARKS = {
    "C1": ("s", "#d97706"),
    "C2": ("D", "#be185d"),
    "C3": ("^", "#6d28d9"),
    "C4": ("o", ACCENT),
    "C5": ("v", "#475569"),
    "C6": ("P", "#15803d"),
}
WIDTH_IN = 9.2
BINS = 48
"""Bars of a bandwidth figure; estimate: fine enough for a peak, coarse enough to be read."""
LONG_WAIT = 0.15
"""Share of the planning time; estimate: room for the words that say so."""
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


def sizes(history: History, report: Report) -> str:
    """Size of each communicate over time, a mark per channel; planning is shaded. "" without communicates."""
    if not history.said:
        return ""
    with drawing("sizes", 3.6, "Size of each communicate over time, by channel") as (axes, svg):
        _shade(axes, report.plans)
        for channel, ends in ((c, "-".join(entry.ends)) for c, entry in DESIGN.channels.items()):
            said = [one for one in history.said if one.channel == channel]
            if said:
                mark, colour = MARKS.get(channel, ("o", FAINT))
                at = [one.received - history.begin for one in said]
                axes.scatter(
                    at,
                    [o.size for o in said],
                    marker=mark,
                    c=colour,
                    label=f"{channel} {ends}",
                    s=15,
                    alpha=0.5 if channel == "C4" else 0.9,
                    linewidths=0,
                    zorder=3,
                )
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(_in_bytes)
        axes.set_xlabel("time after the first communicate [s]")
        axes.set_ylabel("size")
        axes.margins(x=0.01)
        axes.legend(
            loc="lower left", bbox_to_anchor=(0, 1.01), ncols=6, frameon=False, handletextpad=0.1, columnspacing=1.4
        )
    return svg[0]


def planning(history: History, plan: Plan, made: Made) -> str:
    """Bandwidth of C4 while a plan is made; "" where nothing was said on it or the plan never came."""
    said = [one for one in history.said if one.channel == "C4"]
    if plan.wall_s is None or not plan.communicates:
        return ""
    start, step = history.begin + plan.t, _step(plan.wall_s)
    edges, bits = bandwidth(said, start, start + plan.wall_s, step)
    kilobits, mean = bits / 1000, 8 * plan.bytes / plan.wall_s / 1000
    with drawing(f"plan{plan.number}", 2.5, f"Bandwidth of C4 while plan {plan.number} is made") as (axes, svg):
        axes.stairs(kilobits, edges, fill=True, color=ACCENT, alpha=0.85, zorder=3)
        axes.axhline(mean, color=INK, linewidth=1, linestyle=(0, (4, 3)), zorder=4)
        _waits(axes, made, start, plan.wall_s)
        label = f"plan {plan.number}, in steps of {step:g} s: mean {_kilobits(mean)}, peak {_kilobits(kilobits.max())}"
        axes.set_title(f"{label}{_theirs(plan.number)}", loc="left", fontsize=9, color=FAINT)
        axes.set_xlabel(f"time after the request for plan {plan.number} [s]")
        axes.set_ylabel("kbit/s")
        axes.set_xlim(0, plan.wall_s)
        axes.set_ylim(bottom=0)
    return svg[0]


def _step(wall_s: float) -> float:
    """A round width of bars, so that there are not more than BINS."""
    return next((step for step in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0) if wall_s / step <= BINS), wall_s / BINS)


def _waits(axes: Axes, made: Made, start: float, wall_s: float) -> None:
    """Shade where pl waits for one answer of km for longer than can be overlooked."""
    for asked, answered in made.waits:
        if answered - asked > LONG_WAIT * wall_s:
            axes.axvspan(asked - start, answered - start, color=BAND, zorder=0, linewidth=0)
            text = f"one answer of km takes {answered - asked:.1f} s"
            middle = (asked + answered) / 2 - start
            axes.text(
                middle, 0.9, text, transform=axes.get_xaxis_transform(), ha="center", va="top", color=ACCENT, fontsize=8
            )


def latencies(rows: tuple[Latency, ...]) -> str:
    """From an opening to its first answer: half, 99 %, the longest, and what the design allows. "" without any."""
    answered = [row for row in rows if row.answer is not None]
    if not answered:
        return ""
    with drawing("latency", 0.8 + 0.36 * len(answered), "Time to the first answer, by protocol") as (axes, svg):
        for y, row in enumerate(reversed(answered)):
            spans = row.answer
            assert spans is not None
            axes.plot((spans.p50, spans.max), (y, y), color="#94a3b8", linewidth=2, zorder=2, solid_capstyle="round")
            axes.plot((spans.p99,), (y,), "|", color=FAINT, markersize=9, zorder=3)
            axes.plot((spans.p50,), (y,), "o", color=ACCENT, markersize=6, zorder=4)
            axes.plot((row.budget_ms,), (y,), marker=9, color="#d97706", markersize=7, zorder=3)
        axes.set_yticks(range(len(answered)), [f"{row.channel}  {row.use}" for row in reversed(answered)])
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(_in_ms)
        axes.set_ylim(-0.6, len(answered) - 0.4)
        axes.grid(visible=False, axis="y")
        axes.set_title(
            "dot: half of them    |: 99 %    line: to the longest    ▶: what the design allows",
            loc="left",
            fontsize=9,
            color=FAINT,
        )
    return svg[0]


@contextmanager
def drawing(name: str, height_in: float, text: str) -> Iterator[tuple[Axes, list[str]]]:
    """A figure with one pair of axes; when the block ends, the list holds its SVG. `text`: what it shows, in words."""
    svg: list[str] = []
    style: Any = {**STYLE, "svg.hashsalt": name}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
        axes = figure.add_subplot()
        yield axes, svg
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg.append(_inline(buffer.getvalue(), name, text))


def _inline(svg: str, name: str, text: str) -> str:
    """Without the XML head, as wide as its place, with ids that no other figure of the page has."""
    body = svg[svg.index("<svg") :]
    body = re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{name}-", body)
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    return re.sub(
        r'<svg ([^>]*?)height="[^"]*"([^>]*?)width="[^"]*"', rf'<svg role="img" aria-label="{text}" \1\2', body, count=1
    )


def _shade(axes: Axes, plans: tuple[Plan, ...]) -> None:
    for plan in plans:
        if plan.wall_s is not None:
            axes.axvspan(plan.t, plan.t + plan.wall_s, color=BAND, zorder=0, linewidth=0)
            axes.text(
                plan.t,
                0.985,
                f" plan {plan.number}",
                transform=axes.get_xaxis_transform(),
                va="top",
                color=ACCENT,
                fontsize=8,
            )


def _theirs(number: int) -> str:
    plan = PAPER.made(number)
    if plan is None or plan.mean_kbit_s is None or plan.peak_kbit_s is None:
        return ""
    return f"   (paper: mean {plan.mean_kbit_s:.0f}, peak {plan.peak_kbit_s:.0f} kbit/s)"


def _kilobits(value: float) -> str:
    return f"{value:,.0f} kbit/s".replace(",", " ")


def _in_bytes(value: float, _: float) -> str:
    return f"{value:g} B" if value < 1e3 else f"{value / 1e3:g} kB" if value < 1e6 else f"{value / 1e6:g} MB"


def _in_ms(value: float, _: float) -> str:
    return f"{value / 1000:g} s" if value >= 1000 else f"{value:g} ms"

"""report.html: one file that needs nothing else - verdict, the paper's tables beside ours, figures,
what is missing.
"""

import base64
from datetime import datetime
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from companion.design import DESIGN
from companion.sentences import happened
from companion.tools import telemetry
from companion.tools.beliefs import MOST_APART_MM
from companion.tools.report import plans, story
from companion.tools.report.paper import PAPER, TABLE_8, Paper
from companion.tools.report.plans import Made
from companion.tools.report.report import Plan, Report
from operate.recording.history import History
from operate.reports import figures
from operate.reports.counts import bandwidth
from operate.reports.figures import ACCENT, BAND, FAINT, INK, drawing
from operate.reports.page import ABSENT, STYLE, faults, heat, judged, latencies, template

# --- The figure of a plan that is made: bandwidth of C4 meanwhile (the paper's Figure 13) ---------


BINS = 48
"""Bars of a bandwidth figure; estimate: fine enough for a peak, coarse enough to be read."""
LONG_WAIT = 0.15
"""Share of the planning time; estimate: room for the words that say so."""


def planning(history: History, plan: Plan, made: Made) -> str:
    """Bandwidth of C4 while a plan is made; "" where nothing was said on it or the plan never
    came.
    """
    said = [one for one in history.said if one.channel == "C4"]
    if plan.wall_s is None or not plan.communicates:
        return ""
    start, step = history.begin + plan.t, _step(plan.wall_s)
    edges, bits = bandwidth(said, start, start + plan.wall_s, step)
    kilobits, mean = bits / 1000, 8 * plan.bytes / plan.wall_s / 1000
    with drawing(
        f"plan{plan.number}", 2.5, f"Bandwidth of C4 while plan {plan.number} is made"
    ) as (axes, svg):
        axes.stairs(kilobits, edges, fill=True, color=ACCENT, alpha=0.85, zorder=3)
        axes.axhline(mean, color=INK, linewidth=1, linestyle=(0, (4, 3)), zorder=4)
        _waits(axes, made, start, plan.wall_s)
        peak = f"{_kilobits(mean)}, peak {_kilobits(kilobits.max())}"
        label = f"plan {plan.number}, in steps of {step:g} s: mean {peak}"
        axes.set_title(f"{label}{_theirs(plan.number)}", loc="left", fontsize=9, color=FAINT)
        axes.set_xlabel(f"time after the request for plan {plan.number} [s]")
        axes.set_ylabel("kbit/s")
        axes.set_xlim(0, plan.wall_s)
        axes.set_ylim(bottom=0)
    return svg[0]


def _step(wall_s: float) -> float:
    """A round width of bars, so that there are not more than BINS."""
    return next(
        (step for step in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0) if wall_s / step <= BINS),
        wall_s / BINS,
    )


def _waits(axes: Axes, made: Made, start: float, wall_s: float) -> None:
    """Shade where pl waits for one answer of km for longer than can be overlooked."""
    for asked, answered in made.waits:
        if answered - asked > LONG_WAIT * wall_s:
            axes.axvspan(asked - start, answered - start, color=BAND, zorder=0, linewidth=0)
            text = f"one answer of km takes {answered - asked:.1f} s"
            middle = (asked + answered) / 2 - start
            look: dict[str, Any] = {"color": ACCENT, "fontsize": 8, "ha": "center", "va": "top"}
            axes.text(middle, 0.9, text, transform=axes.get_xaxis_transform(), **look)


def _theirs(number: int) -> str:
    plan = PAPER.made(number)
    if plan is None or plan.mean_kbit_s is None or plan.peak_kbit_s is None:
        return ""
    return f"   (paper: mean {plan.mean_kbit_s:.0f}, peak {plan.peak_kbit_s:.0f} kbit/s)"


def _kilobits(value: float) -> str:
    return f"{value:,.0f} kbit/s".replace(",", " ")


# --- report.html ----------------------------------------------------------------------------------


TEMPLATE = Path(__file__).with_name("page.html.j2")


def rendered(history: History, report: Report, run: str, paper: Paper = PAPER) -> str:
    """The page of a run."""
    return template(TEMPLATE).render(
        run=run,
        began=(
            datetime.fromtimestamp(report.began).strftime("%Y-%m-%d %H:%M:%S")
            if report.began
            else ABSENT
        ),
        report=report,
        paper=paper,
        times=_times(report, paper),
        agents=TABLE_8,
        channels={name: "-".join(channel.ends) for name, channel in DESIGN.channels.items()},
        story=story.story(history),
        legend=story.LEGEND,
        room=_room(history),
        sizes=figures.sizes(history, DESIGN, _planned(report)),
        plans=[
            (plan, paper.made(plan.number), planning(history, plan, made))
            for plan, made in zip(report.plans, plans.made(history), strict=True)
        ],
        latencies=latencies(report.latency),
        heat=heat(report.communicates),
        style=STYLE,
        theirs_received={a: sum(row.get(a, 0) for row in paper.matrix.values()) for a in TABLE_8},
        faults=faults(report.faults, history),
        houses=history.houses,
        judged=judged(report.judged),
        most_apart_mm=MOST_APART_MM,
    )


def _room(history: History) -> str:
    """Return the last picture of the robot in its room, a JPEG file in base64; "" without any."""
    rooms = [picture.room for _, picture in telemetry.pictures(history) if picture.room]
    return base64.b64encode(rooms[-1]).decode() if rooms else ""


Row = tuple[float | None, float | None, str, str, str, float | None]


def _times(report: Report, paper: Paper) -> list[Row]:
    """Rows of Table 7: ours, simulated, event, why, channels, the paper's; its rows that we lack
    stay, empty.
    """
    rows: list[Row] = [
        (
            event.t,
            event.sim_s,
            event.words,
            event.text,
            ", ".join(event.channels),
            paper.times.get(event.id),
        )
        for event in report.events
    ]
    ours = {event.id for event in report.events}
    lacking = (one for one in paper.time if one.id not in ours)
    return [*rows, *((None, None, happened(one.event, one.of), "", "", one.t) for one in lacking)]


def _planned(report: Report) -> list[tuple[float, float, str]]:
    """Stretches in which a plan was made."""
    made = [(plan, plan.wall_s) for plan in report.plans if plan.wall_s is not None]
    return [(plan.t, plan.t + wall_s, f"plan {plan.number}") for plan, wall_s in made]

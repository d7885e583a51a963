"""report.html: one file that needs nothing else - verdict, the paper's tables beside ours, figures,
what is missing.

Its first figure, the story, shows who was busy when, in wall time, as everything that is compared
with the paper's Table 7.
"""

import base64
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import msgspec
from matplotlib.axes import Axes

from companion.acts import SHOWN
from companion.design import DESIGN
from companion.languages import cmd, hfsm, rc, sw
from companion.sentences import Reader, happened, spaced, step
from companion.telemetry import Picture
from companion.tools.report import plans
from companion.tools.report.believed import MOST_APART_MM
from companion.tools.report.plans import (
    REFUSED,
    ActRecord,
    Made,
    acts,
    asked,
    commands,
    made,
    outcome,
    ran,
    task_end,
)
from companion.tools.report.report import PAPER, TABLE_8, Paper, Plan, Report
from companion.tools.telemetry import backwards
from operate.recording.history import History
from operate.reports import figures
from operate.reports.counts import bandwidth
from operate.reports.figures import ACCENT, BAND, FAINT, INK, WIDTH_IN, drawing
from operate.reports.page import ABSENT, STYLE, faults, heat, judged, latencies, template

LANES = ("person, hi", "co, pl", "km", "ta", "ex: left hand", "ex: right hand", "ex: head")
PLAN, FAILED = "#4338ca", "#b91c1c"
PALE, STEP = "#e2e8f0", "#bae6fd"
LEGEND = (
    ("task", ACCENT),
    ("a plan is made", PLAN),
    ("ta's step", STEP),
    ("ex works out how", PALE),
    *((row.word, row.colour) for act, row in SHOWN.items() if act is not rc.Home),
    ("failed", FAILED),
)
"""Meaning of each colour of the figure; going home looks as any move does."""
LETTER_IN = 0.068
"""Width of a letter at the size of the bars' texts; estimate, on the safe side."""
PLOT_IN = WIDTH_IN - 1.4


class Bar(msgspec.Struct, frozen=True):
    """A stretch of time in a lane; texts in order of length, the longest that fits is written."""

    lane: str
    start: float
    end: float
    colour: str
    texts: tuple[str, ...] = ()
    ink: str = "white"


def story(history: History) -> str:
    """The figure as SVG; "" where nothing was said."""
    if not history.said:
        return ""
    found = list(bars(history))
    last = max((bar.end for bar in found), default=history.said[-1].received)
    until = last - history.begin or 1.0
    with drawing("story", 2.9, "Who was busy when") as (axes, svg):
        for bar in found:
            _draw(axes, bar, history.begin, until)
        _ticks(axes, history)
        axes.set_yticks(range(len(LANES)), LANES)
        axes.set_ylim(len(LANES) - 0.4, -0.6)
        axes.set_xlim(-0.005 * until, 1.005 * until)
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("time after the first communicate [s]")
    return svg[0]


def bars(history: History) -> Iterator[Bar]:
    """Yield what stands in the lanes, but for km's."""
    free = history.begin
    for command in commands(history):  # one that waits for another one begins where that ends
        end = task_end(history, command)
        if outcome(end) == REFUSED:
            continue  # it took no time of anybody; the table of events has it
        until = end.received if end is not None else history.said[-1].received
        state = outcome(end) or "not ended"
        colour = ACCENT if state == cmd.TaskState.DONE else FAILED
        texts = (f"{asked(command)}: {state}", state)
        yield Bar(LANES[0], max(free, command.received), until, colour, texts)
        free = max(free, until)
    for plan in made(history):
        until = plan.end if plan.end is not None else history.said[-1].received
        name = f"plan {plan.number}"
        yield Bar(LANES[1], plan.start, until, PLAN, (f"making {name}", name))
    yield from steps(history)
    yield from _acts(history)


def steps(history: History) -> Iterator[Bar]:
    """ta's way through the machines of its plans."""
    for plan in ran(history):
        until = plan.end if plan.end is not None else history.said[-1].received
        told = history.conversation(plan.conversation)
        of_ta = ((one.received, one.content) for one in told if isinstance(one.content, sw.Report))
        reports = [(t, report.at) for t, report in of_ta if report.at]
        starts = [
            one
            for n, one in enumerate(reports)
            if n == 0 or reports[n - 1][1].path[0] != one[1].path[0]
        ]
        ends = [*(at for at, _ in starts[1:]), until]
        for (at, place), end in zip(starts, ends, strict=True):
            yield Bar("ta", at, end, STEP, _texts(place), INK)


def _texts(place: hfsm.Place) -> tuple[str, ...]:
    """Return what ta does in words, and shorter; the end of a plan is no step."""
    if place.step is None:
        return ()
    return (step(place.step, Reader.OPERATOR), place.step.does.replace("-", " "))


def _acts(history: History) -> Iterator[Bar]:
    for act in acts(history):
        side = getattr(act.command, "side", None)
        lane = f"ex: {side} hand" if side else "ex: head"
        row = SHOWN.get(type(act.command))
        moving = act.agreed or act.end or act.start
        yield Bar(lane, act.start, moving, PALE)
        if act.end is not None:
            colour = FAILED if not act.done else row.colour if row else FAINT
            yield Bar(lane, moving, act.end, colour, (word_of(act),))


def word_of(act: ActRecord) -> str:
    """Return the kind of an act in a word."""
    row = SHOWN.get(type(act.command))
    return row.word if row else spaced(type(act.command).__name__)


def _draw(axes: Axes, bar: Bar, begin: float, until: float) -> None:
    lane, long = LANES.index(bar.lane), bar.end - bar.start
    edge: dict[str, Any] = {"edgecolor": "white", "linewidth": 0.8, "zorder": 3}
    axes.barh(lane, long, left=bar.start - begin, height=0.66, color=bar.colour, **edge)
    room = long / until * PLOT_IN
    text = next((text for text in bar.texts if len(text) * LETTER_IN < room), "")
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 7.5, "zorder": 4}
    axes.text(bar.start - begin + long / 2, lane, text, color=bar.ink, **look)


def _ticks(axes: Axes, history: History) -> None:
    """Draw the messages to and from km, a line each."""
    of_km = (one for one in history.said if "km" in (one.sender, one.receiver))
    told = [one.received - history.begin for one in of_km]
    lane = LANES.index("km")
    axes.vlines(told, lane - 0.33, lane + 0.33, color=ACCENT, linewidth=0.5, alpha=0.5, zorder=3)


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
    for query, answer in made.waits:
        if answer - query > LONG_WAIT * wall_s:
            axes.axvspan(query - start, answer - start, color=BAND, zorder=0, linewidth=0)
            text = f"one answer of km takes {answer - query:.1f} s"
            middle = (query + answer) / 2 - start
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
        story=story(history),
        legend=LEGEND,
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
    rooms = (picture.room for _, picture in backwards(history, Picture) if picture.room)
    return base64.b64encode(next(rooms, b"")).decode()


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

"""The report's first figure: who was busy when - the task, the plans, km's answers, ta's steps,
each hand and the head.

Wall time, as everything that is compared with the paper's Table 7.
"""

from collections.abc import Iterator
from typing import Any

import msgspec
from matplotlib.axes import Axes

from companion.languages import cmd, hfsm, rc, sw
from companion.sentences import Reader, spaced, step
from companion.tools.report.plans import (
    REFUSED,
    Act,
    acts,
    asked,
    commands,
    made,
    outcome,
    ran,
    task_end,
)
from companion.tools.shown import SHOWN
from operate.recording.history import History
from operate.reports.figures import ACCENT, FAINT, INK, WIDTH_IN, drawing

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
        told = (one for one in history.said if one.conversation == plan.conversation)
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


def word_of(act: Act) -> str:
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

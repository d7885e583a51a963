"""Everything that is drawn, fed with events; the same live and from a recording.

Traffic: log, sizes (the paper's Figure 12), bandwidth (Figure 13),
graph, sequence diagram; states of agents; all of them together.
"""

import math
from collections import defaultdict, deque
from collections.abc import Iterable
from typing import Any, Protocol

import rerun as rr

from operate.fault_lines import Fault
from operate.pictures.sheet import (
    FRESH,
    GREY,
    ORANGE,
    RED,
    Colour,
    Sheet,
    between,
    channel,
    flat_arrows,
    log_lines,
    nodes,
    scalars,
    states,
)
from operate.recording.happenings import Happening, Lost
from operate.recording.history import Entered
from operate.recording.records import Spoken
from operate.system import System
from operate.verdict_lines import LEVELS, Judged
from topdown.judge.verdicts import Verdict
from topdown.model.design import Design

# --- Traffic --------------------------------------------------------------------------------------


BIN_S = 0.25
"""Of the bandwidth over time; estimate: some ten queries of a search."""
OTHER = "other"


class Log:
    """A line for each verdict about a communicate."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet, self._channels = sheet, design.channels

    def take(self, happening: Happening) -> None:
        """Write the line."""
        match happening.what:
            case Judged() as one:
                level = LEVELS.get(Verdict(one.verdict), "ERROR")
                text = f"  {one.text}" if one.text else ""
                said = f"{one.sender} > {one.receiver}  {one.performative}{text}  ({one.bytes} B)"
                what = said if one.sender else one.key
                why = (
                    f"  {one.verdict.upper()}: {one.why}" if level not in ("INFO", "DEBUG") else ""
                )
                self._add(happening.at, one.channel, what + why, level)
            case Lost(samples=count):
                text = f"drawing is too slow: {count} samples not shown (they are recorded)"
                self._add(happening.at, "", text, "WARN")

    def _add(self, at: float, name: str, text: str, level: str) -> None:
        colours: dict[str, Colour] = {"ERROR": RED, "WARN": ORANGE, "DEBUG": GREY}
        where = name if name in self._channels else OTHER
        self._sheet.add(
            f"communicates/{where}", log_lines, at, (text, level, colours.get(level, channel(name)))
        )


class Sizes:
    """A point for each communicate."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet = sheet
        for name in design.channels:
            look = rr.SeriesPoints(
                colors=[channel(name)], names=[name], markers=["circle"], marker_sizes=[2.5]
            )
            sheet.static(f"sizes/{name}", look)

    def take(self, happening: Happening) -> None:
        """Draw the point."""
        one = happening.what
        if isinstance(one, Spoken):
            self._sheet.add(
                f"sizes/{one.channel}", scalars, happening.at, (math.log10(max(one.size, 1)),)
            )


class Bins:
    """Counts by channel in bins of BIN_S; `close` hands out each bin that is over, empty ones
    too.
    """

    def __init__(self) -> None:
        self._number: int | None = None
        self._sums: defaultdict[str, float] = defaultdict(float)

    def close(self, at: float) -> list[tuple[float, dict[str, float]]]:
        """Bins that ended before `at` [unix s]: (start, channel -> sum). Long silence is two empty
        bins, not all.
        """
        number = int(at / BIN_S)
        if self._number is None:
            self._number = number
        if number <= self._number:
            return []
        done = [(self._number * BIN_S, dict(self._sums))]
        self._sums.clear()
        between = range(self._number + 1, number)
        done += [
            (k * BIN_S, {})
            for k in (between if len(between) < 16 else (*between[:14], between[-1]))
        ]
        self._number = number
        return done

    def add(self, name: str, amount: float) -> None:
        """Count in the bin that is open."""
        self._sums[name] += amount


class Bandwidth:
    """A line for each channel, kbit/s; at rest it is drawn where it begins and ends only."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet, self._channels, self._bins = sheet, design.channels, Bins()
        self._last: dict[str, tuple[float, float]] = {}
        for name in design.channels:
            look = rr.SeriesLines(colors=[channel(name)], names=[name], widths=[1.5])
            sheet.static(f"bandwidth/{name}", look)

    def pass_time(self, at: float) -> None:
        """Draw the bins that are over."""
        for start, sums in self._bins.close(at):
            for name in self._channels:
                self._point(name, start, sums.get(name, 0.0) * 8 / BIN_S / 1000)

    def take(self, happening: Happening) -> None:
        """Count the bits."""
        if isinstance(happening.what, Spoken):
            self._bins.add(happening.what.channel, happening.what.size)

    def _point(self, name: str, start: float, kbit_s: float) -> None:
        before, last = self._last.get(name, (start, 0.0))
        if kbit_s > 0 and last == 0.0 and name in self._last:
            self._sheet.add(f"bandwidth/{name}", scalars, max(before, start - BIN_S), (0.0,))
        if kbit_s > 0 or last > 0 or name not in self._last:
            self._sheet.add(f"bandwidth/{name}", scalars, start, (kbit_s,))
        self._last[name] = (start, kbit_s)


# --- Agents and channels as a graph: agents with their state, channels alight while they carry
# traffic


GRAPH = "graph"
WIDE, HIGH = 165.0, 90.0
"""Half axes of the ellipse agents stand on, in points of the viewer; estimate: labels do not
meet.
"""
DIM: Colour = (110, 118, 130)
"""A channel at rest, on light and on dark."""
FADE = 0.55
"""Share of a channel's light that is left after a bin; estimate: dark a second after its last
word.
"""
FULL = 4.0
"""So many communicates in a bin are full light."""


class Graph:
    """Draws the graph at each change of a state or of a light."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet, self._design, self._bins = sheet, design, Bins()
        self._light: dict[str, float] = dict.fromkeys(design.channels, 0.0)
        self._states: dict[str, tuple[str, bool]] = {}
        self._drawn: tuple[list[str], list[Colour]] | None = None
        places = positions(design)
        edges = [(agent, name) for name, one in design.channels.items() for agent in one.ends]
        radii = [9.0 if name in design.agents else 6.0 for name in places]
        look = rr.GraphNodes(
            list(places), positions=list(places.values()), radii=radii, show_labels=True
        )
        sheet.static(GRAPH, look)
        sheet.static(GRAPH, rr.GraphEdges(edges))

    def take(self, happening: Happening) -> None:
        """Count a communicate, or note a state."""
        match happening.what:
            case Spoken(channel=name):
                self._bins.add(name, 1.0)
            case Entered(agent=agent, state=state, alive=alive):
                self._states[agent] = (state, alive)

    def pass_time(self, at: float) -> None:
        """Let lights fade and draw what changed."""
        for start, sums in self._bins.close(at):
            for name in self._light:
                lit = self._light[name] * FADE + sums.get(name, 0.0)
                self._light[name] = lit if lit > 0.05 else 0.0
            now = self._now(sums)
            if now != self._drawn:
                self._drawn = now
                self._sheet.add(GRAPH, nodes, start, now)

    def _now(self, sums: dict[str, float]) -> tuple[list[str], list[Colour]]:
        labels, colours = [], []
        for agent in self._design.agents:
            state, alive = self._states.get(agent, ("", True))
            labels.append(
                f"{agent}: {state}" if alive and state else agent if alive else f"{agent}: gone"
            )
            colours.append(FRESH if alive and state else GREY if alive else RED)
        for name, light in self._light.items():
            rate = sums.get(name, 0.0) / BIN_S
            labels.append(f"{name} {rate:.0f}/s" if rate else name)
            colours.append(between(DIM, channel(name), min(1.0, light / FULL) ** 0.5))
        return labels, colours


def positions(design: Design) -> dict[str, tuple[float, float]]:
    """Agents on an ellipse, neighbours by channels side by side; each channel in the middle of its
    two.
    """
    around = ring(design)
    turn = 2 * math.pi / len(around)
    places = {
        a: (-WIDE * math.cos(turn * k), -HIGH * math.sin(turn * k)) for k, a in enumerate(around)
    }
    ordered = {agent: places[agent] for agent in design.agents}
    for name, one in design.channels.items():
        (ax, ay), (bx, by) = (places[agent] for agent in one.ends)
        ordered[name] = ((ax + bx) / 2, (ay + by) / 2)
    return ordered


def ring(design: Design) -> list[str]:
    """The agents so that channels lead from one to the next, where they do; the least connected
    first.
    """
    beside = {
        a: [b for one in design.channels.values() if a in one.ends for b in one.ends if b != a]
        for a in design.agents
    }
    found: list[str] = []
    waiting = sorted(beside, key=lambda agent: len(beside[agent]))
    while waiting:
        near = [agent for agent in waiting if found and agent in beside[found[-1]]]
        found.append(min(near, key=lambda agent: len(beside[agent])) if near else waiting[0])
        waiting.remove(found[-1])
    return found


# --- The newest communicates as a sequence diagram: a lane for each agent, an arrow for each
# communicate, newest below


SEQUENCE = "sequence"
ARROWS, LANES, NAMES = (f"{SEQUENCE}/{part}" for part in ("arrows", "lanes", "agents"))
ROWS = 20
"""Communicates that are drawn; estimate: as many with their labels as a view has room for."""
APART, ROW_HIGH = 200.0, 42.0
"""Between lanes and between arrows, in points of the viewer; estimate: labels do not meet."""
MOST_LETTERS = 52
"""Largest number of letters of a label. Estimate: it fits into two lanes."""


class Sequence:
    """Draws the diagram again when something was said, at most once in BIN_S."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet = sheet
        self._lanes = {agent: APART * k for k, agent in enumerate(ring(design))}
        self._said: deque[Spoken] = deque(maxlen=ROWS)
        self._drawn, self._changed = 0.0, False
        lanes = [[(x, 0.0), (x, ROW_HIGH * (ROWS + 1))] for x in self._lanes.values()]
        # negative: in points of the screen
        sheet.static(LANES, rr.LineStrips2D(lanes, colors=[GREY], radii=[-0.5]))
        places = [(x, -ROW_HIGH) for x in self._lanes.values()]
        dots: dict[str, Any] = {"colors": [FRESH], "radii": [-2.0], "show_labels": True}
        sheet.static(NAMES, rr.Points2D(places, labels=list(self._lanes), **dots))
        sheet.static(ARROWS, rr.Arrows2D.from_fields(radii=[-1.0], show_labels=True))

    def take(self, happening: Happening) -> None:
        """Note a communicate of agents: guests have no lane."""
        one = happening.what
        if isinstance(one, Spoken) and self._lanes.keys() >= {one.sender, one.receiver}:
            self._said.append(one)
            self._changed = True

    def pass_time(self, at: float) -> None:
        """Draw what was said, if the last drawing was BIN_S ago."""
        if self._changed and at - self._drawn > BIN_S:
            self._drawn, self._changed = at, False
            rows = [self._arrow(row, one) for row, one in enumerate(self._said, 1)]
            self._sheet.add(ARROWS, flat_arrows, self._said[-1].received, rows)

    def _arrow(
        self, row: int, one: Spoken
    ) -> tuple[tuple[float, float], tuple[float, float], str, tuple[int, int, int]]:
        start, end = self._lanes[one.sender], self._lanes[one.receiver]
        text = f"{one.conversation}: {one.performative} {one.text}".rstrip()
        text = text if len(text) <= MOST_LETTERS else f"{text[: MOST_LETTERS - 1]}…"
        return (start, ROW_HIGH * row), (end - start, 0.0), text, channel(one.channel)


# --- States over time: a lane for each agent. States of rest are grey, others stand out -----------


REST = "–"
GONE = "gone"
FAULTS = "agents/faults"
"""Place of the lane of faults, below the states of the agents."""


class Lane:
    """One lane: which states it has had, and which it has now. `resting`: its states of rest;
    `colour`: of others.
    """

    def __init__(
        self,
        sheet: Sheet,
        place: str,
        known: Iterable[str] = (),
        resting: Iterable[str] = (),
        colour: Colour = FRESH,
    ) -> None:
        self._sheet, self._place, self._colour = sheet, place, colour
        self._known, self._resting = list(known), {REST, *resting}
        self.now: str | None = None

    def enter(self, at: float, state: str) -> None:
        """Draw a state where it is another than before."""
        if self.now == state:
            return
        known = self._known
        if self.now is None or state not in known:
            known += [state] if state not in known else []
            colours = [
                RED if name == GONE else GREY if name in self._resting else self._colour
                for name in known
            ]
            self._sheet.static(
                self._place, rr.StateConfiguration(values=known, labels=known, colors=colours)
            )
        self.now = state
        self._sheet.add(self._place, states, at, state)


class Lanes:
    """Draws each change of an agent's state."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._lanes = {}
        for agent, entry in design.agents.items():
            names, rest = [state.name for state in entry.state], entry.rest or (entry.initial,)
            self._lanes[agent] = Lane(sheet, f"agents/{agent}", names, rest)

    def take(self, happening: Happening) -> None:
        """Draw what changed."""
        match happening.what:
            case Entered(agent=agent, state=state, alive=alive) if agent in self._lanes and (
                state or not alive
            ):
                self._lanes[agent].enter(happening.at, state if alive else GONE)


class Faults:
    """Draws a lane of the faults that go on; without any fault it is not there."""

    def __init__(self, sheet: Sheet) -> None:
        self._lane = Lane(sheet, FAULTS, [REST], colour=RED)
        self._now: dict[str, str] = {}

    def take(self, happening: Happening) -> None:
        """Draw a fault that begins or ends."""
        match happening.what:
            case Fault(id=name, began=began, ended=ended) as fault if began:
                if ended is None:
                    self._now[name] = fault.words
                elif self._now.pop(name, None) is None:
                    return
                self._lane.enter(happening.at, ", ".join(self._now.values()) or REST)


# --- Everything that is drawn, fed with events ----------------------------------------------------


class Drawer(Protocol):
    """Draws what it understands of a happening."""

    def take(self, happening: Happening) -> None:
        """Draw it."""
        ...


class Stage:
    """All drawers of a sheet: those of any system, and those that this one adds."""

    def __init__(self, sheet: Sheet, system: System) -> None:
        self.sheet, design = sheet, system.design
        own = system.addition("drawers")
        self._graph, self._bandwidth = Graph(sheet, design), Bandwidth(sheet, design)
        self._sequence = Sequence(sheet, design)
        self._drawers: tuple[Drawer, ...] = (
            *(own(sheet) if own is not None else ()),
            Lanes(sheet, design),
            Faults(sheet),
            Log(sheet, design),
            Sizes(sheet, design),
            self._graph,
            self._bandwidth,
            self._sequence,
        )

    def take(self, happening: Happening) -> None:
        """Draw it; verdicts and faults may be of a moment that is over, all else says how late it
        is.
        """
        if not isinstance(happening.what, Judged | Lost | Fault):
            self.pass_time(happening.at)
        for drawer in self._drawers:
            drawer.take(happening)

    def pass_time(self, at: float) -> None:
        """It is `at` [unix s]: what is counted over time may be drawn."""
        self._graph.pass_time(at)
        self._bandwidth.pass_time(at)
        self._sequence.pass_time(at)

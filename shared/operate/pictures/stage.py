"""Everything that is drawn, fed with events; the same live and from a recording."""

from collections.abc import Iterable
from typing import Protocol

import rerun as rr

from operate.fault_lines import Fault
from operate.pictures.colours import FRESH, GREY, RED
from operate.pictures.happenings import Happening, Lost
from operate.pictures.sheet import Colour, Sheet, states
from operate.pictures.traffic import Bandwidth, Graph, Log, Sequence, Sizes
from operate.recording.history import Entered
from operate.system import System
from operate.verdict_lines import Judged
from topdown.model.design import Design

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

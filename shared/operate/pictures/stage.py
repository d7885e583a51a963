"""Everything that is drawn, fed with events; the same live and from a recording."""

from typing import Protocol

from operate.pictures.graph import Graph
from operate.pictures.happenings import Happening, Lost
from operate.pictures.lanes import Faults, Lanes
from operate.pictures.sequence import Sequence
from operate.pictures.sheet import Sheet
from operate.pictures.traffic import Bandwidth, Log, Sizes
from operate.run_folder import Fault, Judged
from operate.system import System


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
        """Draw it; verdicts and faults may be of a moment that is over, all else says how late it is."""
        if not isinstance(happening.what, Judged | Lost | Fault):
            self.pass_time(happening.at)
        for drawer in self._drawers:
            drawer.take(happening)

    def pass_time(self, at: float) -> None:
        """It is `at` [unix s]: what is counted over time may be drawn."""
        self._graph.pass_time(at)
        self._bandwidth.pass_time(at)
        self._sequence.pass_time(at)

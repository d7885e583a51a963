"""Everything that is drawn, fed with what came to pass; the same live and from a recording."""

from typing import Protocol

from companion.tools.pictures.acts import Acts
from companion.tools.pictures.camera import Camera
from companion.tools.pictures.plan import Plan
from companion.tools.pictures.scene import Contacts, Scene
from companion.tools.pictures.signals import Signals
from companion.tools.pictures.velma import Velma
from operate.pictures.graph import Graph
from operate.pictures.happenings import Happening, Lost
from operate.pictures.lanes import Lanes
from operate.pictures.sheet import Sheet
from operate.pictures.traffic import Bandwidth, Log, Sizes
from operate.run_folder import Judged


class Drawer(Protocol):
    """Draws what it understands of a happening."""

    def take(self, happening: Happening) -> None:
        """Draw it."""
        ...


class Stage:
    """All drawers of a sheet."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        scene = Scene(sheet)
        self._graph, self._bandwidth = Graph(sheet), Bandwidth(sheet)
        self._drawers: tuple[Drawer, ...] = (
            Velma(sheet),
            scene,
            Contacts(sheet),
            Acts(sheet, scene),
            Camera(sheet),
            Lanes(sheet),
            Plan(sheet),
            Log(sheet),
            Sizes(sheet),
            Signals(sheet),
            self._graph,
            self._bandwidth,
        )

    def take(self, happening: Happening) -> None:
        """Draw it; verdicts may be of a moment that is over, all else says how late it is."""
        if not isinstance(happening.what, Judged | Lost):
            self.pass_time(happening.at)
        for drawer in self._drawers:
            drawer.take(happening)

    def pass_time(self, at: float) -> None:
        """It is `at` [unix s]: what is counted over time may be drawn."""
        self._graph.pass_time(at)
        self._bandwidth.pass_time(at)

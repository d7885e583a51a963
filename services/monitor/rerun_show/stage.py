"""Everything that is drawn, fed with what came to pass; the same live and from a recording."""

from typing import Protocol

from companion.run_folder import Judged
from services.monitor.rerun_show.acts import Acts
from services.monitor.rerun_show.camera import Camera
from services.monitor.rerun_show.graph import Graph
from services.monitor.rerun_show.happenings import Happening, Lost
from services.monitor.rerun_show.lanes import Lanes
from services.monitor.rerun_show.plan import Plan
from services.monitor.rerun_show.scene import Contacts, Scene
from services.monitor.rerun_show.sheet import Sheet
from services.monitor.rerun_show.signals import Signals
from services.monitor.rerun_show.traffic import Bandwidth, Log, Sizes
from services.monitor.rerun_show.velma import Velma


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

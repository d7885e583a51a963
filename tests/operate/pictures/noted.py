"""A sheet that also keeps what is drawn on it, and two ways from a run to it: as it goes by, and
afterwards.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import rerun as rr

from companion.tools.system import SYSTEM
from operate.judging.judged import Judging
from operate.pictures.file import end_s
from operate.pictures.sheet import Sheet
from operate.pictures.stage import Drawer, Stage
from operate.recording import history
from operate.recording.happenings import Happening, Reader, of_history
from operate.recording.records import Record
from operate.recording.run import Run

Row = tuple[str, float, Any]


class Noted(Sheet):
    """`drawn`: entity, seconds after the beginning, value; `looks`: what stands statically."""

    def __init__(self, begin: float) -> None:
        self.drawn: list[Row] = []
        self.looks: dict[str, rr.AsComponents] = {}
        super().__init__(rr.RecordingStream("test"), begin)

    def static(self, entity: str, what: rr.AsComponents) -> None:
        """Keep and draw."""
        self.looks[entity] = what
        super().static(entity, what)

    def add(
        self, entity: str, columns: Any, at: float, value: Any, sim: float | None = None
    ) -> None:
        """Keep and draw."""
        super().add(entity, columns, at, value, sim)
        self.drawn.append(
            (entity, self._waiting[entity, columns, sim is not None][-1][0] - self.begin, value)
        )

    def of(self, entity: str) -> list[tuple[float, Any]]:
        """Rows of an entity."""
        return [(at, value) for name, at, value in self.drawn if name == entity]


def staged(sheet: Sheet) -> Stage:
    """All drawers."""
    return Stage(sheet, SYSTEM)


def afterwards(past: history.History, drawers: Callable[[Sheet], Drawer] = staged) -> Noted:
    """Everything of a history, or what some of its drawers make of it."""
    sheet = Noted(past.begin)
    stage = drawers(sheet)
    for happening in of_history(past):
        stage.take(happening)
    if isinstance(stage, Stage):
        stage.pass_time(past.begin + end_s(past) + 1.0)
    sheet.flush()
    return sheet


def live(records: list[Record], begin: float, end: float) -> Noted:
    """Everything as it goes by, verdicts when they come."""
    sheet, reader, judging = Noted(begin), Reader(SYSTEM), Judging(SYSTEM)
    stage = Stage(sheet, SYSTEM)
    for number, record in enumerate(records):
        for happening in reader.read(record):
            stage.take(happening)
        for verdict in judging.lines(record):
            stage.take(Happening(verdict.t, verdict))
        if number % 50 == 0:
            sheet.flush()
    for verdict in judging.finish():
        stage.take(Happening(verdict.t, verdict))
    stage.pass_time(end)
    sheet.flush()
    return sheet


def recorded() -> history.History:
    """A pour that was recorded with the whole fleet."""
    return Run(Path(__file__).parents[2] / "histories" / "pour_seed_7", SYSTEM).history

"""The newest communicates as a sequence diagram: a lane for each agent, an arrow for each communicate, newest below."""

from collections import deque

import rerun as rr

from operate.pictures.colours import FRESH, GREY, channel
from operate.pictures.graph import ring
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Sheet, flat_arrows
from operate.pictures.traffic import BIN_S
from operate.recording.records import Spoken
from topdown.model.design import Design

SEQUENCE = "sequence"
ARROWS, LANES, NAMES = (f"{SEQUENCE}/{part}" for part in ("arrows", "lanes", "agents"))
ROWS = 20
"""Communicates that are drawn; estimate: as many with their labels as a view has room for."""
APART, HIGH = 200.0, 42.0
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
        lanes = [[(x, 0.0), (x, HIGH * (ROWS + 1))] for x in self._lanes.values()]
        sheet.static(LANES, rr.LineStrips2D(lanes, colors=[GREY], radii=[-0.5]))  # negative: in points of the screen
        places = [(x, -HIGH) for x in self._lanes.values()]
        sheet.static(
            NAMES, rr.Points2D(places, labels=list(self._lanes), colors=[FRESH], radii=[-2.0], show_labels=True)
        )
        sheet.static(ARROWS, rr.Arrows2D.from_fields(radii=[-1.0], show_labels=True))

    def take(self, happening: Happening) -> None:
        """Note a communicate."""
        if isinstance(happening.what, Spoken):
            self._said.append(happening.what)
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
        return (start, HIGH * row), (end - start, 0.0), text, channel(one.channel)

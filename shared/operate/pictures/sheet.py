"""Rows for Rerun, gathered by entity and sent as columns: a call of Rerun costs as much for one row
as for hundreds.

Time lines: `run`, seconds after the first communicate, for everything; `simulation`, where a row
has simulated time.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import rerun as rr

# --- Colours of channels and states, readable on light and on dark, as the viewer's theme may be --


Colour = tuple[int, int, int]

GREY: Colour = (120, 130, 145)
FRESH: Colour = (38, 150, 180)
RED: Colour = (205, 60, 60)
ORANGE: Colour = (222, 140, 30)
INK: Colour = (12, 8, 28)
"""Of labels on a light ground: the viewer writes them on grey in its dark theme, on white in its
light one.
"""
GHOST: Colour = (150, 80, 220)
"""Of what somebody believes and is not so."""
PLANNED: Colour = (60, 120, 230)
"""Of what is planned and is not yet so."""
CHANNELS: tuple[Colour, ...] = (
    (60, 115, 230),
    (215, 85, 180),
    (140, 165, 20),
    (20, 175, 180),
    (165, 125, 240),
    (60, 165, 85),
)
"""Of C1, C2 and so on; C7 looks like C1. None looks like GREY, ORANGE or RED: levels of a log."""
SIDES: dict[str, Colour] = {"right": (214, 93, 130), "left": (38, 150, 180)}
AXES: tuple[Colour, ...] = ((220, 60, 60), (60, 170, 70), (60, 100, 220))
"""x, y, z of a frame."""


def channel(name: str) -> Colour:
    """A channel's colour, by its number; grey for a name without one."""
    digits = name.lstrip("C")
    return CHANNELS[(int(digits) - 1) % len(CHANNELS)] if digits.isdecimal() else GREY


def between(a: Colour, b: Colour, share: float) -> Colour:
    """The colour `share` (0 to 1) of the way from `a` to `b`."""
    r, g, b_ = (round(x + share * (y - x)) for x, y in zip(a, b, strict=True))
    return r, g, b_


# --- Rows for Rerun -------------------------------------------------------------------------------


RUN, SIMULATION = "run", "simulation"
Columns = Callable[[list[Any]], Any]
"""Values of rows to the columns of an archetype."""


class Sheet:
    """Rows of a recording that begins at `begin` [unix s]. `rows`: how many were sent, by
    entity.
    """

    def __init__(self, out: rr.RecordingStream, begin: float) -> None:
        self.begin = begin
        self.rows: dict[str, int] = {}
        self._out = out
        self._stood: set[str] = set()
        self._waiting: dict[tuple[str, Columns, bool], list[tuple[float, float | None, Any]]] = {}

    def static(self, entity: str, what: rr.AsComponents) -> None:
        """Something that has no time."""
        self._out.log(entity, what, static=True)
        self.rows.setdefault(entity, 0)

    def add(
        self, entity: str, columns: Columns, at: float, value: Any, sim: float | None = None
    ) -> None:
        """A row at `at` [unix s], sent with the next flush.

        What came before the beginning counts from it on. Where a thing first is, there it was from
        the beginning on.
        """
        rows = self._waiting.setdefault((entity, columns, sim is not None), [])
        if columns is transforms and at > self.begin and not rows and entity not in self._stood:
            rows.append((self.begin, sim, value))
        self._stood.add(entity)
        rows.append((max(at, self.begin), sim, value))

    def flush(self) -> None:
        """Hand all rows to Rerun."""
        waiting, self._waiting = self._waiting, {}
        for (entity, columns, simulated), rows in waiting.items():
            indexes = [rr.TimeColumn(RUN, duration=[at - self.begin for at, _, _ in rows])]
            if simulated:
                indexes.append(
                    rr.TimeColumn(SIMULATION, duration=[sim or 0.0 for _, sim, _ in rows])
                )
            rr.send_columns(
                entity, indexes, columns([value for *_, value in rows]), recording=self._out
            )
            self.rows[entity] = self.rows.get(entity, 0) + len(rows)


def transforms(values: list[tuple[Sequence[float], Sequence[float]]]) -> Any:
    """(Translation [m], quaternion w first) each; HIDDEN: the entity and all below it is too small
    to be seen.
    """
    turns = np.array([turn for _, turn in values])[:, [1, 2, 3, 0]]
    hidden = ~turns.any(axis=1, keepdims=True)
    return rr.Transform3D.columns(
        translation=np.array([at for at, _ in values]),
        quaternion=np.where(hidden, (0.0, 0.0, 0.0, 1.0), turns),
        scale=np.where(hidden, UNSEEN, 1.0) * np.ones(3),
    )


HIDDEN = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
"""A place that is none. The viewer warns of a quaternion without direction, so it does not get this
one.
"""
UNSEEN = 1e-6
"""Scale of what is hidden; estimate: a metre is a micrometre then."""


def scalars(values: list[Sequence[float]]) -> Any:
    """As many numbers each as the first row has."""
    return rr.Scalars.columns(scalars=np.concatenate(values)).partition(
        [len(value) for value in values]
    )


def log_lines(values: list[tuple[str, str, Colour]]) -> Any:
    """(Text, level, colour) each: lines of a log."""
    texts, levels, colours = zip(*values, strict=True)
    return rr.TextLog.columns(text=texts, level=levels, color=colours)


def states(values: list[str]) -> Any:
    """The state a lane enters."""
    return rr.StateChange.columns(state=values)


def documents(values: list[str]) -> Any:
    """A text in Markdown."""
    return rr.TextDocument.columns(text=values, media_type=["text/markdown"] * len(values))


def points(values: list[Sequence[Sequence[float]]]) -> Any:
    """Points [m], as many as there are; colour and radius stand statically."""
    flat = np.array([point for value in values for point in value], dtype=np.float32).reshape(-1, 3)
    return rr.Points3D.columns(positions=flat).partition([len(value) for value in values])


def labels(values: list[Sequence[tuple[Sequence[float], str]]]) -> Any:
    """(Point [m], text) each, as many as there are; the look stands statically."""
    flat = [one for value in values for one in value]
    places = np.array([at for at, _ in flat], dtype=np.float32).reshape(-1, 3)
    return rr.Points3D.columns(positions=places, labels=[text for _, text in flat]).partition(
        list(map(len, values))
    )


def strips(values: list[Sequence[Any]]) -> Any:
    """Lines through points (n, 3) [m], as many lines as there are."""
    flat = [np.asarray(strip, dtype=np.float32) for value in values for strip in value]
    return rr.LineStrips3D.columns(strips=flat).partition([len(value) for value in values])


def outlines(values: list[Sequence[tuple[str, Any]]]) -> Any:
    """(Label, corners (n, 2) [pixels]) of closed outlines in a picture, as many as there are each
    time.
    """
    flat = [one for value in values for one in value]
    strips = [np.vstack([corners, corners[:1]]).astype(np.float32) for _, corners in flat]
    columns = rr.LineStrips2D.columns(strips=strips, labels=[label for label, _ in flat])
    return columns.partition([len(value) for value in values])


def arrows(values: list[tuple[Sequence[Any], Sequence[Any]]]) -> Any:
    """(Origins, vectors) [m] each."""
    origins, vectors = (
        np.array([one for value in values for one in value[k]]).reshape(-1, 3) for k in (0, 1)
    )
    return rr.Arrows3D.columns(origins=origins, vectors=vectors).partition(
        [len(origin) for origin, _ in values]
    )


def flat_arrows(values: list[Sequence[tuple[Any, Any, str, Colour]]]) -> Any:
    """(Origin, vector [points of the viewer], label, colour) of arrows in a plane, as many as there
    are each time.
    """
    origins, vectors, texts, colours = (
        list(one) for one in zip(*(one for value in values for one in value), strict=True)
    )
    columns = rr.Arrows2D.columns(origins=origins, vectors=vectors, labels=texts, colors=colours)
    return columns.partition(list(map(len, values)))


def nodes(values: list[tuple[Sequence[str], Sequence[Colour]]]) -> Any:
    """(Labels, colours) of a graph whose nodes stand statically, all of them each time."""
    labels, colours = ([one for value in values for one in value[k]] for k in (0, 1))
    return rr.GraphNodes.columns(labels=labels, colors=colours).partition(
        [len(value[0]) for value in values]
    )


def images(values: list[bytes]) -> Any:
    """A JPEG file each."""
    return rr.EncodedImage.columns(blob=values, media_type=["image/jpeg"] * len(values))

"""Parts of a book about a design: sections of tables and figures, independent of the output format."""

from typing import Any

import msgspec

from topdown.draw.canvas import Canvas


class Grid(msgspec.Struct, frozen=True):
    """A table: the first column names the row.

    `folded`: long, opened on demand where that can be done. `detail`: behind what is shown beside it; folded too, and
    left out of a text that is not to be long.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    folded: bool = False
    detail: bool = False


class Figure(msgspec.Struct, frozen=True):
    """A picture: as drawing, as text for a terminal (no line longer than was asked for, where that is possible), and
    what it shows as plain data. `name`: stem of its file.
    """

    name: str
    caption: str
    canvas: Canvas
    text: str
    data: Any = None
    notes: tuple[str, ...] = ()


class Section(msgspec.Struct, frozen=True):
    """`what`: requirements, steps ...; `parts` in order; `paired`: a table and the figure after it belong together."""

    what: str
    title: str
    lead: str
    parts: tuple[Grid | Figure, ...]
    paired: bool = False


def rulings(*entries: tuple[str, str]) -> tuple[str, ...]:
    """Notes of the entries (name, ruling) that have a ruling."""
    return tuple(f"{name}: {' '.join(ruling.split())}" for name, ruling in entries if ruling)


def listed(words: tuple[str, ...] | list[str], none: str = "-") -> str:
    """Words with commas between, or a dash."""
    return ", ".join(words) or none

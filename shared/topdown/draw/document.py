"""Parts of a book about a design: sections of tables and figures, independent of the output
format.
"""

import re
import textwrap
from collections.abc import Sequence
from typing import Any

import msgspec

from topdown.draw.canvas import Canvas


class Grid(msgspec.Struct, frozen=True):
    """A table: the first column names the row.

    `folded`: long, opened on demand where that can be done. `detail`: behind what is shown beside
    it; folded too, and left out of a text that is not to be long.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    folded: bool = False
    detail: bool = False


class Figure(msgspec.Struct, frozen=True):
    """A picture: as drawing, as text for a terminal (no line longer than was asked for, where that
    is possible), and what it shows as plain data. `name`: stem of its file.
    """

    name: str
    caption: str
    canvas: Canvas
    text: str
    data: Any = None
    notes: tuple[str, ...] = ()


class Section(msgspec.Struct, frozen=True):
    """`what`: requirements, steps ...; `parts` in order; `paired`: a table and the figure after it
    belong together.
    """

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


# --- Tables and sections as plain text for a terminal: columns share the width, long cells are
# wrapped


GAP = 2
LEAST = 6  # least width of a column, in letters
WIDTH = 100  # where nobody says how wide the terminal is

_PIECES = re.compile(r"[^_.\-/|]*[_.\-/|]?")


def written(sections: tuple[Section, ...], width: int = WIDTH, long: bool = False) -> str:
    """All sections, in lines of at most `width` where words allow; `long`: with tables that are
    details.
    """
    told = []
    for section in sections:
        lead = textwrap.wrap(section.lead, width, break_on_hyphens=False)
        parts = (_part(part, width, long) for part in section.parts)
        told.append("\n\n".join(["\n".join([section.title.upper(), *lead]), *parts]))
    return "\n\n\n".join(told) + "\n"


def _part(part: Grid | Figure, width: int, long: bool) -> str:
    if isinstance(part, Figure):
        body = "\n".join([*cell(part.caption, width), "", part.text])
    elif part.detail and not long:
        body = f"{part.title}: {len(part.rows)} rows, not shown here"
    else:
        body = table(part, width)
    notes = (line for note in part.notes for line in hung("  * ", note, width, "    "))
    return "\n".join([body, *notes])


def hung(before: str, words: str, width: int, below: str) -> list[str]:
    """Words in lines of at most `width`: the first behind `before`, the others behind `below`."""
    how = textwrap.TextWrapper(width, before, below, break_on_hyphens=False)
    return how.wrap(words) or [before.rstrip()]


def outline(tree: Sequence[tuple[int, str]], width: int) -> list[str]:
    """A tree as text: the depth and the words of each entry, with bars where branches go on."""
    lines: list[str] = []
    for index, (depth, words) in enumerate(tree):
        after = [deep for deep, _ in tree[index + 1 :]]
        ahead = [
            next((n for n in after if n <= level), 0) == level for level in range(1, depth + 2)
        ]
        bars = ["│  " if goes_on else "   " for goes_on in ahead]
        corner = ("├─ " if ahead[-2] else "└─ ") if depth else ""
        lines += hung("".join(bars[:-2]) + corner, words, width, "".join(bars))
    return lines


def table(grid: Grid, width: int = WIDTH) -> str:
    """A table with its title and a line under its head."""
    if not grid.rows:
        return f"{grid.title}\n  (none)"
    cells = [grid.head, *grid.rows] if any(grid.head) else list(grid.rows)
    widths = column_widths(cells, width)
    lines = [line for row in cells for line in _row(row, widths)]
    if any(grid.head):
        lines.insert(len(_row(grid.head, widths)), (" " * GAP).join("─" * w for w in widths))
    return "\n".join([*cell(grid.title, width), *lines] if grid.title else lines)


def column_widths(cells: list[tuple[str, ...]], width: int) -> list[int]:
    """Widths of the columns: what they need; where that is too much, the widest ones are cut, words
    whole as long as possible.
    """
    columns = list(zip(*cells, strict=True))
    widths = [max(len(text) for text in column) for column in columns]
    space = width - GAP * (len(columns) - 1)
    words = [[word for text in column for word in text.split()] for column in columns]
    whole = [max(map(len, column), default=0) for column in words]
    parts = [[p for word in column for p in _PIECES.findall(word)] for column in words]
    pieces = [max(map(len, column), default=0) for column in parts]
    for floor in (whole, pieces, [LEAST] * len(columns)):
        while sum(widths) > space:
            loose = [index for index, wide in enumerate(widths) if wide > max(floor[index], LEAST)]
            if not loose:
                break
            widths[max(loose, key=lambda index: widths[index])] -= 1
    return widths


def cell(words: str, width: int) -> list[str]:
    """Words in lines of at most `width`; a word too long for a line is broken behind a mark in it,
    if it has one.
    """
    lines = [""]
    for word in words.split():
        for number, piece in enumerate(_PIECES.findall(word) if len(word) > width else [word]):
            joined = f"{lines[-1]} {piece}" if lines[-1] and not number else f"{lines[-1]}{piece}"
            if len(joined) <= width:
                lines[-1] = joined
                continue
            lines += [piece[start : start + width] for start in range(0, len(piece), width)]
    return lines[1:] if len(lines) > 1 and not lines[0] else lines


def _row(row: tuple[str, ...], widths: list[int]) -> list[str]:
    wrapped = [cell(text, wide) for text, wide in zip(row, widths, strict=True)]
    height = max(len(lines) for lines in wrapped)
    filled = [lines + [""] * (height - len(lines)) for lines in wrapped]
    beside = [[line.ljust(w) for line in lines] for lines, w in zip(filled, widths, strict=True)]
    return [(" " * GAP).join(lines).rstrip() for lines in zip(*beside, strict=True)]

"""Sequence diagrams: lifelines, arrows between them in order, frames around alternatives. As SVG
and as text.

Of a protocol's two roles (the paper's Figures 8 and 9), and of the traffic among any number of
agents.
"""

import textwrap
from collections.abc import Sequence
from typing import Union

import msgspec

from topdown.draw.canvas import Box, Canvas, width_of


class Arrow(msgspec.Struct, frozen=True):
    """Something that was or may be said: `label` on its arrow, `detail` below, `alert`: what is
    wrong with it.

    `at`: seconds after the first one; None: no times are shown. Where `sender` or `receiver` has no
    lifeline it is a remark.
    """

    sender: str
    receiver: str
    label: str
    detail: str = ""
    alert: str = ""
    at: float | None = None


class Note(msgspec.Struct, frozen=True):
    """Words between the lifelines."""

    text: str


class Frame(msgspec.Struct, frozen=True):
    """alt: one of the branches; loop: the branch any number of times; opt: the branch or
    nothing.
    """

    kind: str
    title: str
    branches: tuple[tuple["Row", ...], ...]


Row = Union[Arrow, Note, Frame]  # noqa: UP007  (Frame refers to it by name)


class Diagram(msgspec.Struct, frozen=True):
    """Lifelines from left to right, and the rows below each other."""

    title: str
    lifelines: tuple[str, ...]
    rows: tuple[Row, ...]


def _depth(rows: Sequence[Row]) -> int:
    """Frames around each other."""
    inner = [_depth(branch) for row in rows if isinstance(row, Frame) for branch in row.branches]
    return 1 + max(inner) if inner else 0


# --- SVG ------------------------------------------------------------------------------------------


STEP = 14.0  # how much further in each frame stands [px]
# least distance of the lifelines, if there are two, and of more [px]
LEAST_OF_TWO, LEAST = 340.0, 120.0
HEAD = 20.0
TIME = 64.0  # width of the times at the left [px]
# letters of a detail in a timed diagram; more would be wider than the arrow of most (estimate)
MOST = 48


def draw(diagram: Diagram) -> Canvas:
    """The diagram as a drawing."""
    return _Drawing(diagram).canvas


class _Drawing:
    def __init__(self, diagram: Diagram) -> None:
        self.canvas, under = Canvas(diagram.title), Canvas(diagram.title)
        names = diagram.lifelines
        half = max([42.0, *(width_of(name, "strong large") / 2 + 14 for name in names)])
        timed = any(isinstance(row, Arrow) and row.at is not None for row in diagram.rows)
        self.left = TIME if timed else 0.0
        least = LEAST_OF_TWO if len(names) == 2 else LEAST
        gap = max(least, 2 * half + 6, self._widest(diagram.rows) + 40)
        first = self.left + half + STEP * _depth(diagram.rows)
        self.at = {name: first + number * gap for number, name in enumerate(names)}
        self.ends = min(self.at.values(), default=first), max(self.at.values(), default=first)
        self.y = 44.0
        self._rows(diagram.rows, 0)
        for name, x in self.at.items():
            under.line([(x, 30), (x, self.y + 14)], "life")
            under.box(Box(x - half, 0, 2 * half, 30), "box")
            under.words((x, 20), name, "strong large", "middle")
        self.canvas.put_under(under)

    def _widest(self, rows: Sequence[Row]) -> float:
        """What must fit between two lifelines; a long alert may cross its neighbours."""
        widths = [0.0]
        for row in rows:
            if isinstance(row, Arrow):
                widths += [width_of(row.label, "strong"), width_of(_detail(row), "small")]
            elif isinstance(row, Frame):
                widths += [width_of(row.title, "small") + 60, *map(self._widest, row.branches)]
        return max(widths)

    def _rows(self, rows: Sequence[Row], depth: int) -> None:
        for row in rows:
            if isinstance(row, Arrow):
                self._arrow(row)
            elif isinstance(row, Frame):
                self._frame(row, depth)
            else:
                middle = ((self.ends[0] + self.ends[1]) / 2, self.y + 20)
                self.canvas.patched(middle, row.text, "small quiet", "middle")
                self.y += 24

    def _arrow(self, row: Arrow) -> None:
        joined = row.sender in self.at and row.receiver in self.at and row.sender != row.receiver
        start, tip = (self.at.get(row.sender, 0), self.at.get(row.receiver, 0))
        start, tip = (start, tip) if joined else (self.ends[0], self.ends[0])
        middle, anchor = (start + tip) / 2, "middle" if joined else "start"
        self.y += 26
        if row.at is not None:
            self.canvas.words((self.left - 12, self.y), f"+{row.at:.2f} s", "small quiet", "end")
        label = row.label if joined else f"{row.sender} > {row.receiver} {row.label}"
        self.canvas.patched((middle, self.y - 7), label, "strong", anchor)
        if joined:
            self.canvas.arrow([(start, self.y), (tip, self.y)])
        for words, css in ((_detail(row), "small quiet"), (row.alert, "small alert")):
            if words:
                self.y += 15
                self.canvas.patched((middle, self.y), words, css, anchor)
        self.y += 6

    def _frame(self, frame: Frame, depth: int) -> None:
        x, top = self.left + STEP * depth, self.y + 10
        width = self.ends[0] + self.ends[1] - self.left - 2 * STEP * depth
        self.y = top + HEAD
        for number, branch in enumerate(frame.branches):
            if number:
                self.y += 10
                self.canvas.line([(x, self.y), (x + width, self.y)], "life")
            self._rows(branch, depth + 1)
        self.y += 12
        self.canvas.box(Box(x, top, width, self.y - top), "frame", 3, solid=False)
        tab = width_of(frame.kind, "strong small") + 16
        self.canvas.box(Box(x, top, tab, 17), "tab", 3, solid=False)
        self.canvas.words((x + 8, top + 12.5), frame.kind, "strong small")
        if frame.title:
            self.canvas.patched((x + tab + 8, top + 12.5), f"[{frame.title}]", "small")
        self.y += 4


def _detail(row: Arrow) -> str:
    return row.detail if row.at is None or len(row.detail) <= MOST else row.detail[: MOST - 1] + "…"


# --- Text -----------------------------------------------------------------------------------------


class Columns:
    """Lifelines in lines of text; `at`: the column of each, the first is 0."""

    def __init__(self, names: Sequence[str], gap: int) -> None:
        self.at = {name: number * gap for number, name in enumerate(names)}
        self.width = max(self.at.values(), default=0) + 1

    def between(self, words: str = "") -> str:
        """The first and the last lifeline, with words between them."""
        return f"│{words.center(self.width - 2)}│"

    def arrow(self, sender: str, receiver: str, label: str) -> str:
        """An arrow with as much of its label as there is room for; "" where one of the two has no
        lifeline.
        """
        if sender not in self.at or receiver not in self.at or sender == receiver:
            return ""
        start, tip = self.at[sender], self.at[receiver]
        left, right = min(start, tip), max(start, tip)
        room = right - left - 2
        words = f" {label} " if len(label) + 2 < room else f" {label} "[: room - 2] + "…"
        cells = ["│" if column in self.at.values() else " " for column in range(self.width)]
        for column, letter in enumerate(words.center(room, "─"), left + (1 if start < tip else 2)):
            crossed = letter == "─" and cells[column] == "│"
            cells[column] = "┼" if crossed else letter
        cells[start] = "├" if start < tip else "┤"
        cells[tip + (-1 if start < tip else 1)] = "▶" if start < tip else "◀"
        return "".join(cells)


def plain(diagram: Diagram, width: int) -> str:
    """A diagram of two lifelines as text; frames are bars at the left."""
    gutter = 2 * _depth(diagram.rows) + 5
    span = max(24, min(width - gutter, 86))
    left, right = diagram.lifelines
    head = f"{' ' * gutter}{left}{right.rjust(span - len(left))}"
    return "\n".join([head, *_lines(diagram.rows, Columns((left, right), span - 1), "", gutter)])


def _lines(rows: Sequence[Row], columns: Columns, bars: str, gutter: int) -> list[str]:
    lines: list[str] = []

    def between(before: str, words: Sequence[str]) -> None:
        lines.extend(f"{before.ljust(gutter)}{columns.between(line)}" for line in words)

    for row in rows:
        if isinstance(row, Arrow):
            *above, last = textwrap.wrap(row.label, columns.width - 8)
            between(bars, above)
            lines.append(f"{bars.ljust(gutter)}{columns.arrow(row.sender, row.receiver, last)}")
            between(bars, textwrap.wrap(row.detail, columns.width - 6))
        elif isinstance(row, Note):
            between(bars, [row.text])
        else:
            title = textwrap.wrap(f"[{row.title}]", columns.width - 4) if row.title else [""]
            for number, branch in enumerate(row.branches):
                opening, words = ("├ or", [""]) if number else (f"┌ {row.kind}", title)
                between(f"{bars}{opening}", words)
                lines += _lines(branch, columns, f"{bars}│ ", gutter)
            between(f"{bars}└", [""])
    return lines

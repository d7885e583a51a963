"""A drawing: boxes, lines, arrows and words put at places [px], written as SVG. It knows how wide
words are, roughly.

What is placed is kept as rectangles too, so that layouts (and their tests) can ask what overlaps.
Arrow heads are polygons and nothing has an id, so that any number of drawings can stand in one
page.
"""

from collections.abc import Iterable, Sequence
from html import escape
from itertools import combinations
from math import fsum, hypot
from pathlib import Path
from string import Template
from typing import NamedTuple

# --- Colours and rules of the drawings. Every colour is backed by a dash, a weight or a word, so
# grey prints read, too
# Plain values instead of CSS variables, since viewers of SVG files other than browsers have none.


FONT = "Helvetica, Arial, 'Liberation Sans', sans-serif"

LIGHT = {
    "paper": "#ffffff",
    "ink": "#1b2530",
    "muted": "#56636f",
    "line": "#7d8a96",
    "fill": "#f1f5f8",
    "dim": "#d5dde4",
    "accent": "#0a5c9e",
    "warm": "#9c4206",
}
DARK = {
    "paper": "#14191f",
    "ink": "#e5eaef",
    "muted": "#a3b0bc",
    "line": "#73808c",
    "fill": "#1f2831",
    "dim": "#3a4651",
    "accent": "#74b8f4",
    "warm": "#f2a766",
}

_DRAWING, _PAGE, _LAYOUT = (
    Template(Path(__file__).with_name(name).read_text(encoding="utf-8"))
    for name in ("drawing.css", "page.css", "layout.css")
)


SHAPES = f""".drawing text{{font-family:{FONT};font-size:13px}}
.drawing .strong{{font-weight:bold}}
.drawing .small{{font-size:11px}}
.drawing .large{{font-size:15px}}
"""


def drawing_rules() -> str:
    """CSS of a drawing that stands alone."""
    light, dark = _DRAWING.substitute(LIGHT), _DRAWING.substitute(DARK)
    return f"{SHAPES}{light}@media (prefers-color-scheme: dark){{\n{dark}}}\n"


def page_rules() -> str:
    """CSS of the page and of all drawings in it; paper is always light."""
    light, dark = (
        _PAGE.substitute(shades) + _DRAWING.substitute(shades) for shades in (LIGHT, DARK)
    )
    return (
        f"{_LAYOUT.substitute(font=FONT)}{SHAPES}{light}"
        f"@media screen and (prefers-color-scheme: dark){{\n{dark}}}\n"
    )


# --- A drawing ------------------------------------------------------------------------------------


MARGIN = 16.0
SIZES = {"small": 11.0, "large": 15.0}
SIZE = 13.0
_NARROW, _WIDE = frozenset("ijlI.,:;|!'()[]ft r-"), frozenset("mwMW@%")

Point = tuple[float, float]


class Box(NamedTuple):
    """A rectangle: upper left corner, width, height [px]."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """Its right edge."""
        return self.x + self.width

    @property
    def bottom(self) -> float:
        """Its lower edge."""
        return self.y + self.height

    @property
    def middle(self) -> Point:
        """Its centre."""
        return self.x + self.width / 2, self.y + self.height / 2

    def meets(self, other: "Box", gap: float = 0.0) -> bool:
        """Whether two rectangles overlap, or come closer than `gap`."""
        beside = self.x >= other.right + gap or other.x >= self.right + gap
        return not (beside or self.y >= other.bottom + gap or other.y >= self.bottom + gap)


def size_of(css: str) -> float:
    """The size of letters of a class [px]."""
    return next((SIZES[word] for word in css.split() if word in SIZES), SIZE)


def width_of(words: str, css: str = "") -> float:
    """The width of words, rather too wide than too narrow [px]."""
    ems = fsum(
        0.34 if c in _NARROW else 0.92 if c in _WIDE else 0.7 if c.isupper() else 0.57
        for c in words
    )
    return ems * size_of(css) * (1.07 if "strong" in css else 1.0)


def wrapped(words: str, width: float, css: str = "") -> list[str]:
    """Words in lines of at most `width` [px], broken at blanks only."""
    lines: list[str] = []
    for word in words.split():
        if lines and width_of(f"{lines[-1]} {word}", css) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


class Canvas:
    """The things drawn so far, in order; `boxes` and `labels`: where they are."""

    def __init__(self, title: str) -> None:
        self.title = title
        self.boxes: list[Box] = []
        self.labels: list[Box] = []
        self._items: list[str] = []
        self._extent: list[Box] = []

    @property
    def frame(self) -> Box:
        """The visible rectangle: everything drawn and a margin."""
        if not self._extent:
            return Box(0, 0, 2 * MARGIN, 2 * MARGIN)
        left, top = (min(box[side] for box in self._extent) - MARGIN for side in (0, 1))
        right = max(box.right for box in self._extent) + MARGIN
        bottom = max(box.bottom for box in self._extent) + MARGIN
        return Box(left, top, right - left, bottom - top)

    def put_under(self, other: "Canvas") -> None:
        """Another drawing, behind what is drawn so far."""
        self.boxes, self.labels = other.boxes + self.boxes, other.labels + self.labels
        self._items, self._extent = other._items + self._items, other._extent + self._extent

    def box(self, box: Box, css: str = "box", corner: float = 5.0, solid: bool = True) -> None:
        """A rectangle; `solid`: nothing else may stand there."""
        self._extent.append(box)
        if solid:
            self.boxes.append(box)
        x, y, width, height = (_number(value) for value in box)
        self._items.append(
            f'<rect class="{css}" x="{x}" y="{y}" width="{width}" height="{height}"'
            f' rx="{_number(corner)}"/>'
        )

    def dot(self, at: Point, radius: float = 5.0) -> None:
        """A filled circle."""
        self._extent.append(Box(at[0] - radius, at[1] - radius, 2 * radius, 2 * radius))
        x, y = (_number(value) for value in at)
        self._items.append(f'<circle class="dot" cx="{x}" cy="{y}" r="{_number(radius)}"/>')

    def line(self, points: Sequence[Point], css: str = "edge") -> None:
        """A line through points."""
        for x, y in points:
            self._extent.append(Box(x, y, 0, 0))
        path = " ".join(f"{_number(x)},{_number(y)}" for x, y in points)
        self._items.append(f'<polyline class="{css}" points="{path}"/>')

    def arrow(self, points: Sequence[Point], css: str = "edge", head: str = "head") -> None:
        """A line with a head at its last point."""
        self.line(points, css)
        (x0, y0), (x1, y1) = points[-2:]
        length = hypot(x1 - x0, y1 - y0) or 1.0
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        back = ((x1 - 10 * ux - s * 4.5 * uy, y1 - 10 * uy + s * 4.5 * ux) for s in (1, -1))
        path = " ".join(f"{_number(x)},{_number(y)}" for x, y in ((x1, y1), *back))
        self._items.append(f'<polygon class="{head}" points="{path}"/>')

    def words(self, at: Point, words: str, css: str = "", anchor: str = "start") -> Box:
        """Words with their base line at a point; `anchor`: start, middle or end. The rectangle they
        take.
        """
        taken = _room(at, words, css, anchor)
        self._extent.append(taken)
        self.labels.append(taken)
        x, y = (_number(value) for value in at)
        place = "" if anchor == "start" else f' text-anchor="{anchor}"'
        dress = f' class="{css}"' if css else ""
        self._items.append(f'<text{dress} x="{x}" y="{y}"{place}>{escape(words)}</text>')
        return taken

    def column(
        self, at: Point, lines: Iterable[str], pitch: float, css: str = "", anchor: str = "start"
    ) -> None:
        """Lines of words below each other, the first at a point."""
        for number, line in enumerate(lines):
            self.words((at[0], at[1] + pitch * number), line, css, anchor)

    def patched(self, at: Point, words: str, css: str = "", anchor: str = "start") -> Box:
        """Words on a patch of ground, so that lines behind do not disturb."""
        x, y, width, _ = _room(at, words, css, anchor)
        self.box(Box(x - 3, y, width + 6, 1.3 * size_of(css)), "patch", 2, solid=False)
        return self.words(at, words, css, anchor)

    def svg(self, alone: bool = True) -> str:
        """The drawing; `alone`: with its own style, as a file, else for a page that has the
        style.
        """
        frame = self.frame
        left, top, width, height = (_number(value) for value in frame)
        rules = f"<style>{escape(drawing_rules(), quote=False)}</style>\n" if alone else ""
        size = f'width="{width}" height="{height}"'
        if not alone:  # never larger than drawn; in a narrow window scrolled rather than unreadable
            least = min(frame.width, max(360.0, 0.6 * frame.width))
            size += f' style="min-width:{_number(least)}px"'
        space = ' xmlns="http://www.w3.org/2000/svg"' if alone else ""
        return (
            f'<svg{space} class="drawing" role="img" aria-label="{escape(self.title)}" '
            f'viewBox="{left} {top} {width} {height}" {size}>\n{rules}'
            f'<rect class="ground" x="{left}" y="{top}" width="{width}" height="{height}"/>\n'
            + "\n".join(self._items)
            + "\n</svg>\n"
        )


def _room(at: Point, words: str, css: str, anchor: str) -> Box:
    """The rectangle that a text fills."""
    width, size = width_of(words, css), size_of(css)
    left = at[0] - {"start": 0.0, "middle": width / 2, "end": width}[anchor]
    return Box(left, at[1] - size, width, 1.2 * size)


def _number(value: float) -> str:
    """A coordinate to a tenth of a pixel."""
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


# --- Layout of figures: cells for the agents of a system, tracks for lines that run beside each
# other
# Agents stand in two rows of cells, so that channels are short and cross little. Between the rows
# is a corridor that no box reaches into, so a line from one row to the other meets no box; lines
# inside a row run between neighbours or outside around. The search is a descent from several
# starts, the same every time.


Pair = tuple[str, str]
Span = tuple[float, float]
Cell = tuple[int, int]
"""Row (0 above, 1 below) and column."""


def placed(names: Sequence[str], pairs: Sequence[Pair]) -> dict[str, Cell]:
    """A cell for each name."""
    columns = max(1, (len(names) + 1) // 2)
    seats: list[str] = [*names, *[""] * (2 * columns - len(names))]
    found: list[list[str]] = []
    for turn in range(len(seats)):
        here = _descended(seats[turn:] + seats[:turn], pairs)
        above, below = here[:columns], here[columns:]
        # the same picture, also upside down, in a mirror, and both
        found += [here, below + above, above[::-1] + below[::-1], below[::-1] + above[::-1]]
    # of equals, the first names should stand first
    best = min(
        found, key=lambda seats: (_cost(seats, pairs), [seats.index(name) for name in names])
    )
    return {name: cell for name, cell in _cells(best).items() if name}


def _descended(seats: list[str], pairs: Sequence[Pair]) -> list[str]:
    """Swap two seats as long as that is better."""
    here, cost = seats, _cost(seats, pairs)
    while True:
        swapped = []
        for i, j in combinations(range(len(here)), 2):
            other = list(here)
            other[i], other[j] = other[j], other[i]
            swapped.append(other)
        best = min(swapped, key=lambda seating: _cost(seating, pairs), default=here)
        if _cost(best, pairs) >= cost:
            return here
        here, cost = best, _cost(best, pairs)


def _cells(seats: Sequence[str]) -> dict[str, Cell]:
    columns = len(seats) // 2
    return {name: divmod(index, columns) for index, name in enumerate(seats)}


def _cost(seats: Sequence[str], pairs: Sequence[Pair]) -> int:
    """Lengths and crossings; round outside is worst. The weights are estimates, judged by the look
    of the result.
    """
    cells = _cells(seats)
    ends = [(cells[a], cells[b]) for a, b in pairs]
    across = [(a[1], b[1]) if a[0] == 0 else (b[1], a[1]) for a, b in ends if a[0] != b[0]]
    crossings = sum((a - c) * (b - d) < 0 for (a, b), (c, d) in combinations(across, 2))
    return 40 * crossings + sum(_length(a, b) for a, b in ends)


def _length(one: Cell, other: Cell) -> int:
    distance = abs(one[1] - other[1])
    if one[0] != other[0]:
        return 10 + 15 * distance
    return 11 if distance == 1 else 40 + 20 * distance


def tracks(spans: Sequence[Span], gap: float = 8.0) -> list[int]:
    """A track (0: the innermost) for each span, short ones inside; spans in one track are `gap`
    apart.
    """
    taken: list[list[Span]] = []
    found = [0] * len(spans)
    for index in sorted(range(len(spans)), key=lambda i: (abs(spans[i][1] - spans[i][0]), i)):
        low, high = sorted(spans[index])
        track = 0
        while track < len(taken) and any(low < b + gap and a < high + gap for a, b in taken[track]):
            track += 1
        if track == len(taken):
            taken.append([])
        taken[track].append((low, high))
        found[index] = track
    return found


def spread(count: int, low: float, high: float) -> list[float]:
    """Return `count` positions between two ends, at equal distances."""
    return [low + (high - low) * (number + 1) / (count + 1) for number in range(count)]

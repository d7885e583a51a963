"""A drawing: boxes, lines, arrows and words put at places [px], written as SVG. It knows how wide words are, roughly.

What is placed is kept as rectangles too, so that layouts (and their tests) can ask what overlaps. Arrow heads are
polygons and nothing has an id, so that any number of drawings can stand in one page.
"""

from collections.abc import Sequence
from html import escape
from math import fsum, hypot
from typing import NamedTuple

from topdown.draw import style

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
        return (
            self.x < other.right + gap
            and other.x < self.right + gap
            and self.y < other.bottom + gap
            and other.y < self.bottom + gap
        )


def size_of(css: str) -> float:
    """The size of letters of a class [px]."""
    return next((SIZES[word] for word in css.split() if word in SIZES), SIZE)


def width_of(words: str, css: str = "") -> float:
    """Return the width of words, rather too wide than too narrow [px]."""
    ems = fsum(0.34 if c in _NARROW else 0.92 if c in _WIDE else 0.7 if c.isupper() else 0.57 for c in words)
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
        """Return the visible rectangle: everything drawn and a margin."""
        if not self._extent:
            return Box(0, 0, 2 * MARGIN, 2 * MARGIN)
        left, top = min(b.x for b in self._extent) - MARGIN, min(b.y for b in self._extent) - MARGIN
        right, bottom = max(b.right for b in self._extent) + MARGIN, max(b.bottom for b in self._extent) + MARGIN
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
            f'<rect class="{css}" x="{x}" y="{y}" width="{width}" height="{height}" rx="{_number(corner)}"/>'
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
        corners = [(x1, y1), *((x1 - 10 * ux - s * 4.5 * uy, y1 - 10 * uy + s * 4.5 * ux) for s in (1, -1))]
        path = " ".join(f"{_number(x)},{_number(y)}" for x, y in corners)
        self._items.append(f'<polygon class="{head}" points="{path}"/>')

    def words(self, at: Point, words: str, css: str = "", anchor: str = "start") -> Box:
        """Words with their base line at a point; `anchor`: start, middle or end. The rectangle they take."""
        width, size = width_of(words, css), size_of(css)
        left = at[0] - {"start": 0.0, "middle": width / 2, "end": width}[anchor]
        taken = Box(left, at[1] - size, width, 1.2 * size)
        self._extent.append(taken)
        self.labels.append(taken)
        x, y = (_number(value) for value in at)
        place = "" if anchor == "start" else f' text-anchor="{anchor}"'
        dress = f' class="{css}"' if css else ""
        self._items.append(f'<text{dress} x="{x}" y="{y}"{place}>{escape(words)}</text>')
        return taken

    def patched(self, at: Point, words: str, css: str = "", anchor: str = "start") -> Box:
        """Words on a patch of ground, so that lines behind do not disturb."""
        width, size = width_of(words, css), size_of(css)
        left = at[0] - {"start": 0.0, "middle": width / 2, "end": width}[anchor]
        self.box(Box(left - 3, at[1] - size, width + 6, 1.3 * size), "patch", 2, solid=False)
        return self.words(at, words, css, anchor)

    def svg(self, alone: bool = True) -> str:
        """The drawing; `alone`: with its own style, as a file, else for a page that has the style."""
        frame = self.frame
        left, top, width, height = (_number(value) for value in frame)
        rules = f"<style>{escape(style.drawing_rules(), quote=False)}</style>\n" if alone else ""
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


def _number(value: float) -> str:
    """A coordinate to a tenth of a pixel."""
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text

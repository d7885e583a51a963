"""Sequence diagrams (the paper's Figures 8 and 9): two lifelines, what is said in order, frames around alternatives.

The same parts as drawing and as text; both go down the page one row after the other.
"""

import textwrap
from collections.abc import Mapping

import msgspec

from fipa_codec.performatives import Performative
from fipa_codec.tables import Role
from topdown.draw.canvas import Box, Canvas, width_of
from topdown.draw.exchange import Frame, Part, Remark, Said

STEP = 14.0  # how much further in each frame stands [px]
LEAST = 340.0  # least distance of the lifelines [px]
HEAD = 20.0

NAMED = 3  # classes of a content that are named in a diagram

Content = tuple[str, tuple[str, ...]]
"""A language, and what may be said in it (nothing: no content)."""
Carried = Mapping[tuple[Role, Performative], tuple[Content, ...]]


class Cast(msgspec.Struct, frozen=True):
    """Names of the roles, and the contents of each act."""

    initiator: str
    participant: str
    carries: Carried = {}

    def name(self, role: Role) -> str:
        """The player of a role."""
        return self.initiator if role is Role.INITIATOR else self.participant

    def detail(self, said: Said) -> str:
        """Return the content of these acts in words: languages, and classes of each."""
        languages: dict[str, dict[str, None]] = {}
        for act in said.acts:
            for language, names in self.carries.get((said.sender, act), ()):
                languages.setdefault(language, {}).update(dict.fromkeys(names or ("no content",)))
        return "; ".join(f"{language}: {_few(list(names))}" for language, names in languages.items())


def _few(names: list[str]) -> str:
    if len(names) > NAMED + 1:
        names = [*names[:NAMED], f"{len(names) - NAMED} more"]
    return ", ".join(names)


def words_of(said: Said) -> str:
    """The words one side says one of."""
    *first, last = said.words
    return f"{', '.join(first)} or {last}" if first else last


def depth_of(parts: tuple[Part, ...]) -> int:
    """Return the depth of nested frames."""
    inner = [depth_of(branch) for part in parts if isinstance(part, Frame) for branch in part.branches]
    return 1 + max(inner) if inner else 0


def draw(parts: tuple[Part, ...], cast: Cast, title: str) -> Canvas:
    """The diagram as a drawing."""
    return _Drawing(parts, cast, title).canvas


class _Drawing:
    def __init__(self, parts: tuple[Part, ...], cast: Cast, title: str) -> None:
        self.canvas, self.cast = Canvas(title), cast
        self.depth = depth_of(parts)
        names = (cast.initiator, cast.participant)
        self.half = max(42.0, *(width_of(name, "strong large") / 2 + 14 for name in names))
        self.left = self.half + STEP * self.depth
        self.right = self.left + max(LEAST, self._widest(parts) + 40)
        self.lines: list[tuple[float, float]] = []
        self.y = 44.0
        self._parts(parts, 0)
        self.y += 14
        self._lifelines(names)

    def _widest(self, parts: tuple[Part, ...]) -> float:
        widths = [0.0]
        for part in parts:
            if isinstance(part, Said):
                widths += [width_of(words_of(part), "strong"), width_of(self.cast.detail(part), "small")]
            elif isinstance(part, Frame):
                widths += [width_of(part.title, "small") + 60, *(self._widest(branch) for branch in part.branches)]
        return max(widths)

    def _lifelines(self, names: tuple[str, str]) -> None:
        under = Canvas(self.canvas.title)
        for x, name in zip((self.left, self.right), names, strict=True):
            under.line([(x, 30), (x, self.y)], "life")
            under.box(Box(x - self.half, 0, 2 * self.half, 30), "box")
            under.words((x, 20), name, "strong large", "middle")
        self.canvas.put_under(under)

    def _parts(self, parts: tuple[Part, ...], depth: int) -> None:
        for part in parts:
            if isinstance(part, Said):
                self._said(part)
            elif isinstance(part, Frame):
                self._frame(part, depth)
            else:
                self._remark(part)

    def _said(self, said: Said) -> None:
        ends = (self.left, self.right) if said.sender is Role.INITIATOR else (self.right, self.left)
        middle = (self.left + self.right) / 2
        self.y += 26
        self.canvas.patched((middle, self.y - 7), words_of(said), "strong", "middle")
        self.canvas.arrow([(ends[0], self.y), (ends[1], self.y)])
        if detail := self.cast.detail(said):
            self.y += 15
            self.canvas.patched((middle, self.y), detail, "small quiet", "middle")
        self.y += 6

    def _remark(self, remark: Remark) -> None:
        self.y += 20
        middle = (self.left + self.right) / 2
        self.canvas.patched((middle, self.y), remark.text, "small quiet", "middle")
        self.y += 4

    def _frame(self, frame: Frame, depth: int) -> None:
        x, top = STEP * depth, self.y + 10
        width = self.right + self.left - 2 * x
        self.y = top + HEAD
        for number, branch in enumerate(frame.branches):
            if number:
                self.y += 10
                self.canvas.line([(x, self.y), (x + width, self.y)], "life")
            self._parts(branch, depth + 1)
        self.y += 12
        self.canvas.box(Box(x, top, width, self.y - top), "frame", 3, solid=False)
        tab = width_of(frame.kind, "strong small") + 16
        self.canvas.box(Box(x, top, tab, 17), "tab", 3, solid=False)
        self.canvas.words((x + 8, top + 12.5), frame.kind, "strong small")
        if frame.title:
            self.canvas.patched((x + tab + 8, top + 12.5), f"[{frame.title}]", "small")
        self.y += 4


def plain(parts: tuple[Part, ...], cast: Cast, width: int) -> str:
    """The diagram as text."""
    gutter = 2 * depth_of(parts) + 5
    span = max(24, min(width - gutter, 86))
    left, right = cast.initiator, cast.participant
    head = f"{' ' * gutter}{left}{right.rjust(span - len(left))}"
    return "\n".join([head, *_lines(parts, cast, "", gutter, span)])


def _lines(parts: tuple[Part, ...], cast: Cast, bars: str, gutter: int, span: int) -> list[str]:
    lines: list[str] = []
    for part in parts:
        if isinstance(part, Said):
            lines += [f"{bars.ljust(gutter)}{text}" for text in _arrow(part, cast, span)]
        elif isinstance(part, Remark):
            lines += _between(bars, [part.text], gutter, span)
        else:
            title = textwrap.wrap(f"[{part.title}]", span - 4) if part.title else [""]
            for number, branch in enumerate(part.branches):
                opening = f"{bars}├ or" if number else f"{bars}┌ {part.kind}"
                lines += _between(opening, [""] if number else title, gutter, span)
                lines += _lines(branch, cast, f"{bars}│ ", gutter, span)
            lines += _between(f"{bars}└", [""], gutter, span)
    return lines


def _between(gutter_text: str, words: list[str], gutter: int, span: int) -> list[str]:
    """Words between the lifelines."""
    return [f"{gutter_text.ljust(gutter)}│{line.center(span - 2)}│" for line in words]


def _arrow(said: Said, cast: Cast, span: int) -> list[str]:
    words = textwrap.wrap(words_of(said), span - 8)
    above = [f"│{line.center(span - 2)}│" for line in words[:-1]]
    label = f" {words[-1]} ".center(span - 3, "─")
    shaft = f"├{label}▶│" if said.sender is Role.INITIATOR else f"│◀{label}┤"
    details = textwrap.wrap(cast.detail(said), span - 6)
    return [*above, shaft, *(f"│{line.center(span - 2)}│" for line in details)]

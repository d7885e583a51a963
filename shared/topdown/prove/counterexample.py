"""A counterexample as a sequence diagram with states: as text for a terminal, and as SVG.

A message that is sent and one that is taken are two steps, maybe far apart, so each is half an arrow: it leaves its
sender, or arrives at its receiver. What happens to one agent alone stands at its lifeline; states stand where they
change.
"""

import re
import textwrap
from collections.abc import Iterator, Mapping
from html import escape
from typing import NamedTuple

from topdown.prove.engine import Finding, Step

MARGIN = 5
"""Columns for the number of a step."""
NARROWEST, WIDEST = 18, 40
_ARROW = re.compile(r"(?P<text>.+?) (?P<way>->|<-) (?P<peer>.+)")


class Part(NamedTuple):
    """Part of a step: `way` "->" sent to `peer`, "<-" taken from it, "" an event of its own."""

    text: str
    way: str = ""
    peer: str = ""


def parts(step: Step, lifelines: list[str]) -> Iterator[Part]:
    """The parts of a step in their order; words without a peer that has a lifeline stay together."""
    own: list[str] = []
    for piece in re.split(r"[;,] ", step.what):
        match = _ARROW.fullmatch(piece)
        if match and match["peer"] in lifelines and match["peer"] != step.who:
            text, way, peer = match["text"], match["way"], match["peer"]
            beside = abs(lifelines.index(peer) - lifelines.index(step.who)) == 1
            yield Part(text if beside else f"{text} {'to' if way == '->' else 'from'} {peer}", way, peer)
        else:
            own.append(piece)
    if own:
        yield Part(", ".join(own))


def lifelines(finding: Finding) -> list[str]:
    """All who are in a state, then those who only do something (a wire)."""
    return list(dict.fromkeys([*finding.start, *(step.who for step in finding.trace)]))


def changes(before: Mapping[str, str], after: Mapping[str, str]) -> dict[str, str]:
    """Return the states that changed, by name."""
    return {name: state for name, state in after.items() if before.get(name) != state}


# --- text -------------------------------------------------------------------------------------------------------------


class _Sheet:
    """Lines of text with lifelines in them."""

    def __init__(self, names: list[str], width: int) -> None:
        self.names = names
        self.column = max(NARROWEST, min(WIDEST, (width - MARGIN) // max(1, len(names))))
        self.width = MARGIN + self.column * len(names)
        self.places = {name: MARGIN + self.column * number for number, name in enumerate(names)}
        self.lines: list[str] = []

    def line(self, texts: list[tuple[int, str]], lifelines: bool = True) -> None:
        """One line: each text from its column on, the lifelines behind them."""
        cells = [" "] * (self.width + self.column)
        for place in self.places.values() if lifelines else ():
            cells[place] = "|"
        for place, text in texts:
            start = max(0, place)
            cells[start : start + len(text)] = list(text)[: len(cells) - start]
        self.lines.append("".join(cells).rstrip())

    def words(self, name: str, text: str, mark: str, room: int) -> None:
        """Words at a lifeline, over as many lines as they need."""
        for number, line in enumerate(textwrap.wrap(text, max(room, 12)) or [""]):
            self.line([(self.places[name], (mark if number == 0 else "| ") + line)])

    def part(self, who: str, part: Part) -> None:
        """Half an arrow, or an event."""
        here = self.places[who]
        if not part.way:
            self.words(who, part.text, "* ", self.width - here - 2)
            return
        right = self.places[part.peer] > here
        room = (self.width - here if right else here - MARGIN) - 7
        arrow = f"--{part.text if len(part.text) <= room else part.text[: room - 1] + '…'}--"
        leaves = part.way == "->"
        tail = f"{arrow}>" if leaves == right else f"<{arrow}"
        if right:
            self.line([(here, f"o{tail}")])
        else:
            self.line([(here - len(tail), f"{tail}o")])

    def states(self, states: Mapping[str, str]) -> None:
        """The new states, each at its lifeline, in brackets."""
        wrapped = {name: textwrap.wrap(f"[{state}]", self.column - 2) for name, state in states.items() if state}
        for number in range(max(map(len, wrapped.values()), default=0)):
            shown = {name: lines[number] for name, lines in wrapped.items() if number < len(lines)}
            self.line([(self.places[name] + (0 if number == 0 else 1), text) for name, text in shown.items()])


def as_text(finding: Finding, width: int = 100) -> str:
    """A sequence diagram at most `width` columns wide, if the lifelines have room in it."""
    names = lifelines(finding)
    sheet = _Sheet(names, width)
    sheet.lines += textwrap.wrap(f"{finding.kind}: {finding.text}", width)
    sheet.line([(sheet.places[name], name) for name in names], lifelines=False)
    sheet.states(finding.start)
    before = finding.start
    for number, step in enumerate(finding.trace, start=1):
        first = len(sheet.lines)
        for part in parts(step, names):
            sheet.part(step.who, part)
        sheet.lines[first] = f"{number:>3}" + sheet.lines[first][3:]
        sheet.states(changes(before, step.after))
        before = step.after
    return "\n".join(sheet.lines)


# --- SVG --------------------------------------------------------------------------------------------------------------

COLUMN, ROW, LETTER = 250, 26, 6.6
"""Pixels between lifelines, for a line of text, and for a letter of the 11-pixel font (measured on DejaVu Sans)."""
_STYLE = """text{font:11px sans-serif;fill:#1b1f24}.name{font-weight:bold;font-size:13px}.life{stroke:#b6bec8}
.arrow{stroke:#0550ae;stroke-width:1.5}.head{fill:#0550ae}.state{fill:#fff8e1;stroke:#c9a227}.number{fill:#6e7781}
.wrong{fill:#b3261e;font-weight:bold}"""


class _Picture:
    """Rows of shapes, from top to bottom."""

    def __init__(self, names: list[str]) -> None:
        self.places = {name: 150 + COLUMN * number for number, name in enumerate(names)}
        self.shapes: list[str] = []
        self.y = 62

    def text(self, x: float, text: str, kind: str = "", anchor: str = "start") -> None:
        """Words in the present row."""
        place = f'x="{x:.0f}" y="{self.y}"'
        self.shapes.append(f'<text {place} class="{kind}" text-anchor="{anchor}">{escape(text)}</text>')

    def part(self, who: str, part: Part) -> None:
        """Half an arrow with its words above, or a dot with words."""
        here = self.places[who]
        if not part.way:
            self.shapes.append(f'<circle cx="{here}" cy="{self.y - 4}" r="3.5" class="head"/>')
            self.text(here + 9, part.text)
            self.y += ROW
            return
        side = 1 if self.places[part.peer] > here else -1
        far = here + side * max(90.0, len(part.text) * LETTER + 14)
        self.text((here + far) / 2, part.text, anchor="middle")
        self.y += 8
        start, end = (here, far) if part.way == "->" else (far, here)
        back = end - 8 if end > start else end + 8
        self.shapes.append(f'<line x1="{start:.0f}" y1="{self.y}" x2="{end:.0f}" y2="{self.y}" class="arrow"/>')
        points = f"{end:.0f},{self.y} {back:.0f},{self.y - 4} {back:.0f},{self.y + 4}"
        self.shapes.append(f'<polygon points="{points}" class="head"/>')
        self.y += ROW - 6

    def states(self, states: Mapping[str, str]) -> None:
        """The new states in boxes on their lifelines."""
        boxes = {name: textwrap.wrap(state, 34) for name, state in states.items() if state}
        most = max(map(len, boxes.values()), default=0)
        for name, lines in boxes.items():
            wide, high, x = max(map(len, lines)) * LETTER + 14, 14 * len(lines) + 6, self.places[name]
            box = f'x="{x - wide / 2:.0f}" y="{self.y - 12}" width="{wide:.0f}" height="{high}" rx="4"'
            self.shapes.append(f'<rect {box} class="state"/>')
            for number, line in enumerate(lines):
                place = f'x="{x}" y="{self.y + 14 * number}"'
                self.shapes.append(f'<text {place} text-anchor="middle">{escape(line)}</text>')
        self.y += 14 * most + 14 if most else 0


def as_svg(finding: Finding) -> str:
    """The same as a picture that needs nothing else."""
    names = lifelines(finding)
    picture = _Picture(names)
    picture.states(finding.start)
    before = finding.start
    for number, step in enumerate(finding.trace, start=1):
        picture.text(28, str(number), "number", "end")
        for part in parts(step, names):
            picture.part(step.who, part)
        picture.states(changes(before, step.after))
        before = step.after
    wide, high = 150 + COLUMN * len(names), picture.y + 10
    heads = [f'<text x="14" y="20" class="wrong">{escape(f"{finding.kind}: {finding.text}")}</text>']
    for name, x in picture.places.items():
        heads.append(f'<text x="{x}" y="42" class="name" text-anchor="middle">{escape(name)}</text>')
        heads.append(f'<line x1="{x}" y1="48" x2="{x}" y2="{high - 4}" class="life"/>')
    size = f'width="{wide}" height="{high}" viewBox="0 0 {wide} {high}"'
    ground = f'<rect width="{wide}" height="{high}" fill="#fff"/>'
    body = "\n".join([f"<style>{_STYLE}</style>", ground, *heads, *picture.shapes])
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">\n{body}\n</svg>\n'

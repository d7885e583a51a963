"""A counterexample as a sequence diagram with states, as text for a terminal.

A message that is sent and one that is taken are two steps, maybe far apart, so each is half an
arrow: it leaves its sender, or arrives at its receiver. What happens to one agent alone stands at
its lifeline; states stand where they change.
"""

import re
import textwrap
from collections.abc import Iterator, Mapping
from itertools import zip_longest
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
    """The parts of a step in their order; words without a peer that has a lifeline stay
    together.
    """
    own: list[str] = []
    for piece in re.split(r"[;,] ", step.what):
        match = _ARROW.fullmatch(piece)
        if match and match["peer"] in lifelines and match["peer"] != step.who:
            text, way, peer = match["text"], match["way"], match["peer"]
            if abs(lifelines.index(peer) - lifelines.index(step.who)) != 1:
                text += f" {'to' if way == '->' else 'from'} {peer}"
            yield Part(text, way, peer)
        else:
            own.append(piece)
    if own:
        yield Part(", ".join(own))


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

    def part(self, who: str, part: Part) -> None:
        """Half an arrow, or an event."""
        here = self.places[who]
        if not part.way:
            lines = textwrap.wrap(part.text, max(self.width - here - 2, 12)) or [""]
            for number, line in enumerate(lines):
                self.line([(here, ("| " if number else "* ") + line)])
            return
        right = self.places[part.peer] > here
        room = (self.width - here if right else here - MARGIN) - 7
        arrow = f"--{part.text if len(part.text) <= room else part.text[: room - 1] + '…'}--"
        leaves = part.way == "->"
        tail = f"{arrow}>" if leaves == right else f"<{arrow}"
        self.line([(here, f"o{tail}") if right else (here - len(tail), f"{tail}o")])

    def states(self, states: Mapping[str, str]) -> None:
        """The new states, each at its lifeline, in brackets."""
        room = self.column - 2
        wrapped = [textwrap.wrap(f"[{state}]", room) if state else [] for state in states.values()]
        places = [self.places[name] for name in states]
        for number, row in enumerate(zip_longest(*wrapped, fillvalue="")):
            indent = 1 if number else 0
            self.line([(at + indent, text) for at, text in zip(places, row, strict=True) if text])


def as_text(finding: Finding, width: int = 100) -> str:
    """A sequence diagram at most `width` columns wide, if the lifelines have room in it."""
    # all who are in a state, then those who only do something (a wire)
    names = list(dict.fromkeys([*finding.start, *(step.who for step in finding.trace)]))
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
        sheet.states({who: now for who, now in step.after.items() if before.get(who) != now})
        before = step.after
    return "\n".join(sheet.lines)

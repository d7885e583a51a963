"""A trace as a tree of lines with times and bars. Pure: a trace in, text out, as wide as it is
told.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import fsum

import msgspec
from rich.table import Table
from rich.text import Text

from console.terminal.sequence import seconds
from console.terminal.table import table
from operate.tracing.trace import Known, Message, Span, Trace

MOST_BAR, LEAST_BAR = 24, 12
"""Columns of the bars: a fifth of the width, within these bounds (estimates)."""
ALIKE = 4
"""So many conversations of the same kind in a row become one line (estimate: fewer are read one by
one).
"""
RESTING = "subscribe"
"""A protocol that is told of by its contents alone."""
CALM, WRONG, OPEN = "green", "red", "cyan"
NOTE = "~ by time: no step log says what caused it"


class Line(msgspec.Struct, frozen=True):
    """A line of the tree: `branch` draws its place, `what` says what it is; times in unix seconds
    (None: no bar).
    """

    branch: str
    what: str
    who: str
    start: float
    end: float | None
    style: str
    guessed: bool = False
    result: str = ""


def drawn(trace: Trace, root: Span, width: int, *, every: bool = False) -> Table:
    """The tree below a span; `every`: also many alike get a line each."""
    lines = list(_lines(trace, root, every=every))
    until = max(line.end or line.start for line in lines)
    bar = min(MOST_BAR, max(LEAST_BAR, width // 5))
    results = any(line.result for line in lines)
    heads = (root.id, *("",) * (1 + results), "at", "took", " ")
    least, times = {" ": bar}, ("at", "took")
    drawn = table(heads, right=times, cut=(root.id,), least=least, width=width)
    for line in lines:
        what = Text.assemble((line.branch, "dim"), line.what)
        ended = [Text(line.result, line.style)] if results else []
        at = f"{'~ ' if line.guessed else ''}{line.start - trace.begin:.3f}"
        took = "" if line.end is None else seconds(line.end - line.start)
        drawn_bar = Text(_bar(line, root.start, until, bar), line.style)
        drawn.add_row(what, Text(line.who, "dim"), *ended, at, took, drawn_bar)
    if any(line.guessed for line in lines):
        drawn.caption, drawn.caption_justify = NOTE, "left"
    return drawn


def listed(trace: Trace, width: int) -> Table:
    """All that can be traced, oldest first."""
    numbers = ("at", "took", "said")
    drawn = table(("task", "between", *numbers, "what"), right=numbers, cut=("what",), width=width)
    for root in trace.roots:
        below = [span for _, span in trace.below(root)]
        who, at = f"{root.initiator} > {root.participant}", f"{root.start - trace.begin:.3f}"
        took = seconds(max(span.end for span in below) - root.start)
        said = str(sum(len(span.messages) for span in below))
        ended = (f"  {result(root)}", style_of(root))
        what = Text.assemble(root.text or root.protocol, ended)
        drawn.add_row(root.id, who, at, took, said, what)
    return drawn


def result(span: Span) -> str:
    """Return the act of a no that ended a conversation, "open" where it goes on, else ""."""
    return "open" if not span.ended else span.last.performative if span.bad else ""


def style_of(span: Span) -> str:
    """The colour of a conversation."""
    return WRONG if span.bad else CALM if span.ended else OPEN


def _lines(
    trace: Trace, span: Span, branch: str = "", below: str = "", *, every: bool
) -> Iterator[Line]:
    """Yield the lines of a span and of all below it; `branch` leads to it, `below` to what is under
    it.
    """
    yield _line((span,), branch)
    rows: list[tuple[Span, ...] | tuple[Message, ...]] = []
    for _, beside in groupby(span.beside, key=lambda one: (one.sender, one.receiver, one.protocol)):
        rows.append(tuple(beside))
    rows += _grouped(trace, trace.children(span), every=every)
    rows.sort(key=lambda row: row[0].sent if isinstance(row[0], Message) else row[0].start)
    for n, row in enumerate(rows):
        last = n == len(rows) - 1
        here, under = below + ("└─ " if last else "├─ "), below + ("   " if last else "│  ")
        if isinstance(row[0], Message):
            yield _beside(tuple(one for one in row if isinstance(one, Message)), here)
        elif len(row) == 1:
            yield from _lines(trace, row[0], here, under, every=every)
        else:
            yield _line(tuple(one for one in row if isinstance(one, Span)), here)


def _grouped(trace: Trace, children: Sequence[Span], *, every: bool) -> Iterator[tuple[Span, ...]]:
    """Yield children one by one; those alike that follow each other, with nothing below them,
    together.
    """
    for _, alike in groupby(
        children, key=lambda one: (one.protocol, one.initiator, one.participant, one.bad)
    ):
        row = tuple(alike)
        leaves = not any(trace.children(one) or one.beside for one in row)
        if every or not leaves or len(row) < ALIKE:
            yield from ((one,) for one in row)
        else:
            yield row


def _line(alike: tuple[Span, ...], branch: str) -> Line:
    """Return the line of a conversation, or of several alike."""
    first, end = alike[0], alike[-1].end
    what, ended = first.text or first.protocol, result(first)
    if len(alike) > 1:
        busy = fsum(one.end - one.start for one in alike)
        what = f"{len(alike)} x {first.protocol}, {seconds(busy)} in all"
        ended = result(first) if first.bad else ""
    who = f"{first.initiator} > {first.participant}"
    guessed = any(one.known == Known.TIME for one in alike)
    return Line(branch, what, who, first.start, end, style_of(first), guessed, ended)


def _beside(said: tuple[Message, ...], branch: str) -> Line:
    more = f" and {len(said) - 1} more" if len(said) > 1 else ""
    first, guessed = said[0], any(one.known == Known.TIME for one in said)
    where = f"{first.conversation}: " if first.protocol != RESTING else ""
    what = f"+ {where}{first.text or first.performative}{more}"
    who = f"{first.sender} > {first.receiver}"
    return Line(branch, what, who, first.sent, None, "dim", guessed)


def _bar(line: Line, begin: float, until: float, columns: int) -> str:
    """A bar from the start of a line to its end, at the scale of the tree; a mark for a moment."""
    scale = columns / (until - begin) if until > begin else 0.0
    left = min(columns - 1, max(0, int((line.start - begin) * scale)))
    if line.end is None:
        return " " * left + "·"
    right = min(columns, max(left + 1, round((line.end - begin) * scale)))
    return " " * left + "━" * (right - left)

"""A trace as a tree of lines with times and bars. Pure: a trace in, text out, as wide as it is
told.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import fsum

import msgspec
from rich.table import Table
from rich.text import Text

from operate.cli.terminal.sequence import seconds
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
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", width=width)
    table.add_column(f"{root.id}", no_wrap=True, overflow="ellipsis", ratio=1)
    table.add_column("", no_wrap=True)
    if any(line.result for line in lines):
        table.add_column("", no_wrap=True)
    table.add_column("at", no_wrap=True, justify="right")
    table.add_column("took", no_wrap=True, justify="right")
    table.add_column("", no_wrap=True, width=bar)
    for line in lines:
        what = Text.assemble((line.branch, "dim"), line.what)
        at = f"{'~ ' if line.guessed else ''}{line.start - trace.begin:.3f}"
        took = "" if line.end is None else seconds(line.end - line.start)
        ended = [Text(line.result, line.style)] if any(one.result for one in lines) else []
        table.add_row(
            what,
            Text(line.who, "dim"),
            *ended,
            at,
            took,
            Text(_bar(line, root.start, until, bar), line.style),
        )
    if any(line.guessed for line in lines):
        table.caption, table.caption_justify = NOTE, "left"
    return table


def listed(trace: Trace, width: int) -> Table:
    """All that can be traced, oldest first."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", width=width)
    for name, justify in (
        ("task", "left"),
        ("between", "left"),
        ("at", "right"),
        ("took", "right"),
        ("said", "right"),
    ):
        table.add_column(name, no_wrap=True, justify=justify)  # type: ignore[arg-type]
    table.add_column("what", no_wrap=True, overflow="ellipsis", ratio=1)
    for root in trace.roots:
        below = [span for _, span in trace.below(root)]
        took = seconds(max(span.end for span in below) - root.start)
        row = (
            root.id,
            f"{root.initiator} > {root.participant}",
            f"{root.start - trace.begin:.3f}",
            took,
        )
        said = str(sum(len(span.messages) for span in below))
        table.add_row(
            *row,
            said,
            Text.assemble(root.text or root.protocol, (f"  {result(root)}", style_of(root))),
        )
    return table


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
    yield _line(span, branch)
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
            yield _many(tuple(one for one in row if isinstance(one, Span)), here)


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


def _line(span: Span, branch: str) -> Line:
    who, guessed = f"{span.initiator} > {span.participant}", span.known == Known.TIME
    what = span.text or span.protocol
    return Line(branch, what, who, span.start, span.end, style_of(span), guessed, result(span))


def _many(alike: tuple[Span, ...], branch: str) -> Line:
    first, last = alike[0], alike[-1]
    busy = fsum(one.end - one.start for one in alike)
    what = f"{len(alike)} x {first.protocol}, {seconds(busy)} in all"
    who, guessed = (
        f"{first.initiator} > {first.participant}",
        any(one.known == Known.TIME for one in alike),
    )
    return Line(
        branch,
        what,
        who,
        first.start,
        last.end,
        style_of(first),
        guessed,
        result(first) if first.bad else "",
    )


def _beside(said: tuple[Message, ...], branch: str) -> Line:
    more = f" and {len(said) - 1} more" if len(said) > 1 else ""
    where = f"{said[0].conversation}: " if said[0].protocol != RESTING else ""
    what = f"+ {where}{said[0].text or said[0].performative}{more}"
    guessed = any(one.known == Known.TIME for one in said)
    return Line(
        branch, what, f"{said[0].sender} > {said[0].receiver}", said[0].sent, None, "dim", guessed
    )


def _bar(line: Line, begin: float, until: float, columns: int) -> str:
    """A bar from the start of a line to its end, at the scale of the tree; a mark for a moment."""
    scale = columns / (until - begin) if until > begin else 0.0
    left = min(columns - 1, max(0, int((line.start - begin) * scale)))
    if line.end is None:
        return " " * left + "·"
    right = min(columns, max(left + 1, round((line.end - begin) * scale)))
    return " " * left + "━" * (right - left)

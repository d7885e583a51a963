"""`roco trace`: one task across all agents, as a tree of conversations with times, or as spans of
OpenTelemetry; `roco why`: its recorded reasons; `roco conversation`: the conversations of a run.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from enum import StrEnum
from itertools import groupby
from math import fsum
from typing import Annotated

import msgspec
from rich.table import Table
from rich.text import Text

from console.errors import ConsoleError, UsageError
from console.fleet import targets
from console.output import Form, Format, RunDir, option, tell, tell_json
from console.terminal import sequence
from console.terminal.console import Console, table
from console.terminal.sequence import seconds
from console.traffic import listen
from console.traffic.listen import Recorded, Subject, about, recording_of
from operate.structs import alike
from operate.tracing import otlp
from operate.tracing.reasons import Fact, Why
from operate.tracing.trace import Known, Message, Span, Trace, is_meant
from operate.verdict_lines import Judged, ended, sides
from topdown.judge.verdicts import Verdict
from topdown.model.design import Design


class As(StrEnum):
    """Format of a trace."""

    TEXT = "text"
    JSON = "json"
    OTLP = "otlp"


class Task(msgspec.Struct, frozen=True):
    """One line of `roco trace --format json` without a task."""

    task: str
    initiator: str
    participant: str
    protocol: str
    text: str
    start: float
    end: float
    ended: bool
    communicates: int


def trace(
    subject: Subject = "",
    every: Annotated[
        bool,
        option("A line for each conversation, also where many alike follow each other.", "--all"),
    ] = False,
    run: Recorded = None,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Annotated[
        As,
        option("text for people, json for programs, otlp for tools of OpenTelemetry.", "--format"),
    ] = As.TEXT,
) -> None:
    """Show which communicate of a task caused which, across all agents, as a tree with times.

    Without a subject all that can be traced is listed.

    A line is a conversation, below the one for whose sake it was opened; the bar says when it was
    open. What an answer caused elsewhere is a line with `+`. Links are those of the agents' step
    logs; where a log does not have one, the line is marked with ~ and stands where the order in
    time puts it. A recording without step logs has only such lines.

    `--format otlp` prints an OTLP file in JSON, as Jaeger and the OpenTelemetry collector read it:
    agents are services, each conversation is a client and a server span.

    Examples:
      roco trace
      roco trace SUBJECT
      roco trace SUBJECT --run runs/latest --all
      roco trace SUBJECT --format otlp
    """
    from operate.recording.run import opened

    file = recording_of(run, target, run_dir)
    found = opened(file).trace
    if not found.spans:
        raise UsageError(f"{file} has no communicate; give the folder of a run, or a recording")
    if not subject and form is not As.OTLP:
        _list(found, form)
        return
    roots = (span_of(found, subject),) if subject else found.roots
    if form is As.OTLP:
        tell_json(otlp.exported(found, roots))
    elif form is As.JSON:
        tell_json(
            msgspec.structs.replace(found, spans=tuple(one for _, one in found.below(roots[0])))
        )
    else:
        console = Console()
        console.print(tree(found, roots[0], console.width, every=every))


def span_of(found: Trace, subject: str) -> Span:
    """Return the span of a conversation. Raise ConsoleError with those that there are."""
    if (span := found.named(subject)) is not None:
        return span
    near = ", ".join(span.id for span in found.roots[-8:]) or "none"
    raise ConsoleError(
        f"no conversation {subject!r} in this run; `roco trace` lists what can be traced, such as"
        f" {near}"
    )


def _list(found: Trace, form: As) -> None:
    if form is As.JSON:
        tell_json([_task(found, span) for span in found.roots])
        return
    console = Console()
    console.print(listing(found, console.width))


def _task(found: Trace, span: Span) -> Task:
    below = [one for _, one in found.below(span)]
    end, said = max(one.end for one in below), sum(len(one.messages) for one in below)
    return alike(Task, span, task=span.id, end=end, communicates=said)


# --- `roco why`: the recorded reasons of a task, or of what is believed of a thing ----------------


TIME = 9
"""Columns of the time."""


def why(
    subject: Subject = "",
    run: Recorded = None,
    at: Annotated[
        float | None,
        option(
            "Of a thing: as believed that many seconds after the first communicate.",
            "--at",
            min=0.0,
        ),
    ] = None,
    records: Annotated[
        bool, option("Also the communicate or step that each sentence is from.", "--records")
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Tell why a task went as it did, from what is recorded.

    First comes a sentence as the robot tells it to a person, then how the task ended and what led
    to that, why it waited, which plans were made and rejected, and which agents were away. Without
    a subject it tells of the newest task. For a thing that the system knows it tells what is
    believed, since when, and by which observation. Each line repeats something that was recorded.
    Seconds count from the first communicate.

    Examples:
      roco why
      roco why SUBJECT --run runs/latest
      roco why THING --at 30
      roco why SUBJECT --records
    """
    from operate.recording.run import opened, reasons

    file = recording_of(run, target, run_dir)
    found = reasons(opened(file), subject, at)
    tell(found, form, lambda: _show(found, Console(), records=records))


def _show(found: Why, console: Console, *, records: bool) -> None:
    if found.sentence:
        console.print(Text(f"{found.sentence}\n"), soft_wrap=True)
    console.print(Text.assemble((found.about, "bold"), "  ", found.text), soft_wrap=False)
    for passage in found.passages:
        console.print(Text(f"\n{passage.title}", "bold"))
        for n, fact in enumerate(passage.facts):
            same = n > 0 and f"{fact.at:.2f}" == f"{passage.facts[n - 1].at:.2f}"
            _tell(fact, found.begin, console, repeated=same)
            if records and fact.record:
                console.print(Text(f"{'':{TIME + 2}}[{fact.record}]", "dim"), soft_wrap=True)


def _tell(fact: Fact, begin: float, console: Console, *, repeated: bool) -> None:
    """Print a sentence beside its time; the lines below it are indented likewise."""
    when = "" if repeated else f"{fact.at - begin:.2f} s"
    lines = Text(fact.text).wrap(console, max(20, console.width - TIME - 2))
    for n, line in enumerate(lines):
        console.print(
            Text.assemble((f"{when if not n else '':>{TIME}}  ", "dim"), line), soft_wrap=True
        )


# --- A trace as a tree of lines with times and bars -----------------------------------------------


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


def tree(trace: Trace, root: Span, width: int, *, every: bool = False) -> Table:
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


def listing(trace: Trace, width: int) -> Table:
    """All that can be traced, oldest first."""
    numbers = ("at", "took", "said")
    drawn = table(("task", "between", *numbers, "what"), right=numbers, cut=("what",), width=width)
    for root in trace.roots:
        below = [span for _, span in trace.below(root)]
        who, at = f"{root.initiator} > {root.participant}", f"{root.start - trace.begin:.3f}"
        took = seconds(max(span.end for span in below) - root.start)
        said = str(sum(len(span.messages) for span in below))
        ended = (f"  {result_of(root)}", style_of(root))
        what = Text.assemble(root.text or root.protocol, ended)
        drawn.add_row(root.id, who, at, took, said, what)
    return drawn


def result_of(span: Span) -> str:
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
    for _, same in groupby(
        children, key=lambda one: (one.protocol, one.initiator, one.participant, one.bad)
    ):
        row = tuple(same)
        leaves = not any(trace.children(one) or one.beside for one in row)
        if every or not leaves or len(row) < ALIKE:
            yield from ((one,) for one in row)
        else:
            yield row


def _line(alike: tuple[Span, ...], branch: str) -> Line:
    """Return the line of a conversation, or of several alike."""
    first, end = alike[0], alike[-1].end
    what, ended = first.text or first.protocol, result_of(first)
    if len(alike) > 1:
        busy = fsum(one.end - one.start for one in alike)
        what = f"{len(alike)} x {first.protocol}, {seconds(busy)} in all"
        ended = result_of(first) if first.bad else ""
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


# --- `roco conversation`: list the conversations of a run, show one as a sequence diagram ---------


class Conversation(msgspec.Struct, frozen=True):
    """A conversation: who opened it with whom, where it stands, all that was said in it; times in
    unix seconds.
    """

    id: str
    channel: str
    protocol: str
    initiator: str
    participant: str
    since: float
    until: float
    ended: bool
    states: tuple[str, str]
    violations: int
    said: tuple[Judged, ...]


def conversation(
    subject: listen.Subject = "",
    channel: listen.Channels = None,
    agent: listen.Agents = None,
    protocol: listen.Protocols = None,
    performative: listen.Performatives = None,
    open_: Annotated[
        bool | None, option("Only those that go on, or that ended.", "--open/--ended")
    ] = None,
    wrong: Annotated[
        bool, option("Only those with something against the design.", "--wrong")
    ] = False,
    run: listen.Recorded = None,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """List the conversations of a run, oldest first; show one as a sequence diagram.

    Of a running fleet so far, as its monitor judged them; of a recording as they are judged now. A
    conversation is listed if any of its messages matches. The diagram of one has what was said
    when, the states after it, and what the judge says.

    Examples:
      roco conversation --open
      roco conversation --channel CHANNEL --performative failure
      roco conversation --run recording.mcap --format json
      roco conversation AGENT-1-1
      roco conversation AGENT-1-3 --run recording.mcap --format json
    """
    design = about(run, run_dir, target).design
    which = listen.wanted(design, channel, agent, protocol, performative)
    kept = [
        one
        for one in conversations(listen.lines_of(run, target, run_dir), design)
        if any(map(which.keeps, one.said))
        and open_ in (None, not one.ended)
        and (one.violations or not wrong)
        and (not subject or is_meant(subject, one.id, one.participant))
    ]
    if subject and not kept:
        raise ConsoleError(
            f"no conversation {subject!r} in this run; `roco conversation` lists them"
        )
    if form is Format.JSON:
        tell_json(kept if subject else [msgspec.structs.replace(one, said=()) for one in kept])
        return
    console = Console()
    if subject:
        for one in kept:
            between = (one.initiator, one.participant)
            console.print(sequence.heading(one.channel, one.protocol, one.id, one.ended))
            console.print(sequence.drawn(one.said, *between, console.width))
    else:
        console.print(conversation_table(kept))
        console.print(f"{len(kept)} conversation{'s' * (len(kept) != 1)}", style="dim")


def conversations(lines: list[Judged], design: Design) -> list[Conversation]:
    """Return the traffic by conversation and pair of agents, oldest first."""
    grouped: defaultdict[tuple[str, str, frozenset[str]], list[Judged]] = defaultdict(list)
    for one in lines:
        if one.sender and one.verdict != Verdict.NOT_ENTITLED:
            both = frozenset((one.sender, one.receiver))
            grouped[one.conversation, one.protocol, both].append(one)
    return sorted((_made(said, design) for said in grouped.values()), key=lambda one: one.since)


def conversation_table(found: list[Conversation]) -> Table:
    """One line for each."""
    heads = ["conversation", "on", "protocol", "between", "said", "took", "states"]
    heads += ["wrong"] if any(one.violations for one in found) else []
    drawn = table(heads, right=("said", "took", "wrong"))
    for one in found:
        states = " / ".join(dict.fromkeys(filter(None, one.states)))
        between, took = f"{one.initiator} > {one.participant}", one.until - one.since
        row = (one.id, one.channel, one.protocol, between, str(len(one.said)))
        state = Text(states, "dim" if one.ended else "cyan")
        wrong = Text(str(one.violations or ""), "red")
        drawn.add_row(*(*row, sequence.seconds(took), state, wrong)[: len(heads)])
    return drawn


def _made(said: list[Judged], design: Design) -> Conversation:
    first = said[0]
    initiator, participant = sides(design, first.protocol, first.sender, first.receiver)
    told = ((one.initiator, one.participant) for one in reversed(said) if one.initiator)
    states = next(told, ("", ""))
    return Conversation(
        id=first.conversation,
        channel=first.channel,
        protocol=first.protocol,
        initiator=initiator,
        participant=participant,
        since=first.t,
        until=said[-1].t,
        ended=ended(design, first.protocol, states),
        states=states,
        violations=sum(one.violation for one in said),
        said=tuple(said),
    )

"""`roco trace`: one task across all agents, as a tree of conversations with times, or as spans of
OpenTelemetry; `roco why`: its recorded reasons.
"""

from enum import StrEnum
from typing import Annotated

import msgspec
from rich.text import Text

from console.errors import ConsoleError, UsageError
from console.fleet import targets
from console.output import Form, Format, RunDir, option, problems, tell, tell_json, waiting
from console.terminal import span_tree
from console.terminal.console import Console
from console.traffic.selection import Recorded, Subject, recording_of
from operate.structs import alike
from operate.tracing import otlp
from operate.tracing.reasons import Fact, Why
from operate.tracing.trace import Span, Trace


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
    with problems(Format.TEXT if form is As.TEXT else Format.JSON):
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
            console.print(span_tree.drawn(found, roots[0], console.width, every=every))


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
    console.print(span_tree.listed(found, console.width))


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
            "Of a thing: as it was believed then [s after the first communicate].", "--at", min=0.0
        ),
    ] = None,
    records: Annotated[
        bool, option("Also the communicate or step that each sentence is from.", "--records")
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Say why a task went as it did, from what is recorded.

    It says how it ended and what led to that, why it waited, which plans were made and what was
    rejected, and who was away. Without a subject it is the newest task. The subject may also be a
    thing that the system knows: then it says what is believed, since when, and by which
    observation. Each sentence repeats something that was said or done and recorded; what is not
    recorded is not told. Seconds count from the first communicate.

    Examples:
      roco why
      roco why SUBJECT --run runs/latest
      roco why THING --at 30
      roco why SUBJECT --records
    """
    with problems(form):
        from operate.recording.run import opened, reasons

        file = recording_of(run, target, run_dir)
        with waiting("reading the recording …", form):
            found = reasons(opened(file), subject, at)
        tell(found, form, lambda: _show(found, Console(), records=records))


def _show(found: Why, console: Console, *, records: bool) -> None:
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

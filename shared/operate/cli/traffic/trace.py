"""`roco trace`: one task across all agents, as a tree of conversations with times, or as spans of
OpenTelemetry.
"""

from enum import StrEnum
from typing import Annotated

import msgspec

from operate.cli.errors import ConsoleError, UsageError
from operate.cli.fleet import targets
from operate.cli.output import Format, RunDir, option, problems, tell_json
from operate.cli.terminal import span_tree
from operate.cli.terminal.console import Console
from operate.cli.traffic.selection import Recorded, Subject, recording_of
from operate.run_folder import alike
from operate.tracing import otlp
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

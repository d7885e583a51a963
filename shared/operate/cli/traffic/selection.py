"""Options by which verbs about traffic are told what is meant: which messages, for how long, in
which run, and about which subject.

A subject of `conversation`, `trace` and `why` is a conversation, CONVERSATION or, where an agent
has it with several, CONVERSATION/PARTICIPANT. A task is the conversation that opened it.
"""

from pathlib import Path
from typing import Annotated

import typer

from operate.cli import completion
from operate.cli.errors import ConsoleError, UsageError
from operate.cli.fleet import targets
from operate.cli.fleet.local import Local
from operate.cli.traffic.verdicts import judged, verdicts_of
from operate.filters import Filter, UnknownNameError, checked
from operate.structs import NothingToRead
from operate.system import NoSystemError
from operate.verdict_lines import Judged
from topdown.model.design import Design

Channels = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        help="Only on this channel; may be repeated.",
        autocompletion=completion.channels,
    ),
]
Agents = Annotated[
    list[str] | None,
    typer.Option(
        "--agent",
        help="Only from or to this agent; may be repeated.",
        autocompletion=completion.agents,
    ),
]
Protocols = Annotated[
    list[str] | None,
    typer.Option(
        "--protocol",
        help="Only of this protocol; may be repeated.",
        autocompletion=completion.protocols,
    ),
]
Performatives = Annotated[
    list[str] | None,
    typer.Option(
        "--performative",
        help="Only this act; may be repeated.",
        autocompletion=completion.performatives,
    ),
]
Recorded = Annotated[
    Path | None,
    typer.Option(
        "--run",
        help="A recording, or the folder of a run that has one; else a running fleet.",
        autocompletion=completion.runs,
    ),
]
Count = Annotated[
    int, typer.Option("--count", min=0, help="End after so many communicates; 0: go on.")
]
Seconds = Annotated[
    float, typer.Option("--for", min=0.0, help="End after so many seconds; 0: go on till Ctrl-C.")
]


def wanted(
    design: Design,
    channels: list[str] | None,
    agents: list[str] | None,
    protocols: list[str] | None,
    performatives: list[str] | None,
) -> Filter:
    """The filter. Raises UsageError for a name that the design does not have."""
    one = Filter(
        tuple(channels or ()),
        tuple(agents or ()),
        tuple(protocols or ()),
        tuple(performatives or ()),
    )
    try:
        return checked(one, design)
    except UnknownNameError as error:
        raise UsageError(str(error)) from error


def lines_of(run: Path | None, target: str, run_dir: Path | None) -> list[Judged]:
    """The verdicts about a run: of the fleet that is meant as its monitor judged it so far, else as
    judged now.
    """
    if run is None:
        return targets.find(target, run_dir).verdicts()
    return verdicts_of(run) if run.is_dir() else judged(run)


def recording_of(run: Path | None, target: str, run_dir: Path | None) -> Path:
    """Return a run folder or a recording. Raise ConsoleError where there is none, UsageError for
    containers.
    """
    if run is not None:
        if not run.exists():
            raise UsageError(
                f"{run} is not there; give a run folder, or a recording of `roco record`"
            )
        return run
    found = targets.find(target, run_dir)
    if not isinstance(found, Local):
        raise UsageError(
            f"{found.where} runs in containers; `roco record FILE` records it, then --run FILE"
        )
    return found.run


def names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the conversations of the run that the options before the word name, for the shell to
    complete.
    """
    recording, run_dir = (completion.path_given(ctx, name) for name in ("run", "run_dir"))
    try:
        lines = lines_of(recording, ctx.params.get("target") or "", run_dir)
    except (ConsoleError, NoSystemError, NothingToRead, ModuleNotFoundError):
        return []
    return completion.among(dict.fromkeys(one.conversation for one in lines), incomplete)


Subject = Annotated[
    str,
    typer.Argument(
        help="A conversation, as `roco conversation` lists it; of a task the one that opened it.",
        autocompletion=names,
    ),
]

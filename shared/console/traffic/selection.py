"""Options by which verbs about traffic are told what is meant: which messages, for how long, in
which run, and about which subject.

A subject of `conversation`, `trace` and `why` is a conversation, CONVERSATION or, where an agent
has it with several, CONVERSATION/PARTICIPANT. A task is the conversation that opened it.
"""

from pathlib import Path
from typing import Annotated

import typer

from console import completion
from console.errors import ConsoleError, UsageError
from console.fleet import targets
from console.fleet.local import Local
from console.output import argument, option
from console.traffic.verdicts import judged, verdicts_of
from operate.filters import Filter, UnknownNameError, checked
from operate.structs import NothingToRead
from operate.system import NoSystemError
from operate.verdict_lines import Judged
from topdown.model.design import Design

Names = list[str] | None
_CHANNEL = "Only on this channel; may be repeated."
_AGENT = "Only from or to this agent; may be repeated."
_PROTOCOL = "Only of this protocol; may be repeated."
_ACT = "Only this act; may be repeated."
Channels = Annotated[Names, option(_CHANNEL, "--channel", complete=completion.channels)]
Agents = Annotated[Names, option(_AGENT, "--agent", complete=completion.agents)]
Protocols = Annotated[Names, option(_PROTOCOL, "--protocol", complete=completion.protocols)]
Performatives = Annotated[Names, option(_ACT, "--performative", complete=completion.performatives)]
Recorded = Annotated[
    Path | None,
    option(
        "A recording, or the folder of a run that has one; else a running fleet.",
        "--run",
        complete=completion.runs,
    ),
]
Wrong = Annotated[bool, option("Only what is against the design.", "--wrong")]
Count = Annotated[int, option("End after so many communicates; 0: go on.", "--count", min=0)]
Seconds = Annotated[
    float, option("End after so many seconds; 0: go on till Ctrl-C.", "--for", min=0.0)
]


def wanted(
    design: Design,
    channels: list[str] | None,
    agents: list[str] | None,
    protocols: list[str] | None,
    performatives: list[str] | None,
) -> Filter:
    """The filter. Raises UsageError for a name that the design does not have."""
    named = (tuple(names or ()) for names in (channels, agents, protocols, performatives))
    try:
        return checked(Filter(*named), design)
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
    argument(
        "A conversation, as `roco conversation` lists it; of a task the one that opened it.",
        complete=names,
    ),
]

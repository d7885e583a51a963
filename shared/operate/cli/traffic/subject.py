"""What `conversation`, `trace` and `why` are asked about, and in which run: the same options, the same names.

A subject is a conversation, CONVERSATION or, where an agent has it with several, CONVERSATION/PARTICIPANT. A task is
the conversation that opened it.
"""

from pathlib import Path
from typing import Annotated

import typer

from operate.cli import completion
from operate.cli.errors import ConsoleError, UsageError
from operate.cli.fleet import targets
from operate.cli.fleet.local import Local
from operate.cli.traffic.verdicts import judged, told
from operate.run_folder import Judged, NothingToRead
from operate.system import NoSystemError


def lines_of(run: Path | None, target: str, run_dir: Path | None) -> list[Judged]:
    """The verdicts about a run: of the fleet that is meant as its monitor judged it so far, else as judged now."""
    if run is None:
        return targets.find(target, run_dir).verdicts()
    return told(run) if run.is_dir() else judged(run)


def recording_of(run: Path | None, target: str, run_dir: Path | None) -> Path:
    """Return a run folder or a recording. Raise ConsoleError where there is none, UsageError for containers."""
    if run is not None:
        if not run.exists():
            raise UsageError(f"{run} is not there; give a run folder, or a recording of `roco record`")
        return run
    found = targets.find(target, run_dir)
    if not isinstance(found, Local):
        raise UsageError(f"{found.where} runs in containers; `roco record FILE` records it, then --run FILE")
    return found.run


def names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the conversations of the run that the options before the word name, for the shell to complete."""
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

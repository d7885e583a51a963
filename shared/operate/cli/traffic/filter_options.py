"""The options by which every verb about traffic is told which communicates are meant, and for how long."""

from pathlib import Path
from typing import Annotated

import typer

from operate.cli import completion
from operate.cli.errors import UsageError
from operate.filters import Filter, UnknownNameError, checked
from topdown.model.design import Design

Channels = Annotated[
    list[str] | None,
    typer.Option("--channel", help="Only on this channel; may be repeated.", autocompletion=completion.channels),
]
Agents = Annotated[
    list[str] | None,
    typer.Option("--agent", help="Only from or to this agent; may be repeated.", autocompletion=completion.agents),
]
Protocols = Annotated[
    list[str] | None,
    typer.Option("--protocol", help="Only of this protocol; may be repeated.", autocompletion=completion.protocols),
]
Performatives = Annotated[
    list[str] | None,
    typer.Option("--performative", help="Only this act; may be repeated.", autocompletion=completion.performatives),
]
Recorded = Annotated[
    Path | None,
    typer.Option(
        "--run",
        help="A recording, or the folder of a run that has one; else a running fleet.",
        autocompletion=completion.runs,
    ),
]
Count = Annotated[int, typer.Option("--count", min=0, help="End after so many communicates; 0: go on.")]
Seconds = Annotated[float, typer.Option("--for", min=0.0, help="End after so many seconds; 0: go on till Ctrl-C.")]


def wanted(
    design: Design,
    channels: list[str] | None,
    agents: list[str] | None,
    protocols: list[str] | None,
    performatives: list[str] | None,
) -> Filter:
    """The filter. Raises UsageError for a name that the design does not have."""
    one = Filter(tuple(channels or ()), tuple(agents or ()), tuple(protocols or ()), tuple(performatives or ()))
    try:
        return checked(one, design)
    except UnknownNameError as error:
        raise UsageError(str(error)) from error

"""Names for the shell to complete that only a fleet knows: its processes, its tasks.

Apart from operate.cli.completion, whose names the options of operate.cli.fleet.targets take: what looks for a fleet
stands above those.
"""

import typer

from operate.cli import completion
from operate.cli.errors import ConsoleError
from operate.cli.fleet import targets, tasks
from operate.cli.fleet.targets import Target


def processes(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the processes of the fleet that is meant; where none runs, the agents of the design."""
    fleet = meant(ctx)
    if fleet is None:
        return completion.agents(ctx, incomplete)
    return completion.among([one.name for one in fleet.look().seen], incomplete)


def open_tasks(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the tasks of the fleet that is meant that have not ended."""
    fleet = meant(ctx)
    found = tasks.of(fleet)[0] if fleet is not None else ()
    return completion.among([one.task for one in found if one.state not in tasks.ENDED], incomplete)


def meant(ctx: typer.Context) -> Target | None:
    """Return the fleet that the options before the word name, else the one that is meant without; None: none is."""
    try:
        return targets.find(ctx.params.get("target") or "", completion.path_given(ctx, "run_dir"))
    except ConsoleError:
        return None

"""`roco agent repair NAME`: make the damaged journal of an agent usable again, while it does not run."""

from typing import Annotated

import typer

from agent_runtime.core.errors import JournalError
from agent_runtime.io.journal import journal_file
from agent_runtime.io.repair import Repaired
from agent_runtime.io.repair import repair as repaired
from operate.cli.errors import FleetError
from operate.cli.fleet import living_names
from operate.cli.output import Form, Format, RunDir, problems, tell_json
from operate.cli.runs import folders

Agent = Annotated[str, typer.Argument(metavar="AGENT", help="An agent.", autocompletion=living_names.processes)]


def repair(agent: Agent, run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Repair the damaged journal of an agent that does not run.

    The newest record that is whole is kept, and the damaged file beside it. Where something came after that record,
    peers may know of it: they begin again with this agent, and open conversations end.

    Examples:
      roco agent repair AGENT
      roco agent repair AGENT --run-dir runs/latest
    """
    with problems(form):
        file = journal_file(folders.find(run_dir), agent)
        try:
            done = repaired(file)
        except JournalError as error:
            raise FleetError(str(error)) from error
        except OSError as error:
            raise FleetError(f"journal {file} cannot be repaired: {error.strerror}; nothing was changed") from error
        if form is Format.JSON:
            tell_json(done)
        else:
            print(_words(agent, done))


def _words(agent: str, done: Repaired) -> str:
    if not done.kept:
        return f"{agent}: the journal is whole; nothing to repair"
    where = f" at byte {', '.join(map(str, done.damaged))}" if done.damaged else " at its end"
    return f"{agent}: {done.path} was damaged{where}\nlost: {done.lost}\nkept as it was: {done.kept}"

"""Output of `roco status` for people: a table of the processes, then the tasks."""

from rich.text import Text

from operate.cli.fleet.fleet_state import Status
from operate.cli.fleet.state_words import COLOURS
from operate.cli.terminal.console import Console
from operate.cli.terminal.table import table
from operate.run_folder import ProcessState, ProcessStatus


def show(now: Status) -> None:
    """Print a status for people."""
    console = Console()
    held = (("  STOPPED", "bold red"), " (`roco release`)") if now.stop_held else ()
    console.print(Text.assemble(f"run {now.run}", *held))
    if now.fleet is not None:
        rows = (
            (
                one.name,
                Text(one.state, COLOURS.get(one.state, "")),
                str(one.pid or "-"),
                str(one.restarts),
                note(one, now),
            )
            for one in now.fleet.processes
        )
        console.print(table(("process", "state", "pid", "restarts", ""), rows, fold=("",)))
    if now.unkept:
        console.print(f"{now.unkept}: `roco down`, then `roco up`", style="bold red", highlight=False, soft_wrap=True)
    if now.keys:
        console.print(f"{now.keys}: see `roco doctor`", style="bold red", highlight=False, soft_wrap=True)
    if now.pictures:
        console.print(
            f"no pictures: {now.pictures}; see `roco doctor`", style="yellow", highlight=False, soft_wrap=True
        )
    for line in now.unheard:
        console.print(line, style="yellow")
    for task in now.tasks:
        console.print(f"{task.task}  {task.state}  {task.said}  {task.text}", highlight=False, soft_wrap=True)
    if now.problem:
        console.print(now.problem, style="yellow")


def note(status: ProcessStatus, now: Status) -> str:
    """Return the problem of a process, and the remedy if its state does not name it."""
    if status.state is ProcessState.STOPPED and now.fleet is not None and any(one.pid for one in now.fleet.processes):
        return f"{status.note or 'stopped'}: `roco agent start {status.name}`"
    paused = f"paused: `roco agent start {status.name}`" if status.name in now.paused else ""
    return now.troubles.get(status.name, status.note) or paused

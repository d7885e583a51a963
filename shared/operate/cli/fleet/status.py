"""`roco status`: what runs, and what it is at."""

import time
from collections.abc import Iterator

import msgspec
import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from operate.cli.errors import AS_WANTED, NO, NOTHING_RUNS
from operate.cli.fleet import targets, tasks
from operate.cli.fleet.process_status import Look, stuck, trouble
from operate.cli.fleet.state_words import COLOURS
from operate.cli.fleet.targets import Target
from operate.cli.fleet.tasks import Task
from operate.cli.output import Form, Format, RunDir, problems, tell_json
from operate.run_folder import Fleet, ProcessState, ProcessStatus


class Status(msgspec.Struct, frozen=True):
    """The fleet, the tasks, whether the robot is held; `problem`: why no task is known; `troubles`: by process.

    `unheard`: who is not heard by whom, a sentence each; `paused`: agents that take no step. `stuck`: processes that
    are frozen or hang; `unkept`: why nobody looks after the fleet.
    """

    run: str
    fleet: Fleet | None
    tasks: tuple[Task, ...]
    stop_held: bool
    problem: str = ""
    troubles: dict[str, str] = {}
    unheard: tuple[str, ...] = ()
    paused: tuple[str, ...] = ()
    stuck: tuple[str, ...] = ()
    unkept: str = ""


def status(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Show the fleet's processes and the tasks. Exits with 1 where not all that must be ready are, where a process is
    frozen or hangs, or no supervisor looks after them, with 3 where nothing runs.

    Examples:
      roco status
      roco status --format json
      roco status --target compose
    """
    with problems(form):
        now = state_of(targets.find(target, run_dir))
        if form is Format.JSON:
            tell_json(now)
        else:
            show(now)
        if code := verdict(now):
            raise typer.Exit(code)


def verdict(now: Status) -> int:
    """The exit code: whether all that must be ready are, nothing hangs, and whether anything runs at all."""
    processes = now.fleet.processes if now.fleet else ()
    if not any(process.pid for process in processes):
        return NOTHING_RUNS
    missing = any(p.state is not ProcessState.READY and not p.optional for p in processes)
    return NO if missing or now.stuck or now.unkept else AS_WANTED


def state_of(fleet: Target) -> Status:
    """What can be learnt of a run; that nobody tells of tasks is told, not raised."""
    told, problem = tasks.of(fleet)
    now = fleet.look()
    troubles = {one.name: words for one in now.seen if one.status.pid and (words := trouble(one))}
    paused = tuple(one.name for one in now.seen if one.status.pid and one.beat is not None and one.beat.paused)
    late = tuple(one.name for one in now.seen if one.status.pid and stuck(one))
    return Status(
        fleet.where, now.fleet, told, now.stop_held, problem, troubles, tuple(unheard(now)), paused, late, now.unkept
    )


def unheard(now: Look) -> Iterator[str]:
    """Who is not heard by whom, though both are there."""
    found = [(one.name, line) for one in now.seen if one.beat and one.status.pid for line in one.beat.unheard]
    if found:
        from agent_runtime.core import unheard as of_agents

        for name, line in found:
            yield of_agents.words(name, of_agents.Unheard(line.peer, line.channel, line.what, line.since), time.time())


def show(now: Status) -> None:
    """Print a status for people."""
    console = Console()
    console.print(f"run {now.run}" + ("  [bold red]STOPPED[/] (`roco release`)" if now.stop_held else ""))
    if now.fleet is not None:
        console.print(table(now))
    if now.unkept:
        console.print(f"{now.unkept}: `roco down`, then `roco up`", style="bold red", highlight=False, soft_wrap=True)
    for line in now.unheard:
        console.print(line, style="yellow")
    for task in now.tasks:
        console.print(f"{task.task}  {task.state}  {task.said}  {task.text}", highlight=False, soft_wrap=True)
    if now.problem:
        console.print(now.problem, style="yellow")


def table(now: Status) -> Table:
    """The processes; behind each what is wrong with it."""
    table = Table("process", "state", "pid", "restarts", "", box=None, padding=(0, 2, 0, 0), header_style="dim")
    for status in now.fleet.processes if now.fleet else ():
        state = Text(status.state, COLOURS.get(status.state, ""))
        table.add_row(status.name, state, str(status.pid or "-"), str(status.restarts), note(status, now))
    return table


def note(status: ProcessStatus, now: Status) -> str:
    """What is wrong with a process, and what to do where its state does not say it."""
    if status.state is ProcessState.STOPPED and now.fleet is not None and any(one.pid for one in now.fleet.processes):
        return f"{status.note or 'stopped'}: `roco agent start {status.name}`"
    paused = f"paused: `roco agent resume {status.name}`" if status.name in now.paused else ""
    return now.troubles.get(status.name, status.note) or paused

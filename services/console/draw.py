"""The picture of a run in the terminal: who does what, the plan with its present state, what went over the channels."""

import time
from datetime import datetime

import msgspec
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from companion.design import DESIGN
from companion.run_folder import Fleet, ProcessState, ProcessStatus, TaskLine
from services.console.live import Plan, View

PLAN_LINES = 16  # a terminal of 40 lines still has room for the rest
ROLES = {
    "router": "carries words",
    "monitor": "records",
    "loop": "moves Velma",
    "km": "knows",
    "pl": "plans",
    "ta": "does the plan",
    "ex": "acts and sees",
    "co": "coordinates",
    "hi": "listens",
}
COLOURS = {
    "ready": "green",
    "done": "green",
    "running": "cyan",
    "planning": "cyan",
    "starting": "yellow",
    "waiting": "dim",
    "backing-off": "red",
    "given-up": "bold red",
    "failed": "bold red",
    "refused": "red",
    "cancelled": "yellow",
}


class Scene(msgspec.Struct, frozen=True):
    """All that is drawn: title, the fleet, the tasks, the view; `began`: unix time [s]."""

    title: str
    began: float
    fleet: Fleet | None = None
    tasks: tuple[TaskLine, ...] = ()
    view: View = View()
    stop_held: bool = False


def picture(scene: Scene, now: float | None = None) -> RenderableType:
    """Draw it all; `now`: unix time [s]."""
    upper = Table.grid(expand=True, padding=(0, 1))
    upper.add_column(ratio=6)
    upper.add_column(ratio=5)
    left = Group(
        Panel(agents(scene), title="who does what", title_align="left", border_style="dim"),
        Panel(channels(scene.view), title="communicates", title_align="left", border_style="dim"),
    )
    upper.add_row(left, Panel(plan_tree(scene.view), title="plan", title_align="left", border_style="dim"))
    return Group(header(scene, time.time() if now is None else now), upper, events(scene.view))


def header(scene: Scene, now: float) -> Text:
    """Title, elapsed time, the tasks."""
    text = Text.assemble((scene.title, "bold"), f"  {max(0.0, now - scene.began):.0f} s")
    if scene.stop_held:
        text.append("   STOPPED: `roco release` lets the robot move", "bold white on red")
    for task in scene.tasks:
        text.append(f"\n{task.said or task.task}  ", "italic")
        text.append(task.state, COLOURS.get(task.state, ""))
        text.append(f"  {task.text}" if task.text else "")
    return text


def agents(scene: Scene) -> Table:
    """Each process with its state: of its FSM where it is an agent that runs, else as the supervisor sees it."""
    table = Table.grid(padding=(0, 2))
    if scene.fleet is None:
        table.add_row(Text("starting the supervisor …", "dim"))
    for status in scene.fleet.processes if scene.fleet else ():
        table.add_row(Text(status.name, "bold"), Text(ROLES.get(status.name, ""), "dim"), _doing(status, scene.view))
    return table


def channels(view: View) -> Table:
    """Counts and bytes of each channel of the design, and its last communicate."""
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, justify="right")
    table.add_column(no_wrap=True, justify="right", min_width=9)
    table.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    for name, channel in DESIGN.channels.items():
        counted = view.channels.get(name)
        row = (str(counted.count), f"{counted.bytes / 1000:.1f} kB", counted.last) if counted else ("-", "", "")
        table.add_row(Text(name, "bold"), f"{channel.ends[0]}-{channel.ends[1]}", *row[:2], Text(row[2], "dim"))
    return table


def plan_tree(view: View) -> Text:
    """The plan as an indented tree; machines without the present state are folded when it is long."""
    plan = view.plan
    if plan is None:
        return Text("no plan yet", "dim")
    ended = f"   {plan.outcome}" if plan.outcome else ""
    text = Text.assemble(
        (f"#{view.plans} {plan.task}", "bold"), (ended, COLOURS.get(_as_state(plan.outcome), "yellow"))
    )
    for path in shown(plan, PLAN_LINES):
        depth, name = path.count("/"), path.rsplit("/", 1)[-1]
        if path == plan.at:
            text.append(f"\n{'  ' * depth}▶ {name}", "bold green")
        elif within(plan.at, path):
            text.append(f"\n{'  ' * depth}▾ {name}", "green")
        elif path in plan.passed or _wholly_passed(plan, path):
            text.append(f"\n{'  ' * depth}✓ {name}", "dim green")
        else:
            text.append(f"\n{'  ' * depth}· {name}", "dim")
    return text


def shown(plan: Plan, lines: int) -> tuple[str, ...]:
    """The paths that are drawn: all, if there is room; else those beside and above the present one, at most `lines`."""
    if len(plan.states) <= lines:
        return plan.states
    open_machines = {plan.at.rsplit("/", n)[0] for n in range(1, plan.at.count("/") + 1)}
    paths = [path for path in plan.states if "/" not in path or path.rsplit("/", 1)[0] in open_machines]
    here = paths.index(plan.at) if plan.at in paths else 0
    first = max(0, min(here - lines // 2, len(paths) - lines))
    return tuple(paths[first : first + lines])


def events(view: View) -> Text:
    """The latest events, one line each."""
    lines = Text()
    for event in view.events:
        lines.append(f"{datetime.fromtimestamp(event.t):%H:%M:%S} ", "dim")
        lines.append(f"{event.who} ", "bold")
        lines.append(f"{event.text}\n")
    return lines


def fleet_table(fleet: Fleet) -> Table:
    """The processes as the supervisor sees them, for `roco status`."""
    table = Table("process", "state", "pid", "restarts", "", box=None, padding=(0, 2), header_style="dim")
    for status in fleet.processes:
        state = Text(status.state, COLOURS.get(status.state, ""))
        table.add_row(status.name, state, str(status.pid or "-"), str(status.restarts), status.note)
    return table


def within(path: str, machine: str) -> bool:
    """Tell whether a path stands inside a machine."""
    return path.startswith(machine + "/")


def _doing(status: ProcessStatus, view: View) -> Text:
    seen = view.agents.get(status.name)
    if status.state is ProcessState.READY and seen is not None:
        text = Text(seen.state, "cyan") if seen.alive else Text("not reachable", "bold red")
    else:
        text = Text(status.state, COLOURS.get(status.state, ""))
    if status.restarts:
        text.append(f" ↻{status.restarts}", "yellow")
    return text


def _wholly_passed(plan: Plan, machine: str) -> bool:
    """Tell whether this is a machine that was left behind."""
    inside = [path for path in plan.states if within(path, machine)]
    return bool(inside) and inside[-1] in plan.passed


def _as_state(outcome: str) -> str:
    return {"succeeded": "done", "failed": "failed"}.get(outcome.lower(), "")

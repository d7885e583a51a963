"""The picture of a run in the terminal: who does what, the plan with its present state, what went
over the channels; and a run as it goes on, for who waits.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import msgspec
from rich.console import Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from console.fleet import starting
from console.fleet.process_status import ENDED, Task
from console.fleet.process_tables import COLOURS, doing, waited_for
from console.runs import folders
from console.terminal import run_state
from console.terminal.console import Console
from console.terminal.run_state import Event, Names, Plan, View, leaves, tasks, within
from operate.file_names import LIVE_FILE
from operate.fleet_file import Fleet, ProcessState
from operate.live_lines import Step
from operate.system import System
from topdown.model.design import Design

PLAN_LINES = 17  # as high as the panels beside it
LEAST_COLUMN = 20  # in a narrower terminal lines are folded again
_MEASURE = Console(width=80)  # what measures texts; nothing is printed to it
OUTCOMES = {"replan": "a new plan is wanted"}


class Scene(msgspec.Struct, frozen=True):
    """All that is drawn: title, the fleet of a system, the tasks, the view; `began`: unix time
    [s].
    """

    title: str
    began: float
    system: System
    fleet: Fleet | None = None
    tasks: tuple[Task, ...] = ()
    view: View = View()
    stop_held: bool = False


def picture(
    scene: Scene, now: float | None = None, lines: int = 40, width: int = 80
) -> RenderableType:
    """Draw it all, as many events as fit into `lines` of a terminal so wide; `now`: unix time
    [s].
    """
    system, design = scene.system, scene.system.design
    upper = Table.grid(expand=True, padding=(0, 1))
    upper.add_column(ratio=6)
    panel = partial(Panel, title_align="left", border_style="dim")
    said = panel(channels(scene.view, design), title="communicates")
    panels: list[RenderableType] = [Group(panel(agents(scene), title="who does what"), said)]
    if scene.system.additions.live:  # who adds lines tells of plans
        upper.add_column(ratio=5)
        panels.append(panel(plan_tree(scene.view, system), title=plan_title(scene.view)))
    upper.add_row(*panels)
    top = header(scene, time.time() if now is None else now)
    processes = len(scene.fleet.processes) if scene.fleet else 1
    height = len(wrapped(top, width)) + processes + len(design.channels) + 4  # four lines of frames
    room = max(1, lines - height - 1)
    return Group(top, upper, events(scene.view, scene.began, room, width, system))


def header(scene: Scene, now: float) -> Text:
    """Title, elapsed time; then the tasks, or what the start waits for."""
    text = Text.assemble((scene.title, "bold"), (f"   {max(0.0, now - scene.began):.0f} s", "dim"))
    if scene.stop_held:
        text.append("   STOPPED: `roco release` lets the robot move", "bold white on red")
    for task in scene.tasks:
        text.append(f"\n“{task.asked}”  ", "italic")
        text.append(task.state, COLOURS.get(task.state, ""))
        if task.text and task.state != "running":  # while it runs, the plan beside shows more
            text.append(f": {scene.system.plain(task.text)}", "dim")
    if not scene.tasks:
        waiting = waited_for(scene.fleet.processes) if scene.fleet else "starting the supervisor"
        text.append(f"\n{waiting or 'all ready'}", "yellow" if waiting else "green")
    return text


def agents(scene: Scene) -> Table:
    """Each process with what it does and how many communicates it sent."""
    table = Table.grid(padding=(0, 2), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    table.add_column(no_wrap=True, justify="right")
    if scene.fleet is None:
        table.add_row(Text("supervisor", "bold"), Text("starting", "yellow"), "")
    for status in scene.fleet.processes if scene.fleet else ():
        words, style = doing(status, scene.view, scene.system)
        text = Text(words, style)
        if status.restarts:
            text.append(f"  restarted {status.restarts}×", "yellow")
        sent = scene.view.sent.get(status.name)
        table.add_row(Text(status.name, "bold"), text, Text(f"{sent} sent" if sent else "", "dim"))
    return table


def channels(view: View, design: Design) -> Table:
    """Counts and bytes of each channel of the design, and its last communicate."""
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, justify="right")
    table.add_column(no_wrap=True, justify="right", min_width=9)
    table.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    for name, channel in design.channels.items():
        numbers, last = ("-", ""), ""
        if counted := view.channels.get(name):
            numbers, last = (str(counted.count), f"{counted.bytes / 1000:.1f} kB"), counted.last
        table.add_row(Text(name, "bold"), "-".join(channel.ends), *numbers, Text(last, "dim"))
    return table


def plan_title(view: View) -> str:
    """The plan's number, and how far it is."""
    plan = view.plan
    if plan is None:
        return "plan"
    steps = [one.path for one in leaves(plan.states)]
    if plan.at is None or plan.at.path not in steps:
        return f"plan {view.plans}"
    return f"plan {view.plans}, step {steps.index(plan.at.path) + 1} of {len(steps)}"


def plan_tree(view: View, system: System) -> Text:
    """The plan as an indented tree; machines without the present state are folded when it is
    long.
    """
    plan = view.plan
    if plan is None:
        return Text("none yet", "dim")
    text = Text(tasks(plan.tasks, system), "bold")
    if plan.outcome:
        state = {"succeeded": "done", "failed": "failed"}.get(plan.outcome.lower(), "")
        text.append(f"   {OUTCOMES.get(plan.outcome, plan.outcome)}", COLOURS.get(state, "yellow"))
    here = plan.at.path if plan.at is not None else ()
    for one in shown(plan, PLAN_LINES - 1):
        indent = "  " * (len(one.path) - 1)
        step = msgspec.structs.replace(one, does="", things=(), side="") if one.act else one
        name = system.step(step) or " ".join(one.path[-1:])
        mark, style = "·", "dim"
        if one.path == here:
            mark, style = "▶", "bold green"
        elif within(here, one.path):
            mark, style = "▾", "green"
        elif one.path in plan.passed or _wholly_passed(plan, one.path):
            mark, style = "✓", "dim green"
        text.append(f"\n{indent}{mark} {name}", style)
    return text


def shown(plan: Plan, lines: int) -> tuple[Step, ...]:
    """The states drawn: all, if there is room; else those beside and above the present one, at most
    `lines`.
    """
    if len(plan.states) <= lines:
        return plan.states
    at = plan.at.path if plan.at is not None else ()
    states = [one for one in plan.states if len(one.path) == 1 or within(at, one.path[:-1])]
    paths = [one.path for one in states]
    here = paths.index(at) if at in paths else 0
    first = max(0, min(here - lines // 2, len(paths) - lines))
    return tuple(states[first : first + lines])


def events(view: View, began: float, lines: int, width: int, system: System) -> Text:
    """The latest events that fit, each whole, in seconds after `began` [unix s]; of the last one
    what fits.
    """
    shown: list[Text] = []
    for event in reversed(view.events):
        told = _event(event, began, width, system)
        if shown and len(shown) + len(told) > lines:
            break
        shown = [*told, *shown]
    return Text("\n").join(shown[:lines])


def _event(event: Event, began: float, width: int, system: System) -> list[Text]:
    """An event in lines: what it says stands in a column beside its time."""
    at = Text(f"{max(0.0, event.t - began):5.0f} s  ", "dim")
    why = f": {system.plain(event.text)}" if event.text else ""
    words = Text.assemble(system.happened(event.name, event.of), (why, "dim"))
    column = max(LEAST_COLUMN, width - len(at))
    first, *others = wrapped(words, column)
    return [at + first, *(Text(" " * len(at)) + line for line in others)]


def wrapped(text: Text, width: int) -> list[Text]:
    """A text in lines of a terminal so wide."""
    return list(text.wrap(_MEASURE, width))


def _wholly_passed(plan: Plan, machine: Names) -> bool:
    """Tell whether this is a machine that was left behind."""
    inside = [one.path for one in plan.states if within(one.path, machine)]
    return bool(inside) and inside[-1] in plan.passed


# --- A run while it goes on, for who waits: a picture drawn again and again, or lines -------------


QUIET = (ProcessState.WAITING, ProcessState.STARTING, ProcessState.STOPPING, ProcessState.STOPPED)


class Watch:
    """Shows a system's run while it goes: a picture in a terminal, lines elsewhere; with
    `json_lines` JSON objects.
    """

    def __init__(
        self, system: System, run: Path, title: str, console: Console, json_lines: bool = False
    ) -> None:
        self.scene = Scene(title, time.time(), system)
        self.run = run
        self.console = console
        self.json_lines = json_lines
        self.pictures = console.is_terminal and not json_lines
        self._follow = run_state.Follow(run_state.of_file(run / LIVE_FILE))
        self._live: Live | None = None
        self._told: dict[str, str] = {}
        if not self.pictures and not json_lines:
            console.out(f"{title}; everything is written to {folders.near(run)}", highlight=False)

    @contextmanager
    def showing(self) -> Iterator["Watch"]:
        """Show it as long as this lasts."""
        if not self.pictures:
            yield self
            return
        with Live(
            console=self.console,
            refresh_per_second=8,
            get_renderable=lambda: picture(
                self.scene, lines=self.console.height, width=self.console.width
            ),
        ) as self._live:
            yield self

    def ending(self) -> None:
        """Say that the rest takes some seconds more."""
        if not self.json_lines:
            self.console.print(
                "stopping the fleet, writing the report …", style="dim" if self.pictures else ""
            )

    def waits(self, words: str) -> None:
        """Say what is waited for, where it is new."""
        if self._told.get("waits") != words:
            self._told["waits"] = words
            if not self.json_lines:
                self.console.print(f"waiting {words}", style="dim" if self.pictures else "")

    def look(self, fleet_now: Fleet | None = None, tasks: tuple[Task, ...] | None = None) -> None:
        """Take in what is new: lines of the monitor, the fleet, the tasks."""
        view, system = self.scene.view, self.scene.system
        for line in self._follow.new():
            view = run_state.fold(view, line)
            self._say(line.t, run_state.in_words(line, system), line)
        self.scene = msgspec.structs.replace(
            self.scene,
            view=view,
            fleet=fleet_now or folders.fleet(self.run) or self.scene.fleet,
            tasks=self.scene.tasks if tasks is None else tasks,
            stop_held=folders.stop_held(self.run),
        )
        for status in self.scene.fleet.processes if self.scene.fleet else ():
            self._tell_once(
                status.name, starting.describe(status), status, status.state not in QUIET
            )
        for task in self.scene.tasks:
            words = (
                f"{task.asked}: {task.state}{', ' + system.plain(task.text) if task.text else ''}"
            )
            self._tell_once(f"task {task.task}", words, task, task.state in ENDED)

    def _tell_once(self, key: str, words: str, what: object, aloud: bool) -> None:
        """Say something that lasts, when it is new or changed; to people only what other lines do
        not say.
        """
        if self._told.get(key) != words:
            self._told[key] = words
            self._say(time.time(), words if aloud else "", what)

    def _say(self, t: float, words: str, what: object) -> None:
        """Write a line, where no picture is drawn."""
        if self.json_lines:
            self.console.out(msgspec.json.encode(what).decode(), highlight=False)
        elif words and not self.pictures:
            self.console.out(f"{max(0.0, t - self.scene.began):7.1f} s  {words}", highlight=False)

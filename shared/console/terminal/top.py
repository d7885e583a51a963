"""`roco top`: agents and channels, and task and plan where there are such, on one live screen,
until q or Ctrl-C.
"""

import select
import sys
import termios
import time
import tty
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from typing import Annotated, Any

import msgspec
from rich.console import Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from console.errors import NoRunError
from console.fleet import targets, tasks
from console.fleet.process_status import Look, Row, rows
from console.fleet.process_tables import COLUMNS, cells
from console.fleet.state_words import COLOURS, doing
from console.fleet.targets import Target
from console.fleet.tasks import ENDED, Task
from console.output import Format, RunDir, option, problems, tell_json
from console.terminal import run_state
from console.terminal.console import Console
from console.terminal.draw import events
from console.terminal.graph import WINDOW_S, Edge, Graph, dot, drawn, edges, nodes, sized
from console.terminal.run_state import Plan, View
from console.terminal.table import table
from operate.live_lines import LiveLine, Sent
from operate.system import System

# --- Single keys of a terminal, without Enter; a pipe has none ------------------------------------


class Keyboard:
    """Keys come one by one as long as this lasts; afterwards the terminal is as it was."""

    def __init__(self) -> None:
        self._before: list[Any] | None = None

    def __enter__(self) -> "Keyboard":
        if sys.stdin.isatty():
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def pressed(self, within_s: float) -> str:
        """The next key, "" where none is pressed in time."""
        if self._before is None:
            time.sleep(within_s)
            return ""
        ready, _, _ = select.select([sys.stdin], [], [], within_s)
        return sys.stdin.read(1) if ready else ""


# --- `roco top` -----------------------------------------------------------------------------------


PERIOD_S = 1.0
"""Between two pictures: people look once a second."""
QUIT = "q"


class Drawing(StrEnum):
    """The forms of a picture: text for people, json for programs, dot for Graphviz, which draws
    agents and channels.
    """

    TEXT = "text"
    JSON = "json"
    DOT = "dot"


SHOWN = ("beat", "cpu", "memory", "again", "waits")


class Screen(msgspec.Struct, frozen=True):
    """All that is drawn; one object a picture with `--format json`. `at`: unix time [s]."""

    where: str
    at: float
    agents: tuple[Row, ...]
    channels: tuple[Edge, ...]
    task: Task | None
    plan: str
    step: str
    stop_held: bool


def top(
    target: targets.Name = "",
    run_dir: RunDir = None,
    period: Annotated[float, option("Seconds between two pictures.", min=0.2)] = PERIOD_S,
    count: Annotated[
        int, option("End after so many pictures; 0: at q.", "-n", "--count", min=0)
    ] = 0,
    once: Annotated[bool, option("Print one picture, and end.", "--once")] = False,
    graph: Annotated[
        bool, option("Draw the channels as arcs between the agents.", "--graph")
    ] = False,
    window: Annotated[float, option("Seconds that rates are taken over.", min=0.1)] = WINDOW_S,
    form: Annotated[Drawing, option("text, json, or dot for Graphviz.", "--format")] = Drawing.TEXT,
) -> None:
    """Show agents and channels, and the task and the plan's present state, on a live screen; q or
    Ctrl-C ends it.

    With --graph it draws agents and channels with their states and what goes over each channel now.
    Where no terminal is, pictures follow one another; as JSON it is an object a line.

    Examples:
      roco top
      roco top --period 5
      roco top --once --format json
      roco top --graph
      roco top --graph --once --window 60 --format json
      roco top --once --format dot
    """
    with problems(Format.JSON if form is Drawing.JSON else Format.TEXT):
        watched = Watched(targets.find(target, run_dir), window, graph=graph)
        console, count = Console(), 1 if once else count
        shows: dict[Drawing, Callable[[], None]] = {
            Drawing.JSON: lambda: tell_json(watched.graph() if graph else watched.screen),
            Drawing.DOT: lambda: print(dot(watched.graph())),
            Drawing.TEXT: lambda: console.print(watched.picture(console.width, 40)),
        }
        with suppress(KeyboardInterrupt):
            if form is Drawing.TEXT and console.is_terminal and not once:
                _live(watched, period, count, console)
            else:
                _each(watched, period, count, shows[form])


class Watched:
    """A fleet, looked at again and again. Raises NoRunError where there is none."""

    def __init__(self, fleet: Target, window_s: float = WINDOW_S, *, graph: bool = False) -> None:
        self.fleet, self.system = fleet, fleet.system
        self.view = View()
        self._heard: list[LiveLine] = []
        self._follow = run_state.Follow(fleet.live)
        self._counts: dict[str, int] = {}
        self._last: dict[str, float] = {}
        self._window_s, self._graph = window_s, graph
        self._before = fleet.look()
        if self._before.fleet is None:
            raise NoRunError(fleet.where)
        self._began = self._before.fleet.started
        if not graph:
            time.sleep(0.2)  # so that the first picture has shares of a processor
        self.look()

    def look(self) -> None:
        """See what is new."""
        now, at = self.fleet.look(), time.time()
        for line in self._follow.new():
            self._began = self._began or line.t
            self.view = run_state.fold(self.view, line)
            if isinstance(line, Sent):
                self._heard.append(line)
                self._counts[line.channel] = self._counts.get(line.channel, 0) + 1
                self._last[line.channel] = max(line.t, self._last.get(line.channel, line.t))
        self._heard = [line for line in self._heard if line.t > at - self._window_s]
        counts, last = self._counts, self._last
        channels = tuple(
            msgspec.structs.replace(one, count=counts.get(one.name, 0), last=last.get(one.name))
            for one in edges(self.system.design, self._heard, at, self._window_s)
        )
        agents, plan = rows(self._before, now), self.view.plan
        step = self.system.step(plan.at) if plan and plan.at else ""
        work = (self._task(), self._plan(plan), step, now.stop_held)
        self.screen = Screen(self.fleet.where, at, agents, channels, *work)
        self._now, self._before = now, now

    def graph(self) -> Graph:
        """Agents and channels as they were at the last look."""
        now, agents = self.screen, nodes(self.system.design, self._now.seen)
        return Graph(now.where, now.at, self._window_s, agents, now.channels)

    def picture(self, width: int, height: int) -> RenderableType:
        """The screen, as many events as there is room for; or the graph."""
        if self._graph:
            return drawn(self.graph(), self.system)
        screen = self.screen
        used = 7 + len(screen.agents) + len(screen.channels)
        return Group(
            header(screen, self.system),
            agents(screen, self._now, self.view, self.system),
            Text(),
            channels(screen, self.view),
            Text(),
            events(self.view, self._began, max(0, height - used - 1), width, self.system),
        )

    def _plan(self, plan: Plan | None) -> str:
        if plan is None:
            return ""
        ended = f", {plan.outcome}" if plan.outcome else ""
        return f"plan {self.view.plans}: {run_state.tasks(plan.tasks, self.system)}{ended}"

    def _task(self) -> Task | None:
        """The oldest that goes on, else the latest."""
        told, _ = tasks.of(self.fleet)
        return next((task for task in told if task.state not in ENDED), told[-1] if told else None)


def header(screen: Screen, system: System) -> Text:
    """Return the header: the place, and for a system with tasks the task and the plan with its
    present state; three lines.
    """
    text = Text(no_wrap=True, overflow="ellipsis")
    text.append("roco top", "bold").append(f"  {screen.where}  ").append("q: quit", "dim")
    if screen.stop_held:
        text.append("  STOPPED: `roco release`", "bold white on red")
    if not system.additions.tasks:
        return text
    task = screen.task
    text.append("\ntask  ", "dim")
    if task is None:
        text.append("none", "dim")
    else:
        text.append(f"“{task.said or task.task}” ", "italic").append(
            task.state, COLOURS.get(task.state, "")
        )
    text.append("\nplan  ", "dim")
    text.append(screen.plan or "none", "" if screen.plan else "dim")
    return text.append(f"  ▶ {screen.step}" if screen.step else "", "bold green")


def agents(screen: Screen, now: Look, view: View, system: System) -> Table:
    """Return the table of agents: what each does in words, heartbeat, processor and memory."""
    numbers = (*SHOWN, "sent")
    drawn = table(
        ("agent", "does", *numbers), right=numbers, cut=("does",), padding=(0, 1, 0, 0), expand=True
    )
    for row, one in zip(screen.agents, now.seen, strict=True):
        words, style = (row.trouble, "red") if row.trouble else doing(one.status, view, system)
        cell = dict(zip(COLUMNS, cells(row), strict=True))
        sent = Text(str(view.sent.get(row.name, "")), "dim")
        drawn.add_row(cell["agent"], Text(words, style), *(cell[name] for name in SHOWN), sent)
    return drawn


def channels(screen: Screen, view: View) -> Table:
    """Rates of each channel, and what was said last."""
    numbers = ("rate", "bandwidth", "said")
    heads = ("on", "between", *numbers, "last")
    wide = dict.fromkeys(numbers, 6)
    drawn = table(
        heads, right=numbers, cut=("last",), least=wide, padding=(0, 1, 0, 0), expand=True
    )
    for edge in screen.channels:
        heard = view.channels.get(edge.name)
        light = "green" if edge.per_s else "dim"
        name, last = Text(edge.name, "bold"), Text(heard.last if heard else "", "dim")
        rate, bandwidth = f"{edge.per_s:.1f}/s", f"{sized(edge.bytes_per_s)}/s"
        rates = (Text(rate, light), Text(bandwidth, light))
        drawn.add_row(name, "-".join(edge.ends), *rates, str(edge.count), last)
    return drawn


def _each(watched: Watched, period_s: float, count: int, show: Callable[[], None]) -> None:
    """Pictures one after the other."""
    number = 0
    while True:
        show()
        number += 1
        if number == count:
            return
        time.sleep(period_s)
        watched.look()


def _live(watched: Watched, period_s: float, count: int, console: Console) -> None:
    """The screen, until q is pressed."""

    def picture() -> RenderableType:
        return watched.picture(console.width, console.height)

    with (
        Keyboard() as keys,
        Live(console=console, screen=True, auto_refresh=False, get_renderable=picture) as shown,
    ):
        number = 0
        while True:
            shown.refresh()
            number += 1
            if number == count or keys.pressed(period_s) == QUIT:
                return
            watched.look()

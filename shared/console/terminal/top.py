"""`roco top`: agents and channels, and task and plan where there are such, on one live screen,
until q or Ctrl-C.
"""

import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from enum import StrEnum
from itertools import permutations
from typing import Annotated, Any, NamedTuple

import msgspec
from rich.console import Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from console.errors import NoRunError
from console.fleet import process_status, targets
from console.fleet.process_status import ENDED, Look, Row, Seen, Task, rows, trouble
from console.fleet.process_tables import COLOURS, COLUMNS, cells, doing, state_text, wish
from console.fleet.targets import Target
from console.output import RunDir, option, tell_json
from console.terminal import run_state
from console.terminal.console import Console, table
from console.terminal.draw import events
from console.terminal.run_state import Plan, View
from operate.fleet_file import ProcessState
from operate.live_lines import LiveLine, Sent
from operate.system import System
from topdown.draw.canvas import tracks
from topdown.model.design import Design

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


# --- `roco top --graph`: agents and channels with what goes over them now


# --- A graph as an arc diagram of characters: nodes one below the other, each edge an arc to their
# right
# Pure. Each row ends or begins one edge at most, so that a row has room for what is said of the
# edge that ends in it.


STEP = 3
"""Columns from one arc to the next one beside it."""
MOST = 7
"""Nodes of which all orders are tried: 5040, some hundredths of a second."""
Edges = Mapping[str, tuple[str, str]]


class ArcRow(NamedTuple):
    """`node`: whose first row this is, or ""; `marks`: characters with the edge they belong to;
    `ends`: the edge that ends here, or "".
    """

    node: str
    marks: tuple[tuple[str, str], ...]
    ends: str


def ordered(nodes: Sequence[str], edges: Edges) -> list[str]:
    """The order of the nodes with the shortest arcs, as far as all orders can be tried."""
    if len(nodes) > MOST:
        return list(nodes)

    def length(order: Iterable[str]) -> int:
        place = {node: number for number, node in enumerate(order)}
        return sum(abs(place[a] - place[b]) for a, b in edges.values())

    return list(min(permutations(nodes), key=length))


def arc_rows(nodes: Sequence[str], edges: Edges) -> list[ArcRow]:
    """The rows from the first node to the last. ValueError: an edge ends at no node, or at one node
    twice.
    """
    place = {node: number for number, node in enumerate(nodes)}
    spans: dict[str, tuple[int, int]] = {}
    for name, (a, b) in edges.items():
        if not {a, b} <= place.keys() or a == b:
            raise ValueError(f"edge {name} joins {a} and {b}; there are {', '.join(nodes)}")
        spans[name] = (min(place[a], place[b]), max(place[a], place[b]))
    in_order = sorted(spans, key=lambda name: spans[name])
    lanes = dict(zip(in_order, tracks([spans[name] for name in in_order], gap=0), strict=True))
    width = 1 + STEP * (max(lanes.values(), default=-1) + 1)
    found: list[ArcRow] = []
    going: set[str] = set()
    for number, node in enumerate(nodes):
        # the edges that turn at a node: those that end, inner first, then those that begin, outer
        # ones first
        inner = sorted(spans, key=lambda name: lanes[name])
        turns = [(name, True) for name in inner if spans[name][1] == number]
        turns += [(name, False) for name in reversed(inner) if spans[name][0] == number]
        for index, (name, over) in enumerate(turns or [("", False)]):
            going -= {name} if over else set()
            marks = _marks(index, len(turns), name, over, going, lanes, width)
            found.append(ArcRow(node if index == 0 else "", marks, name if over else ""))
            going |= {name} if name and not over else set()
    return found


def _marks(
    index: int,
    count: int,
    name: str,
    ends: bool,
    going: set[str],
    lanes: Mapping[str, int],
    width: int,
) -> tuple[tuple[str, str], ...]:
    """A row's characters from the node to the last arc."""
    at = {1 + STEP * lanes[other] + STEP - 1: other for other in going}
    turn = 1 + STEP * lanes[name] + STEP - 1 if name else 0
    first = " " if not count else "─"
    if count > 1:
        first = "┬" if index == 0 else "╰" if index == count - 1 else "├"
    marks = [(first, name)]
    for column in range(1, width):
        if column < turn:
            marks.append(("┼" if column in at else "─", name))
        elif column == turn:
            marks.append(("╯" if ends else "╮", name))
        else:
            marks.append(("│", at[column]) if column in at else (" ", ""))
    return tuple(marks)


# --- `roco top --graph` ---------------------------------------------------------------------------


WINDOW_S = 10.0
"""Rates are means over so long: a slow system has a communicate every second or two (estimate)."""
JUST_NOW_S = 2.0
"""A channel is bright so long after a communicate (estimate: as long as a look lasts)."""


WORDS = 22
"""Columns of what an agent does."""


class Node(msgspec.Struct, frozen=True):
    """An agent. `state`: of its FSM where it runs, else of its process."""

    name: str
    process: ProcessState | None
    state: str
    trouble: str


class Edge(msgspec.Struct, frozen=True):
    """A channel: communicates and bytes a second over `WINDOW_S`, how many in all, and when the
    last was [unix s].
    """

    name: str
    ends: tuple[str, str]
    per_s: float
    bytes_per_s: float
    count: int
    last: float | None


class Graph(msgspec.Struct, frozen=True):
    """Agents and channels at one moment. `at`: unix time [s]; `window_s`: what rates are taken
    over.
    """

    where: str
    at: float
    window_s: float
    agents: tuple[Node, ...]
    channels: tuple[Edge, ...]


def nodes(design: Design, seen: Iterable[Seen]) -> tuple[Node, ...]:
    """The agents of a design with what is known of them."""
    by_name = {one.name: one for one in seen}
    return tuple(_node(name, by_name.get(name)) for name in design.agents)


def edges(
    design: Design, lines: Iterable[LiveLine], at: float, window_s: float
) -> tuple[Edge, ...]:
    """The channels of a design with what the monitor heard on each until then [unix s]."""
    sent = [line for line in lines if isinstance(line, Sent)]
    found = []
    for name, channel in design.channels.items():
        heard = [line for line in sent if line.channel == name]
        late = [line.bytes for line in heard if line.t > at - window_s]
        rates = (len(late) / window_s, sum(late) / window_s)
        last = max((line.t for line in heard), default=None)
        found.append(Edge(name, channel.ends, *rates, len(heard), last))
    return tuple(found)


def _node(name: str, one: Seen | None) -> Node:
    if one is None:
        return Node(name, None, "not here", "")
    lives = one.status.state is ProcessState.READY and one.beat is not None
    state = one.beat.state if one.beat is not None and lives else str(one.status.state)
    return Node(name, one.status.state, state, trouble(one))


def drawn_graph(found: Graph, system: System) -> Text:
    """Agents one below the other, channels as arcs beside them; bright is what is in use."""
    names = max(len(node.name) for node in found.agents) + 2
    ends = {edge.name: edge.ends for edge in found.channels}
    agents = {node.name: node for node in found.agents}
    channels = {edge.name: edge for edge in found.channels}
    text = Text(no_wrap=True, overflow="ellipsis")
    for row in arc_rows(ordered(sorted(agents, reverse=True), ends), ends):
        node = agents[row.node] if row.node else None
        text.append_text(_label(node, names, system)).append(" ")
        for mark, channel in row.marks:
            text.append(mark, _light(channels[channel], found.at) if channel else "dim")
        if row.ends:
            edge = channels[row.ends]
            rate = f"{edge.per_s:.1f}/s {sized(edge.bytes_per_s)}/s"
            text.append(f"  {edge.name} ", "bold").append(rate, _light(edge, found.at))
            text.append(f", {edge.count} in all" if edge.count else ", none yet", "dim")
        text.append("\n")
    return text.append(f"rates over {found.window_s:g} s; {found.where}", "dim")


def _label(node: Node | None, names: int, system: System) -> Text:
    """An agent and what it does; `names`: columns of its name."""
    if node is None:
        return Text(" " * (names + WORDS))
    words = node.trouble or state_text(system, node.name, node.state) or node.state
    style = COLOURS.get(node.process or "", "") if node.process != "ready" else ""
    style = "red" if node.trouble else style
    label = Text.assemble((f"{node.name:{names}}", "bold"), (words, style))
    label.truncate(names + WORDS, overflow="ellipsis", pad=True)
    return label


def _light(edge: Edge, at: float) -> str:
    """The brightness of a channel."""
    if edge.last is not None and at - edge.last < JUST_NOW_S:
        return "bold green"
    return "green" if edge.per_s else "dim"


def sized(count: float) -> str:
    """Bytes in few characters."""
    return f"{count:.0f} B" if count < 1000 else f"{count / 1000:.1f} kB"


def dot(found: Graph) -> str:
    """The same for Graphviz."""
    lines = ["graph fleet {", "  node [shape=box, style=rounded];"]
    lines += [f'  {node.name} [label="{node.name}\\n{node.state}"];' for node in found.agents]
    for edge in found.channels:
        label = f"{edge.name}\\n{edge.per_s:.1f}/s {sized(edge.bytes_per_s)}/s"
        width = 3 if edge.per_s else 1
        lines.append(f'  {edge.ends[0]} -- {edge.ends[1]} [label="{label}", penwidth={width}];')
    return "\n".join([*lines, "}"])


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
    """Show agents, channels, the task and the state of its plan on a live screen; q or Ctrl-C ends
    it.

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
            return drawn_graph(self.graph(), self.system)
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
        told, _ = process_status.tasks_of(self.fleet)
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
        text.append(f"“{wish(task)}” ", "italic").append(task.state, COLOURS.get(task.state, ""))
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

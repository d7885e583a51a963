"""`roco top --graph`: agents and channels with what goes over them now: in the terminal, as JSON,
or for Graphviz.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import permutations
from typing import NamedTuple

import msgspec
from rich.text import Text

from console.fleet.process_status import Seen, trouble
from console.fleet.state_words import COLOURS, state_text
from operate.fleet_file import ProcessState
from operate.live_lines import LiveLine, Sent
from operate.system import System
from topdown.draw.canvas import tracks
from topdown.model.design import Design

# --- A graph as an arc diagram of characters: nodes one below the other, each edge an arc to their
# right
# Pure. Each row ends or begins one edge at most, so that a row has room for what is said of the
# edge that ends in it.


STEP = 3
"""Columns from one arc to the next one beside it."""
MOST = 7
"""Nodes of which all orders are tried: 5040, some hundredths of a second."""
Edges = Mapping[str, tuple[str, str]]


class Row(NamedTuple):
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


def rows(nodes: Sequence[str], edges: Edges) -> list[Row]:
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
    found: list[Row] = []
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
            found.append(Row(node if index == 0 else "", marks, name if over else ""))
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


def drawn(found: Graph, system: System) -> Text:
    """Agents one below the other, channels as arcs beside them; bright is what is in use."""
    names = max(len(node.name) for node in found.agents) + 2
    ends = {edge.name: edge.ends for edge in found.channels}
    agents = {node.name: node for node in found.agents}
    channels = {edge.name: edge for edge in found.channels}
    text = Text(no_wrap=True, overflow="ellipsis")
    for row in rows(ordered(sorted(agents, reverse=True), ends), ends):
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

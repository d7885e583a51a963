"""A graph as an arc diagram of characters: nodes one below the other, each edge an arc to their right.

Pure. Each row ends or begins one edge at most, so that a row has room for what is said of the edge that ends in it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import permutations
from typing import NamedTuple

STEP = 3
"""Columns from one arc to the next one beside it."""
MOST = 7
"""Nodes of which all orders are tried: 5040, some hundredths of a second."""
Edges = Mapping[str, tuple[str, str]]


class Row(NamedTuple):
    """`node`: whose first row this is, or ""; `marks`: characters with the edge they belong to; `ends`: the edge that
    ends here, or "".
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
    """The rows from the first node to the last. ValueError: an edge ends at no node, or at one node twice."""
    place = {node: number for number, node in enumerate(nodes)}
    for name, ends in edges.items():
        if not set(ends) <= place.keys() or ends[0] == ends[1]:
            raise ValueError(f"edge {name} joins {ends[0]} and {ends[1]}; there are {', '.join(nodes)}")
    spans = {name: tuple(sorted(place[end] for end in ends)) for name, ends in edges.items()}
    lanes = _lanes(spans)
    width = 1 + STEP * (max(lanes.values(), default=-1) + 1)
    found: list[Row] = []
    going: set[str] = set()
    for number, node in enumerate(nodes):
        turns = list(_turns(number, spans, lanes))
        for index, (name, over) in enumerate(turns or [("", False)]):
            going -= {name} if over else set()
            marks = _marks(index, len(turns), name, over, going, lanes, width)
            found.append(Row(node if index == 0 else "", marks, name if over else ""))
            going |= {name} if name and not over else set()
    return found


def _lanes(spans: Mapping[str, tuple[int, ...]]) -> dict[str, int]:
    """Return the column of each edge: short ones inside, none over another."""
    lanes: dict[str, int] = {}
    for name, (begin, end) in sorted(spans.items(), key=lambda item: (item[1][1] - item[1][0], item[1])):
        taken = {lanes[other] for other in lanes if spans[other][0] < end and begin < spans[other][1]}
        lanes[name] = next(lane for lane in range(len(spans)) if lane not in taken)
    return lanes


def _turns(number: int, spans: Mapping[str, tuple[int, ...]], lanes: Mapping[str, int]) -> Iterator[tuple[str, bool]]:
    """Yield the edges that turn at a node: those that end, inner first, then those that begin, outer ones first."""
    here = sorted(spans, key=lambda name: lanes[name])
    yield from ((name, True) for name in here if spans[name][1] == number)
    yield from ((name, False) for name in reversed(here) if spans[name][0] == number)


def _marks(
    index: int, count: int, name: str, ends: bool, going: set[str], lanes: Mapping[str, int], width: int
) -> tuple[tuple[str, str], ...]:
    """A row's characters from the node to the last arc."""
    at = {1 + STEP * lanes[other] + STEP - 1: other for other in going}
    turn = 1 + STEP * lanes[name] + STEP - 1 if name else 0
    first = " " if not count else "─" if count == 1 else "┬" if index == 0 else "╰" if index == count - 1 else "├"
    marks = [(first, name)]
    for column in range(1, width):
        if column < turn:
            marks.append(("┼" if column in at else "─", name))
        elif column == turn:
            marks.append(("╯" if ends else "╮", name))
        else:
            marks.append(("│", at[column]) if column in at else (" ", ""))
    return tuple(marks)

"""The graph of agents and channels: drawn as arcs that join what they should, with rates as the
lines say.
"""

from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.design import DESIGN
from companion.tools.system import SYSTEM
from console.fleet.process_status import Beat, Seen
from console.terminal import top
from console.terminal.top import Graph, arc_rows, dot, drawn_graph, ordered
from operate.fleet_file import ProcessState, ProcessStatus
from operate.live_lines import Sent

NODES = ("a", "b", "c", "d", "e")
edges = st.dictionaries(
    st.sampled_from([f"E{n}" for n in range(8)]),
    st.sampled_from(list(combinations(NODES, 2))),
    max_size=8,
)


@given(edges)
def test_every_edge_joins_its_two_nodes(joined: dict[str, tuple[str, str]]) -> None:
    """One corner at each end, in a row of that node, and a line in one column without a gap between
    them.
    """
    rows = arc_rows(NODES, joined)
    assert [row.node for row in rows if row.node] == list(NODES)
    of = []
    for row in rows:
        of.append(row.node or of[-1])
    for name, ends in joined.items():
        corners = [
            (n, m)
            for n, row in enumerate(rows)
            for m, mark in enumerate(row.marks)
            if mark in (("╮", name), ("╯", name))
        ]
        assert len(corners) == 2
        (top, column), (bottom, same) = corners
        assert column == same
        assert {of[top], of[bottom]} == set(ends)
        between = [rows[n].marks[column][0] for n in range(top + 1, bottom)]
        assert set(between) <= {"│", "┼"}
        assert [row.ends for row in rows].count(name) == 1


@given(edges)
def test_no_order_of_the_nodes_has_shorter_arcs_than_the_one_chosen(
    joined: dict[str, tuple[str, str]],
) -> None:
    """Than the one given, at least; and no node is lost."""

    def length(order: list[str]) -> int:
        return sum(abs(order.index(one) - order.index(other)) for one, other in joined.values())

    found = ordered(NODES, joined)
    assert sorted(found) == list(NODES)
    assert length(found) <= length(list(NODES))


def test_an_edge_to_nowhere_is_named() -> None:
    """With the nodes there are."""
    with pytest.raises(ValueError, match="edge E joins a and z; there are a, b"):
        arc_rows(("a", "b"), {"E": ("a", "z")})


def sent(t: float, channel: str, size: int) -> Sent:
    """A communicate that was heard."""
    return Sent(
        t=t,
        channel=channel,
        sender="pl",
        receiver="km",
        protocol="query",
        performative="query-ref",
        bytes=size,
    )


LINES = (sent(80.0, "C4", 900), sent(95.0, "C4", 100), sent(99.0, "C4", 300), sent(99.5, "C9", 7))
SEEN = (
    Seen(ProcessStatus("km", ProcessState.READY, 5), Beat(pid=5, incarnation=1, state="idle"), 0.1),
    Seen(ProcessStatus("pl", ProcessState.BACKING_OFF, note="killed by signal 9")),
)
FOUND = Graph("here", 100.0, 10.0, top.nodes(DESIGN, SEEN), top.edges(DESIGN, LINES, 100.0, 10.0))


def test_rates_are_those_of_the_last_seconds() -> None:
    """Two communicates of 400 bytes in ten seconds, three in all; a channel that the design has not
    is left out.
    """
    c4 = next(edge for edge in FOUND.channels if edge.name == "C4")
    assert (c4.per_s, c4.bytes_per_s, c4.count, c4.last) == (0.2, 40.0, 3, 99.0)
    assert {edge.name for edge in FOUND.channels} == set(DESIGN.channels)


def test_the_drawing_fits_a_terminal_and_says_what_is_wrong() -> None:
    """80 columns; all agents, all channels; in words what an agent does."""
    text = drawn_graph(FOUND, SYSTEM).plain
    assert max(map(len, text.splitlines())) <= 80
    for name in (*DESIGN.agents, *DESIGN.channels):
        assert name in text
    assert "km  knows" in text
    assert "pl  killed by signal 9" in text
    assert "C4 0.2/s 40 B/s, 3 in all" in text


def test_graphviz_gets_an_edge_a_channel() -> None:
    """With the same rates."""
    text = dot(FOUND)
    assert text.count(" -- ") == len(DESIGN.channels)
    assert r'pl -- km [label="C4\n0.2/s 40 B/s", penwidth=3];' in text
    assert r'km [label="km\nidle"];' in text

"""The exploration engine against plain graph searches, and what it says of small models."""

from collections import deque
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from topdown.prove.engine import DEADLOCK, UNREACHED, WRONG, Finding, Move, Step, as_text, explore
from topdown.prove.stream import Variant, explore_stream


class Graph:
    """States are numbers; `arcs`: (from, to, fair, fault)."""

    def __init__(self, arcs, rest=(0,), bad=()):
        self.arcs, self.rest, self.bad = arcs, set(rest), set(bad)
        self.start = 0

    def moves(self, state):
        """The arcs that leave a state."""
        return [
            Move("it", f"to {there}", there, fair, fault)
            for here, there, fair, fault in self.arcs
            if here == state
        ]

    def at_rest(self, state):
        """One of the given ones."""
        return state in self.rest

    def wrong(self, state):
        """One of the given ones."""
        return "bad" if state in self.bad else ""

    def describe(self, state):
        """Its number."""
        return {"it": str(state)}


def distances(graph, start=0):
    """Length of a shortest way to each state that is reached; nothing beyond bad or dead ones."""
    far, waiting = {start: 0}, deque([start])
    while waiting:
        here = waiting.popleft()
        for move in () if here in graph.bad or dead(graph, here) else graph.moves(here):
            if move.there not in far:
                far[move.there] = far[here] + 1
                waiting.append(move.there)
    return far


def dead(graph, state):
    """Whether nothing but faults can happen, and it is not at rest."""
    return state not in graph.rest and all(move.fault for move in graph.moves(state))


def rest_in_reach(graph, state):
    """Whether fair moves lead to rest, or to a state beyond which nothing is looked at."""
    seen, waiting = {state}, [state]
    while waiting:
        here = waiting.pop()
        if here in graph.rest | graph.bad:
            return True
        found = [
            m.there for m in graph.moves(here) if m.fair and not m.fault and m.there not in seen
        ]
        seen.update(found)
        waiting.extend(found)
    return False


numbers = st.integers(0, 9)
arcs = st.lists(st.tuples(numbers, numbers, st.booleans(), st.booleans()), max_size=25)


@given(arcs, st.sets(numbers, min_size=1), st.sets(numbers))
def test_finds_exactly_what_a_plain_search_finds_by_a_shortest_way(arcs, rest, bad):
    """Any small graph: states, edges, each verdict, and the length of each trace."""
    graph = Graph(arcs, rest, bad)
    found = explore(graph, first=False)
    far = distances(graph)
    assert found.complete
    assert found.states == len(far)
    good = {state for state in far if state not in bad}
    ends = {state for state in good if dead(graph, state)}
    assert found.edges == sum(len(graph.moves(state)) for state in good - ends)
    stuck = {s for s in good - ends if not rest_in_reach(graph, s)}
    expected = {WRONG: bad & far.keys(), DEADLOCK: ends, UNREACHED: stuck}
    lengths = {finding.kind: len(finding.trace) for finding in found.findings}
    assert lengths == {
        kind: min(far[s] for s in states) for kind, states in expected.items() if states
    }


def plain(*arcs):
    """Fair arcs without a fault."""
    return [(here, there, True, False) for here, there in arcs]


def test_a_trace_can_be_followed_from_the_start():
    """Each step is a move of the state before it."""
    (finding,) = explore(Graph(plain((0, 1), (1, 2), (0, 3), (3, 0)))).findings
    assert [step.after["it"] for step in finding.trace] == ["1", "2"]
    assert finding.start == {"it": "0"}
    assert str(finding).splitlines()[1].split() == ["1.", "it:", "to", "1"]


def test_a_search_that_stops_early_says_what_is_open():
    """At a count of states, at a time, and at its first finding."""
    chain = Graph(plain(*((n, n + 1) for n in range(5000))), rest=(5000,))
    for limits in ({"most_states": 100}, {"seconds": 0.0001}):
        found = explore(chain, **limits)
        assert not found.complete
        assert not found.holds
        assert "not looked at" in found.unproven
    assert "first finding" in explore(Graph([], rest=())).unproven


@given(arcs, st.sets(numbers, min_size=1), st.integers(1, 9))
def test_a_search_that_stops_early_finds_only_what_the_whole_search_finds(arcs, rest, most):
    """Parts not looked at count as good: findings are true ones, and no trace is longer than need
    be.
    """
    graph = Graph(arcs, rest)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("topdown.prove.engine.LOOK_AT_CLOCK", 1)
        early = explore(graph, most_states=most, first=False)
    whole = {one.kind: len(one.trace) for one in explore(graph, first=False).findings}
    for finding in early.findings:
        assert finding.kind in whole
        assert len(finding.trace) >= whole[finding.kind]
        last = finding.trace[-1].after if finding.trace else finding.start
        assert finding.kind != UNREACHED or not rest_in_reach(graph, int(last["it"]))


def test_a_search_that_stops_early_finds_what_lies_within():
    """Two steps from the start nothing leads to rest, whatever the rest of a long chain is like."""
    chain = [(n, n + 1) for n in range(10, 5000)]
    graph = Graph(plain((0, 1), (1, 2), (2, 2), (0, 10), *chain), rest=(5000,))
    (found,) = explore(graph, most_states=100).findings
    assert (found.kind, len(found.trace)) == (UNREACHED, 1)
    assert found.trace[-1].after["it"] == "1"


RING = Graph(plain((0, 1), (1, 0)))


def test_time_is_that_of_the_processor(monkeypatch):
    """A search that has to wait for its turn is not stopped for it."""
    wall = count(step=100.0)
    monkeypatch.setattr("topdown.prove.engine.time.perf_counter", lambda: next(wall))
    found = explore(RING, seconds=50.0)
    assert found.holds
    assert found.seconds >= 100.0


def test_progress_is_told_while_it_runs(monkeypatch):
    """Numbers of states grow from call to call."""
    monkeypatch.setattr("topdown.prove.engine.TELL_EVERY_S", 0.0)
    told = []

    class Chain(Graph):
        def moves(self, state):
            return [Move("it", "on", (state + 1) % 5000)]

    assert explore(Chain([]), progress=lambda states, waiting: told.append((states, waiting))).holds
    assert len(told) >= 4
    assert told == sorted(told)


def test_states_are_handed_out_where_asked_for():
    """Else they are not kept."""
    assert set(explore(RING, keep=True).reached) == {0, 1}
    assert not explore(RING).reached


# --- Counterexamples are drawn: nothing of a trace is left out, and it fits -----------------------


LOST = explore_stream(Variant.RECEIPT_FIRST).findings[0]


def finding(*steps):
    """Three agents in a row; each step: (who, what, new state)."""
    state = {"hi": "idle", "co": "idle", "ta": "idle"}
    start, trace = dict(state), []
    for who, what, new in steps:
        state = state | ({who: new} if who in state else {})
        trace.append(Step(who, what, state))
    return Finding("wrong", "something", tuple(trace), start)


names = st.sampled_from(["hi", "co", "ta"])
states = st.sampled_from(["idle", "busy", "waiting for the report of the plan that is under way"])
words = st.sampled_from(["request", "inform[final]", "execute_the_whole_plan inform[progress]"])
whats = st.one_of(
    st.builds("{} -> {}".format, words, names),
    st.builds("{} <- {}".format, words, names),
    st.builds("{} <- {}; {} -> {}".format, words, names, words, names),
    st.just("dies and is restored"),
)
steps = st.lists(st.tuples(names | st.just("wire"), whats, states), max_size=8)


@given(steps, st.integers(80, 140))
def test_text_numbers_every_step_and_fits(trace, width):
    """This holds for any trace."""
    text = as_text(finding(*trace), width)
    lines = text.splitlines()
    assert [line[:3].strip() for line in lines[2:] if line[:3].strip().isdigit()] == [
        str(number) for number in range(1, len(trace) + 1)
    ]
    assert max(map(len, lines)) <= width


def test_half_arrows_leave_their_sender_and_arrive_at_their_receiver():
    """To the right and to the left, over an agent in between with the name of the one who is
    meant.
    """
    drawn = as_text(
        finding(
            ("hi", "request -> co", "asked"),
            ("co", "request <- hi", "busy"),
            ("ta", "inform -> hi", "idle"),
            ("wire", "loses inform of ta", ""),
        )
    )
    assert "o--request-->" in drawn
    assert "--request-->o" in drawn
    assert "<--inform to hi--o" in drawn
    assert "* loses inform of ta" in drawn
    assert drawn.count("[busy]") == 1


def test_a_real_counterexample_tells_its_story():
    """The lost message: every step and the states of both sides."""
    drawn = as_text(LOST)
    steps = ("issue 1", "record", "send 1", "take 1", "receipt 1", "dies and is restored")
    assert not [word for word in ("message 1 is lost", *steps) if word not in drawn]
    assert drawn.index("send 1") < drawn.index("take 1") < drawn.index("dies and is restored")

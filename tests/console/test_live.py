"""The picture of a run: folded from lines, drawn at any width; the graph of its channels."""

import io
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.design import DESIGN
from companion.languages.hfsm import Step as PlanStep
from companion.run_files import InWords, TaskLine
from companion.tools.system import SYSTEM
from companion.tools.verbs import pour_run
from console.fleet import process_tables
from console.fleet.process_status import Beat, Seen
from console.fleet.process_tables import show_status
from console.fleet.status import Status
from console.terminal import draw, run_state, top
from console.terminal.console import Console
from console.terminal.top import Graph, arc_rows, dot, drawn_graph, ordered
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.live_lines import (
    Against,
    AgentIn,
    Happened,
    LiveLine,
    PlanAt,
    PlanSeen,
    Sent,
    Step,
    Task,
)

TAKE, POUR = ("main", "take"), ("main", "pour")
APPROACH, GRASP = (
    Step((*TAKE, name), "take", ("jar_1",), act=act)
    for name, act in (("1", "MoveJoint"), ("2", "Grasp"))
)
TILT = Step((*POUR, "1"), "pour", ("jar_1", "bowl_1"), act="Pour")
STATES = (
    Step(("main",)),
    Step(TAKE, "take", ("jar_1",)),
    APPROACH,
    GRASP,
    Step(POUR, "pour", ("jar_1", "bowl_1")),
    TILT,
)
TASKS = (Task("pour", ("jar_1", "bowl_1")),)
SEEN = PlanSeen(t=0, plan="p", tasks=TASKS, states=STATES)

words = st.text("abc/", min_size=1, max_size=6)
SAID = dict.fromkeys(("sender", "receiver", "protocol", "performative"), words)
told = partial(st.builds, t=st.floats(0, 1e9))


def one_of(*values: object) -> st.SearchStrategy[Any]:
    """One of these."""
    return st.sampled_from(values)


lines: st.SearchStrategy[LiveLine] = st.one_of(
    told(Sent, channel=one_of("C1", "C4", "C9"), bytes=st.integers(0, 10**6), **SAID),
    told(AgentIn, agent=one_of("ta", "pl"), state=words, alive=st.booleans()),
    told(PlanSeen, plan=words, tasks=one_of(TASKS, ()), states=one_of(STATES, ())),
    told(PlanAt, at=one_of(*STATES, Step(("elsewhere",)), None), outcome=one_of("", "failed")),
    told(Happened, name=words, of=st.lists(words, max_size=3).map(tuple), text=words),
)


def scene(view: run_state.View) -> draw.Scene:
    """A scene around a view, with something of everything."""
    processes = (
        ProcessStatus("router", ProcessState.READY, 7),
        ProcessStatus("ta", ProcessState.READY, 8, restarts=2),
        ProcessStatus("pl", ProcessState.GIVEN_UP, note="no program"),
    )
    fleet = Fleet("test", "tcp/127.0.0.1:1", 9, 0.0, processes)
    return draw.Scene(
        "a run",
        0.0,
        SYSTEM,
        fleet,
        (TaskLine("hi-1-1", "running", "on my way", "pour"),),
        view,
        stop_held=True,
    )


def drawn(view: run_state.View, width: int = 110) -> str:
    """The picture as text."""
    console = Console(width=width, record=True, force_terminal=True, file=io.StringIO())
    console.print(draw.picture(scene(view), now=12.0))
    return console.export_text()


def folded(*told: LiveLine) -> run_state.View:
    """The view after these lines."""
    view = run_state.View()
    for line in told:
        view = run_state.fold(view, line)
    return view


@given(st.lists(lines, max_size=20), st.integers(20, 200))
def test_whatever_was_told_can_be_drawn(told: list[LiveLine], width: int) -> None:
    """No line and no width of a terminal breaks the picture; the fleet stands in it."""
    text = drawn(folded(*told), width)
    assert "router" in text or width < 60


@given(st.lists(lines, max_size=20))
def test_counts_are_those_of_the_lines(told: list[LiveLine]) -> None:
    """Each communicate counts once, on its channel, with its bytes."""
    view = folded(*told)
    for channel in ("C1", "C4", "C9"):
        sent = [line for line in told if isinstance(line, Sent) and line.channel == channel]
        counted = view.channels.get(channel, run_state.Counted())
        assert (counted.count, counted.bytes) == (len(sent), sum(line.bytes for line in sent))


def test_the_present_state_stands_out_and_those_before_are_ticked() -> None:
    """The tree shows where the robot is."""
    text = drawn(folded(SEEN, PlanAt(t=1, at=APPROACH), PlanAt(t=2, at=GRASP)))
    assert "▶ grasp" in text
    assert "✓ move joint" in text
    assert "▾ take jar" in text
    assert "· pour jar into bowl" in text
    assert "pour jar bowl" in text
    # a machine is left behind once its last state has passed
    assert "✓ take" in drawn(folded(SEEN, PlanAt(t=2, at=GRASP), PlanAt(t=3, at=TILT)))


@given(st.lists(lines, max_size=60), st.integers(24, 60), st.sampled_from((80, 100, 140)))
def test_the_picture_fits_the_terminal(told: list[LiveLine], height: int, width: int) -> None:
    """From 80 x 24 on nothing is cut off, however much has happened."""
    console = Console(width=width, height=height, force_terminal=True, file=io.StringIO())
    fleet = Fleet(
        "t", "", 9, 0.0, tuple(ProcessStatus(f"p{n}", ProcessState.READY, 1) for n in range(9))
    )
    # five lines instead of one
    reason = " ".join(["a long reason"] * 24) if height > 30 else "plan 1"
    task = TaskLine("hi-1-1", "planning", reason, "pour")
    many = (Happened(t=float(n), name="event", text=str(n)) for n in range(run_state.LATEST_EVENTS))
    whole = draw.Scene("a run", 0.0, SYSTEM, fleet, (task,), folded(*told, *many))
    assert len(console.render_lines(draw.picture(whole, 12.0, height, width))) < height


def test_a_task_is_shown_as_what_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    """Not as the "yes" that was said, with the step that its plan is at, if it is at one."""
    wish = InWords("take the jar", "weź słoik")
    steps = tuple(PlanStep("take", ("jar_1",)) for _ in range(12))
    runs = TaskLine("hi-1-1", "running", "pulls", "yes", wish=wish, steps=steps, number=3)
    waits = TaskLine("hi-1-2", "waiting", "", "take the bowl")
    show_status(Status("a run", None, (runs, waits), stop_held=False))
    assert capsys.readouterr().out.splitlines()[1:] == [
        "hi-1-1  running  take the jar: step 3 of 12  pulls",
        "hi-1-2  waiting  take the bowl",
    ]


REASON = "the task failed: " + " ".join(f"reason-{number}" for number in range(30))


def test_a_reason_can_be_read_whole() -> None:
    """Longer than a line at 80 columns: of an event, of a task, and of the verdict; no word is
    broken.
    """
    view = folded(Happened(t=1.0, name="ended", of=("failed",), text=REASON, again=True))
    told = draw.Scene(
        "a run", 0.0, SYSTEM, None, (TaskLine("hi-1-1", "failed", REASON, "pour"),), view
    )
    console = Console(width=80, height=40, record=True, force_terminal=True, file=io.StringIO())
    console.print(draw.picture(told, 12.0, console.height, console.width))
    text = console.export_text()
    assert " ".join(text.split()).count(REASON) == 2
    assert len(text.splitlines()) < console.height
    said = pour_run.verdict(
        pour_run.Report(success=False, failure=REASON), Path("run"), 80
    ).splitlines()
    assert max(map(len, said)) <= 80
    assert " ".join(" ".join(said[:-1]).split()) == f"no success: {REASON}"


def test_an_event_longer_than_the_picture_is_cut_where_it_ends() -> None:
    """The latest one comes first, older ones as long as they fit whole."""
    view = folded(
        Happened(t=1.0, name="old", text=REASON), Happened(t=2.0, name="new", text=REASON)
    )
    lines = draw.events(view, 0.0, 5, 80, SYSTEM).plain.splitlines()
    assert len(lines) <= 5
    assert lines[0].startswith("    2 s  new: the task failed")
    assert len(draw.events(view, 0.0, 3, 40, SYSTEM).plain.splitlines()) == 3


def test_the_start_says_whom_it_waits_for() -> None:
    """Before there is a task, the second line tells how far the fleet is."""
    processes = (
        ProcessStatus("router", ProcessState.READY, 7),
        ProcessStatus("km", ProcessState.STARTING, 8),
    )
    starting = draw.Scene("a run", 0.0, SYSTEM, Fleet("t", "", 9, 0.0, processes))
    assert "starting: 1 of 2 ready, waiting for km" in draw.header(starting, 3.0).plain
    assert "starting the supervisor" in draw.header(draw.Scene("a run", 0.0, SYSTEM), 0.0).plain


def test_states_of_all_agents_have_words() -> None:
    """No state of the design is shown as an id."""
    every = [(name, one.name) for name, agent in DESIGN.agents.items() for one in agent.state]
    assert [pair for pair in every if not process_tables.state_text(SYSTEM, *pair)] == []


@given(st.integers(1, 30), st.integers(1, 12), st.data())
def test_a_long_plan_is_cut_around_the_present_state(
    machines: int, leaves: int, data: st.DataObject
) -> None:
    """At most the given number of lines, in the order of the tree, and the present state is one of
    them.
    """
    inner = [(), *((f"s{n}",) for n in range(leaves))]
    states = [Step((f"m{m}", *path)) for m in range(machines) for path in inner]
    at = data.draw(st.sampled_from(states))
    shown = draw.shown(run_state.Plan("p", TASKS, tuple(states), at), 16)
    assert len(shown) <= 16
    assert at in shown
    assert list(shown) == [one for one in states if one in shown]


def test_only_whole_lines_are_read_and_strange_ones_left_out(tmp_path: Path) -> None:
    """A line in the making waits for the next look; a kind of a later version does no harm."""
    file = tmp_path / "live.jsonl"
    follow = run_state.Follow(run_state.of_file(file))
    assert follow.new() == []
    first, second = Happened(t=1.0, name="a"), Happened(t=2.0, name="b")
    whole = msgspec.json.encode(second) + b"\n"
    file.write_bytes(
        msgspec.json.encode(first) + b'\n{"kind":"Later","t":1}\nnot json\n' + whole[:9]
    )
    assert follow.new() == [first]
    with file.open("ab") as rest:
        rest.write(whole[9:])
    assert follow.new() == [second]
    assert follow.new() == []


AGAINST = Against(
    t=1.0,
    verdict="late",
    channel="C4",
    sender="km",
    receiver="pl",
    performative="inform-ref",
    why="too late",
)


def test_what_is_not_as_designed_is_an_event() -> None:
    """A person who watches sees it among what happened."""
    [event] = run_state.fold(run_state.View(), AGAINST).events
    assert (event.name, event.text) == ("late", "km > pl inform-ref: too late")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (PlanAt(t=0, at=GRASP), "  take jar (grasp)"),
        (PlanAt(t=0, at=TILT, outcome="failed"), ""),
        (PlanAt(t=0), ""),
        (PlanAt(t=0, at=Step(("Replan",))), ""),
        (SEEN, "plan received: pour jar bowl, in 3 steps"),
        (Happened(t=0, name="grasped", of=("jar_1",)), "jar grasped"),
        (Happened(t=0, name="grasped", of=("jar_2",)), "jar 2 grasped"),
        (
            Happened(t=0, name="plan-ended", of=("1", "Failed"), text="it slipped"),
            "plan 1 ended: Failed: it slipped",
        ),
        (
            Happened(t=0, name="command-received", of=("PutDown", "jar_1")),
            "command received: put down jar",
        ),
        (
            Happened(t=0, name="ended", of=("failed", "PutDown", "jar_1")),
            "ended, failed: put down jar",
        ),
        (Happened(t=0, name="disk limit", text="full"), "disk limit: full"),
        (Happened(t=0, name="plan-received", of=("1",), again=True), ""),
        (AgentIn(t=0, agent="km", state="idle", alive=False), "km: gone"),
        (AgentIn(t=0, agent="km", state="idle"), ""),
        (AGAINST, "not as designed, late: km > pl inform-ref: too late"),
    ],
)
def test_a_line_in_words(line: LiveLine, said: str) -> None:
    """Each line has the words that a log shows; a line that is only counted shows nothing."""
    assert run_state.in_words(line, SYSTEM) == said


# --- The graph of agents and channels: drawn as arcs that join what they should, with rates as the
# lines say.


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
SEEN_NOW = (
    Seen(ProcessStatus("km", ProcessState.READY, 5), Beat(pid=5, incarnation=1, state="idle"), 0.1),
    Seen(ProcessStatus("pl", ProcessState.BACKING_OFF, note="killed by signal 9")),
)
FOUND = Graph(
    "here", 100.0, 10.0, top.nodes(DESIGN, SEEN_NOW), top.edges(DESIGN, LINES, 100.0, 10.0)
)


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

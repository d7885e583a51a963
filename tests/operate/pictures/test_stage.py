"""Views of a run: live the same as afterwards, states, plan and paths as they were."""

import math
from collections import Counter
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from noted import Noted, live

from companion.design import DESIGN
from companion.languages import hfsm, rc, sw
from companion.sentences import at
from companion.telemetry import RobotState
from companion.tools import telemetry
from companion.tools.pictures import robot
from companion.tools.pictures.acts import DONE, WAY
from companion.tools.pictures.drawers import ACT, LOOP, PLAN_TEXT
from companion.tools.pictures.velma import VELMA
from companion.tools.system import SYSTEM
from operate.fault_lines import Fault
from operate.pictures.blueprint import LIVE_S, YOUNG, axis
from operate.pictures.file import end_s
from operate.pictures.sheet import CHANNELS, GREY, ORANGE, RED, flat_arrows
from operate.pictures.sheet import channel as colour_of
from operate.pictures.stage import (
    APART,
    ARROWS,
    FAULTS,
    GRAPH,
    MOST_LETTERS,
    REST,
    ROW_HIGH,
    ROWS,
    Stage,
    positions,
    ring,
)
from operate.recording import history
from operate.recording.happenings import Happening, of_history
from operate.recording.history import History
from operate.recording.records import FAULT, OPERATOR, House, Record
from operate.verdict_lines import Judged
from velma.model import tree
from velma.names import BODY, GRIP_BODY, START


def rows(sheet: Noted) -> Counter[tuple[str, int, str]]:
    """All rows, times in microseconds."""
    return Counter((entity, round(at * 1e6), repr(value)) for entity, at, value in sheet.drawn)


def test_live_and_afterwards_the_same_is_drawn(
    records: list[Record], past: history.History, sheet: Noted
) -> None:
    """Every row of every entity."""
    now = live(records, past.begin, past.begin + end_s(past) + 1.0)
    assert rows(now) == rows(sheet)
    assert now.rows == sheet.rows


USED = {f"C{number}" for number in range(1, 7)}
"""Channels of the pour."""


@pytest.mark.parametrize("which", ["sheet", "true_sheet"])
def test_each_communicate_is_a_point_and_a_line(which: str, request: pytest.FixtureRequest) -> None:
    """Sizes in the right channel at the right time; a line of the log for each verdict."""
    sheet = request.getfixturevalue(which)
    past = request.getfixturevalue("past" if which == "sheet" else "true_past")
    said = sorted((*past.said, *past.copies), key=lambda one: one.received)
    for channel in DESIGN.channels:
        there = [one for one in said if one.channel == channel]
        sizes = [(one.received - past.begin, (math.log10(one.size),)) for one in there]
        assert sheet.of(f"sizes/{channel}") == sizes
        judged = sum(one.channel == channel for one in past.judged)
        assert len(sheet.of(f"communicates/{channel}")) == judged
        assert (judged > 0) == (channel in USED)


def test_bandwidth_has_every_bit(true_past: history.History, true_sheet: Noted) -> None:
    """The area under each line is what its channel carried, copies too."""
    said = (*true_past.said, *true_past.copies)
    for channel in DESIGN.channels:
        kbit = sum(value[0] for _, value in true_sheet.of(f"bandwidth/{channel}")) * 0.25
        size = sum(one.size for one in said if one.channel == channel)
        assert kbit * 1000 / 8 == pytest.approx(size)


def test_a_line_has_its_level_by_the_verdict() -> None:
    """And says why, where it is not as designed."""
    for verdict, level in (
        ("legal", "INFO"), ("copy", "DEBUG"), ("slow", "WARN"), ("out of sequence", "ERROR"),
        ("malformed", "ERROR"),
    ):  # fmt: skip
        sheet, names = Noted(100.0), ("C1", "co", "ta", "coordinate", "inform")
        wrong = level == "ERROR"
        said = Judged(101.0, verdict, 9, *names, why="because", violation=wrong)
        Stage(sheet, SYSTEM).take(Happening(said.t, said))
        ((at, (text, found, _)),) = sheet.of("communicates/C1")
        assert (at, found, "because" in text) == (1.0, level, level in ("WARN", "ERROR"))


def test_lanes_change_when_agents_do(past: history.History, sheet: Noted) -> None:
    """A row for each change, no two in a row the same; every state has its label."""
    for agent in DESIGN.agents:
        lane = [state for _, state in sheet.of(f"agents/{agent}")]
        told = [one.state for one in past.entered if one.agent == agent and one.state]
        assert lane == told
    for name in (LOOP, "agents/ta/plan"):
        lane = [state for _, state in sheet.of(name)]
        assert lane
        assert all(a != b for a, b in pairwise(lane))
    acts = [state for _, state in sheet.of(ACT)]
    assert acts[1::2] == [REST] * (len(acts) // 2)
    assert len(acts) // 2 == sum(isinstance(one.content, rc.Done) for one in past.said)


def test_the_plan_shows_the_leaf_ta_is_in(past: history.History, sheet: Noted) -> None:
    """One marked leaf while it runs, the outcome at its end."""
    reports = [one.content for one in past.said if isinstance(one.content, sw.Report)]
    texts = [text for _, text in sheet.of(PLAN_TEXT)]
    to_ta = [one.content for one in past.said if one.channel == "C1"]
    plans = sum(isinstance(one, hfsm.HierarchicalPlan) for one in to_ta)
    assert len(texts) == 1 + plans + len(reports)
    marked = [[line for line in text.splitlines() if "▶" in line] for text in texts]
    leaves = [f"**▶ {at(hfsm.Place((), act=one.at.act))}**" for one in reports if one.at]
    assert [line.strip("- ").strip() for lines in marked for line in lines] == leaves
    assert all(len(lines) <= 1 for lines in marked)
    # What is behind is ticked, never what is ahead: ta goes through the synthetic plans in the
    # order of their text.
    assert any("  - ✓" in text for text in texts)
    assert all("✓" not in text.partition("▶")[2] for text in texts)
    assert "replan" in texts[-1] or "succeeded" in texts[-1]


def test_a_planned_path_ends_where_the_plan_says(
    true_past: history.History, true_sheet: Noted
) -> None:
    """The grip frame at the last joints of a free motion; nothing is left of it when the act is
    answered.
    """
    drawn = true_sheet.of(WAY)
    commands = [one for one in true_past.said if isinstance(one.content, rc.MoveJoint)]
    assert commands
    for one in commands:
        paths = next(value for at, value in drawn if at == one.received - true_past.begin)
        assert len(paths) == 1
        assert np.isfinite(paths[0]).all()
    assert drawn[-1][1] == []
    answers = sum(isinstance(one.content, rc.Done | rc.NotDone) for one in true_past.said)
    assert sum(not value for _, value in drawn) >= answers


def test_the_way_taken_ends_at_the_hand(true_past: history.History, true_sheet: Noted) -> None:
    """Within the trail's step, at the last telemetry."""
    q = robot.joints(telemetry.every(true_past, RobotState)[-1][1])
    frames = robot.world_frames(tree.links(), q)
    for side, name in GRIP_BODY.items():
        trail = true_sheet.of(f"{DONE}/{side}")[-1][1][0]
        assert np.linalg.norm(trail[-1] - frames[name].xyz) < 0.02


def test_every_joint_is_drawn_as_it_was_measured_last(
    true_past: history.History, true_sheet: Noted
) -> None:
    """Each moving link's turn is that of its joint."""
    q = robot.joints(telemetry.every(true_past, RobotState)[-1][1])
    for link in tree.links():
        if link.joint:
            (_, (at, turn)) = true_sheet.of("/".join((VELMA, *link.path)))[-1]
            assert at == link.at
            assert turn == pytest.approx(robot.turned(link, q[link.joint]), abs=1e-4)


def test_before_any_telemetry_the_arms_hang_down() -> None:
    """A fleet whose executor is late shows the start posture, not joints at zero."""
    sheet = Noted(100.0)
    Stage(sheet, SYSTEM)
    for name, q in zip(BODY, START, strict=True):
        link = next(link for link in tree.links() if link.joint == name)
        assert sheet.of("/".join((VELMA, *link.path))) == [(0.0, (link.at, robot.turned(link, q)))]


def test_channels_of_the_graph_light_up_and_fade(
    true_past: history.History, true_sheet: Noted
) -> None:
    """Each node stands between its agents; a channel is brightest while it carries, and dark at the
    end.
    """
    places = positions(SYSTEM.design)
    for name, channel in DESIGN.channels.items():
        ends = np.array([places[agent] for agent in channel.ends])
        assert places[name] == pytest.approx(tuple(ends.mean(axis=0)))
    number = list(places).index("C4")
    colours = [value[1][number] for _, value in true_sheet.of(GRAPH)]
    labels = [value[0][number] for _, value in true_sheet.of(GRAPH)]
    assert len(set(colours)) > 3
    assert labels[-1] == "C4"
    assert any(label.endswith("/s") for label in labels)


def test_nothing_is_before_the_beginning(past: history.History, sheet: Noted) -> None:
    """Events before the first communicate stand at its time; a thing's first place holds from then
    on.
    """
    assert min(one.at for one in past.entered) < past.begin
    assert min(at for _, at, _ in sheet.drawn) == 0.0
    entity = "world/things/jar_1"
    assert sheet.of(entity)[0][0] > 0
    assert sheet.rows[entity] == len(sheet.of(entity)) + 1


@pytest.mark.parametrize(("end_s", "start_s"), [(YOUNG, 0.0), (None, -LIVE_S)])
def test_live_plots_are_filled(end_s: float | None, start_s: float) -> None:
    """From the beginning of the run at first, later the last stretch before the cursor."""
    (span,) = axis(end_s).view_range.as_arrow_array().to_pylist()
    assert span == {"start": 1e9 * start_s, "end": 2e9}


# --- The newest communicates as arrows between lanes of agents ------------------------------------


TOLD_APART = 60.0
"""Of two colours by their red, green and blue, 0 to 255; estimate: a hue apart."""


def test_the_last_drawing_has_the_last_communicates(true_past: History, true_sheet: Noted) -> None:
    """In their order, each from its sender's lane to its receiver's, in its channel's colour."""
    said = sorted((*true_past.said, *true_past.copies), key=lambda one: one.received)[-ROWS:]
    at, rows = true_sheet.of(ARROWS)[-1]
    assert at == pytest.approx(said[-1].received - true_past.begin)
    assert len(rows) == ROWS
    lanes = ring(DESIGN)
    for row, (one, ((x, y), (along, down), text, colour)) in enumerate(
        zip(said, rows, strict=True), 1
    ):
        ends = lanes[round(x / APART)], lanes[round((x + along) / APART)]
        assert ends == (one.sender, one.receiver)
        assert (y, down) == (ROW_HIGH * row, 0.0)
        assert text.startswith(f"{one.conversation}: {one.performative}")
        assert len(text) <= MOST_LETTERS
        assert colour == colour_of(one.channel)


def test_it_is_not_drawn_for_each_communicate(true_past: History, true_sheet: Noted) -> None:
    """A search for a plan says hundreds within a second."""
    assert 10 < len(true_sheet.of(ARROWS)) < len(true_past.said) / 3


def test_rerun_gets_as_many_arrows_as_there_are_each_time() -> None:
    """One, then two."""
    one = ((0.0, 1.0), (2.0, 0.0), "said", RED)
    for column in flat_arrows([[one], [one, one]]):
        assert [*map(len, column.as_arrow_array().to_pylist())] == [1, 2]


def test_no_channel_looks_like_a_level_or_another_channel() -> None:
    """WARN is orange, ERROR red, DEBUG grey."""
    for number, one in enumerate(CHANNELS):
        for other in (*CHANNELS[:number], RED, ORANGE, GREY):
            assert math.dist(one, other) > TOLD_APART


# --- The lane of faults, the same live and afterwards ---------------------------------------------


def lines(fault: Fault) -> list[House]:
    """A fault as it was noted: waiting, begun, ended."""
    waits = msgspec.structs.replace(fault, began=0.0, ended=None, t=fault.began - 1.0)
    begun = msgspec.structs.replace(fault, ended=None, t=fault.began)
    told = [waits, begun, *([fault] if fault.ended is not None else [])]
    return [House(FAULT, OPERATOR, one.target, one.t, msgspec.json.encode(one)) for one in told]


@pytest.fixture
def some(records: list[Record], past: history.History) -> list[Record]:
    """The synthetic run with three faults, two of which overlap and one of which is not healed."""
    at = past.begin
    faults = [
        ("a", "kill", "pl", at + 2.0, at + 4.0, ""),
        ("b", "hang", "ta", at + 3.0, at + 5.0, "ta:running"),
        ("c", "pause", "km", at + 6.0, None, ""),
    ]
    names = ("id", "kind", "target", "began", "ended", "at")
    made = [Fault(t=row[4] or row[3], **dict(zip(names, row, strict=True))) for row in faults]  # type: ignore[arg-type]
    more = [line for fault in made for line in lines(fault)]
    return sorted([*records, *more], key=lambda one: one.received)


def test_overlapping_faults_stand_side_by_side(some: list[Record], past: history.History) -> None:
    """Live as afterwards; what waits for its moment is not there."""
    hang = "hang ta at ta:running"
    states = (
        (2.0, "kill pl"),
        (3.0, f"kill pl, {hang}"),
        (4.0, hang),
        (5.0, REST),
        (6.0, "pause km"),
    )
    expected = list(states)
    sheet = Noted(past.begin)
    stage = Stage(sheet, SYSTEM)
    for happening in of_history(history.of_records(some, SYSTEM)):
        stage.take(happening)
    for drawn in (sheet, live(some, past.begin, past.begin + 9.0)):
        assert [(pytest.approx(at, abs=1e-6), state) for at, state in drawn.of(FAULTS)] == expected


def test_a_run_without_faults_has_no_lane(sheet: Noted) -> None:
    """Nor a static look of one."""
    assert sheet.of(FAULTS) == []
    assert FAULTS not in sheet.looks


def test_the_history_has_each_fault_once(some: list[Record]) -> None:
    """As its last line has it; the lines are not traffic."""
    past = history.of_records(some, SYSTEM)
    goes_on = {one.id: one.ended is None for one in past.faults}
    assert goes_on == {"a": False, "b": False, "c": True}
    assert FAULT not in past.houses

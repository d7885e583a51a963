"""Views of a run: live the same as afterwards, states, plan and paths as they were."""

import math
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from noted import Noted, live

from companion.design import DESIGN
from companion.languages import hfsm, rc, sw
from companion.sentences import at
from companion.tools import telemetry
from companion.tools.pictures import robot
from companion.tools.pictures.acts import DONE, WAY
from companion.tools.pictures.drawers import ACT, LOOP, PLAN_TEXT
from companion.tools.pictures.velma import VELMA
from companion.tools.system import SYSTEM
from operate.pictures.blueprint import LIVE_S, YOUNG, axis
from operate.pictures.file import end_s
from operate.pictures.happenings import Happening
from operate.pictures.stage import REST, Stage
from operate.pictures.traffic import GRAPH, positions
from operate.recording import history
from operate.recording.records import Record
from operate.verdict_lines import Judged
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
    q = robot.joints(telemetry.robot(true_past)[-1][1])
    frames = robot.world_frames(robot.links(), q)
    for side, name in GRIP_BODY.items():
        trail = true_sheet.of(f"{DONE}/{side}")[-1][1][0]
        assert np.linalg.norm(trail[-1] - frames[name].xyz) < 0.02


def test_every_joint_is_drawn_as_it_was_measured_last(
    true_past: history.History, true_sheet: Noted
) -> None:
    """Each moving link's turn is that of its joint."""
    q = robot.joints(telemetry.robot(true_past)[-1][1])
    for link in robot.links():
        if link.joint:
            (_, (at, turn)) = true_sheet.of("/".join((VELMA, *link.path)))[-1]
            assert at == link.at
            assert turn == pytest.approx(robot.turned(link, q[link.joint]), abs=1e-4)


def test_before_any_telemetry_the_arms_hang_down() -> None:
    """A fleet whose executor is late shows the start posture, not joints at zero."""
    sheet = Noted(100.0)
    Stage(sheet, SYSTEM)
    for name, q in zip(BODY, START, strict=True):
        link = next(link for link in robot.links() if link.joint == name)
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

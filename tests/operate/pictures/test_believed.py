"""Beliefs in 3D: a label on each thing with its source and age, a ghost only where belief and truth
differ.
"""

import math

import msgspec
import pytest
from noted import Noted, afterwards
from synthetic import with_truth

from companion.languages import wm
from companion.languages.values import Pose, Side
from companion.telemetry import RobotState, TrueState
from companion.tools.pictures.scene import (
    APART,
    BELIEVED,
    LABELS,
    Believed,
    Scene,
    joints_at,
    label_text,
)
from companion.tools.report.believed import MOST_APART_MM, Belief
from companion.tools.telemetry import every
from operate.pictures.sheet import HIDDEN, Sheet, labels
from operate.recording.happenings import Happening
from operate.recording.history import History
from operate.recording.records import Spoken
from velma.names import BODY

FAR_M = 0.15


class Both:
    """Things and beliefs about them."""

    def __init__(self, sheet: Sheet) -> None:
        self._scene = Scene(sheet)
        self._believed = Believed(sheet, self._scene)

    def take(self, happening: Happening) -> None:
        """Draw both."""
        self._scene.take(happening)
        self._believed.take(happening)


@pytest.fixture(scope="module")
def moved(true_past: History) -> tuple[float, Noted]:
    """The recorded pour, in the last quarter of which the bowl is elsewhere in truth; since when
    [unix s].
    """
    told = every(true_past, TrueState)
    since = told[3 * len(told) // 4][0]
    states = []
    for at, state in told:
        bowl = state.poses["bowl_1"]
        x, y, z = bowl.xyz
        away = {**state.poses, "bowl_1": Pose((x, y - FAR_M, z), bowl.quat_wxyz)}
        states.append((at, msgspec.structs.replace(state, poses=away) if at >= since else state))
    return since, afterwards(with_truth(true_past, tuple(states)), Both)


def seen_of(past: History, thing: str) -> list[Spoken]:
    """The observations of a thing."""
    said = [one for one in past.said if isinstance(one.content, wm.SeenObject)]
    return [one for one in said if thing in one.id]


def texts(sheet: Noted, name: str) -> list[tuple[float, str]]:
    """The labels of a thing."""
    found = [(at, text) for at, rows in sheet.of(LABELS) for _, text in rows]
    return [(at, text) for at, text in found if text.startswith(f"{name}:")]


def test_labels_say_how_who_and_how_long_ago(true_past: History, true_sheet: Noted) -> None:
    """Of the things that can be taken; the age grows until the thing is seen again."""
    labels = [text for _, rows in true_sheet.of(LABELS) for _, text in rows]
    assert {text.partition(":")[0] for text in labels} == {"jar_1", "bowl_1"}
    seen = [one.received for one in seen_of(true_past, "jar")]
    jar = [(at, text) for at, text in texts(true_sheet, "jar_1") if "jar_1: seen" in text]
    assert len(jar) > 5
    for at, text in jar:
        ago = true_past.begin + at - max(one for one in seen if one <= true_past.begin + at)
        assert text == f"jar_1: seen\n{int(ago)} s ago, told by ta"
    held = [at for at, text in texts(true_sheet, "jar_1") if "in the left hand" in text]
    assert min(held) > max(at for at, _ in jar)


def test_where_belief_and_truth_agree_there_is_no_ghost(true_sheet: Noted) -> None:
    """Neither of what stands, nor of what a hand carries along."""
    entities = {entity for entity, _, _ in true_sheet.drawn}
    assert {one for one in entities if one.startswith(f"{BELIEVED}/")} == {LABELS}


def test_a_ghost_stands_where_the_moved_thing_was_seen(
    moved: tuple[float, Noted], true_past: History, true_sheet: Noted
) -> None:
    """Hidden before; then at the believed pose, with a line to the true one and the distance in
    words.
    """
    since, sheet = moved
    (_, hidden), *rows = sheet.of(f"{BELIEVED}/bowl_1")
    assert hidden == HIDDEN
    seen = [one.content.pose for one in seen_of(true_past, "bowl")]
    shown = [(at, value) for at, value in rows if value != HIDDEN]
    assert shown
    assert {value for _, value in shown} <= {(pose.xyz, pose.quat_wxyz) for pose in seen}
    assert min(at for at, _ in shown) >= since - true_past.begin
    ((one, other),) = sheet.of(APART)[-1][1]
    assert math.dist(one, other) == pytest.approx(FAR_M, abs=0.01)
    assert "in truth 1" in texts(sheet, "bowl_1")[-1][1]
    assert "in truth" not in texts(true_sheet, "bowl_1")[-1][1]


def test_what_slipped_from_a_hand_has_its_ghost_there(true_past: History) -> None:
    """In truth the jar stays where it was seen at first; km believes that the hand carries it."""
    first = every(true_past, TrueState)[0][1].poses["jar_1"]
    stays = lambda one: msgspec.structs.replace(one, poses={**one.poses, "jar_1": first})  # noqa: E731
    states = tuple((at, stays(one)) for at, one in every(true_past, TrueState))
    sheet = afterwards(with_truth(true_past, states), Both)
    carried = [one.poses["jar_1"].xyz for _, one in every(true_past, TrueState)]
    ghosts = [value[0] for _, value in sheet.of(f"{BELIEVED}/jar_1") if value != HIDDEN]
    assert len(ghosts) > 10
    assert all(min(math.dist(ghost, true) for true in carried) < 0.01 for ghost in ghosts)


def test_words_leave_out_what_is_not_known() -> None:
    """Nobody told of it; a distance that does not count."""
    assert label_text(Belief("lid_1"), 10.0, MOST_APART_MM) == "lid_1: never seen"
    held = Belief("jar_1", "in the left hand", side=Side.LEFT)
    assert label_text(held, 1.0, 40.4).endswith("in truth 40 mm away")


def test_joints_are_those_of_the_time_of_the_truth() -> None:
    """Between two states, in the last one, or not known."""
    states = [RobotState(1.0 + 0.1 * k, (float(k), *(0.0,) * 14)) for k in range(2)]
    for time_s, torso in ((1.0, 0.0), (1.025, 0.25), (1.1, 1.0), (1.105, 1.0)):
        assert joints_at(states, time_s)[BODY[0]] == pytest.approx(torso), time_s
    for time_s in (0.9, 2.0):
        assert BODY[0] not in joints_at(states, time_s)


def test_rerun_gets_as_many_labels_as_there_are_each_time() -> None:
    """None, then two."""
    drawn = labels([[], [((0, 0, 1), "a"), ((0, 2, 0), "b")]])
    places, names = (one.as_arrow_array().to_pylist() for one in drawn)
    assert (places, names) == ([[], [[0, 0, 1], [0, 2, 0]]], [[], ["a", "b"]])

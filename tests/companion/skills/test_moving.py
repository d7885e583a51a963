"""A straight line of the hand: blocked by what it would go into, not by what it leaves or only
passes.
"""

import numpy as np
import pytest

from companion import models
from companion.languages import rc
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.skills import moving
from companion.skills.loop_messages import Keep, Move
from companion.skills.moving import move_joint, straight
from companion.skills.skill import NotPossible
from velma import names
from velma.kinematics.frames import shifted, standing

LEFT = Side.LEFT
WAY_M = 0.06
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


def under(here, gap_m):
    """Put a box this far above the held jar, where no finger is; return the direction away from
    it.
    """
    jar = here.robot.grip(here.q, LEFT) * here.held[LEFT].T_grip_object
    here.models = {**here.models, "box_1": "box1"}
    half = models.MODELS["box1"].base.z
    up = -models.MODELS["jar"].base.z - half + gap_m
    here.place("box_1", standing(jar.translation + np.array([0.0, 0.0, up])))
    return np.array([0.0, 0.0, -1.0])


def moved(here, way):
    """Return the line of the left hand along a way (3,) [m]."""
    target = shifted(here.robot.grip(here.q, LEFT), way)
    return straight(here, LEFT, here.q, target, here.world.free)


@pytest.mark.parametrize("gap_m", [0.001, -0.004])
def test_what_is_close_or_touched_may_be_left(gap_m, jar_out):
    """The margin alone blocks nothing, nor does a thing that is touched and left."""
    here = jar_out.here
    away = under(here, gap_m)
    assert not here.world.free(here.q)
    assert len(moved(here, WAY_M * away)) > 1


def test_a_line_into_a_thing_is_blocked(jar_out):
    """From below it, and deeper into one that is touched."""
    here = jar_out.here
    for gap_m in (0.001, -0.004):
        away = under(here, gap_m)
        with pytest.raises(NotPossible) as hindered:
            moved(here, -WAY_M * away)
        (why,) = hindered.value.why
        assert (why.kind, why.because[0].words) == (Kind.NOT_STRAIGHT, ("collision",))


@pytest.mark.parametrize("touched", ["passed", "met", "end"])
def test_a_planned_path_goes_round_what_was_seen_since(jar_out, touched):
    """Another path to its end is taken; the planned one where it meets nothing, none where its end
    is in something.
    """
    here, turn = jar_out.here, np.zeros(15)
    turn[names.ARM["right"][0]] = -1.2
    path = [here.q + share * turn for share in np.linspace(0.0, 1.0, 25)]
    points = tuple(tuple(q[names.COLUMNS["right"]].tolist()) for q in path)
    at = here.robot.grip(path[{"passed": -1, "met": 14, "end": -1}[touched]], "right").translation
    if touched == "passed":
        at = at + np.array([0.0, 0.0, 1.0])
    here.models = {**here.models, "box_1": "box1"}
    here.place("box_1", standing(at))
    skill = move_joint(here, rc.MoveJoint("key", Side.RIGHT, points, 0.25, 0.3))
    if touched == "end":
        with pytest.raises(NotPossible) as hindered:
            next(skill)
        assert hindered.value.kind == rc.NotDoneKind.REPLAN
        ways = {(why.kind, "box_1" in why.words) for why in hindered.value.why}
        assert ways == {(Kind.WAY_NOT_FREE, True)}
        assert here.fingers["right"] != 0.3
        return
    followed = next(skill).path()
    np.testing.assert_allclose(followed[-1], path[-1], atol=1e-9)
    straight_on = np.abs(followed - here.q)[:, np.flatnonzero(turn == 0.0)].max() < 0.02
    assert straight_on == (touched != "met")
    if touched == "met":
        assert not any("box_1" in pair for q in followed[::5] for pair in here.world.touching(q))
    assert here.fingers["right"] == 0.3


@pytest.mark.parametrize("free_at_the_end", [True, False])
def test_fingers_that_would_meet_something_move_at_the_end_of_the_path(
    free_at_the_end, jar_out, monkeypatch
):
    """As beside a door that the hand let go of: on the path they stay as they are."""
    here, turn, bent = jar_out.here, np.zeros(15), 1.5
    turn[names.ARM["right"][0]] = -1.2
    path = [here.q + share * turn for share in np.linspace(0.0, 1.0, 25)]
    points = tuple(tuple(q[names.COLUMNS["right"]].tolist()) for q in path)
    if not free_at_the_end:
        here.models = {**here.models, "box_1": "box1"}
        at = here.robot.grip(path[-1], "right").act(np.array([0.0, 0.0, 0.05]))
        here.place("box_1", standing(at))
    whole = moving._clear

    def entangled(here, path, side, bent, speed):
        if bent is not None:
            raise NotPossible(rc.NotDoneKind.REPLAN)
        return path if not free_at_the_end else whole(here, path, side, bent, speed)

    monkeypatch.setattr(moving, "_clear", entangled)
    skill = move_joint(here, rc.MoveJoint("key", Side.RIGHT, points, 0.25, bent))
    if not free_at_the_end:
        with pytest.raises(NotPossible):
            next(skill)
        return
    followed = next(skill)
    np.testing.assert_allclose(followed.path()[-1], path[-1], atol=1e-9)
    assert followed.right == Keep()
    assert here.fingers["right"] != bent
    assert isinstance(next(skill).right, Move)
    assert next(skill, None) is None
    assert here.fingers["right"] == bent


def test_a_motion_that_cannot_be_ends_the_act_and_nothing_else(jar_out):
    """A speed of 0 ended the process of the skills."""
    outcome = jar_out.act(rc.MoveCartesian("key", LEFT, (rc.Segment((0.0, 0.0, 0.01), 0.0),)))
    assert (outcome.kind, outcome.why) == ("failed", (fact(Kind.MOTION_REFUSED, "tool_speed"),))
    assert "tool_speed is 0.0, expected a number from" in jar_out.here.refused

"""Carrying: upright, in front of the shoulder, out of the way of torso and other arm."""

import math
from itertools import islice

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velma import names
from velma.kinematics.collision import World
from velma.kinematics.frames import standing, tilt
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Box
from velma.kinematics.tasks.carrying import REGION_HIGH, REGION_LOW, TORSO_SWEEP, carries, upright


def test_a_carried_thing_is_upright_and_in_nobodys_way(
    robot: Robot, with_jar: tuple[World, np.ndarray, pin.SE3]
) -> None:
    """The hand in its region with the torso straight; free however the torso turns; the other arm
    untouched.
    """
    world, q, held = with_jar
    found = list(islice(carries(robot, world, "left", q, held, np.random.default_rng(2)), 6))
    assert len(found) == 6
    for posture in found:
        grip = robot.grip(posture, "left")
        assert tilt(grip * held) < 5e-3
        assert (grip.translation > REGION_LOW - 2e-3).all()
        assert (grip.translation < REGION_HIGH + 2e-3).all()
        assert posture[names.TORSO] == 0.0
        assert (posture[names.ARM["right"]] == q[names.ARM["right"]]).all()
        for torso in (0.0, *TORSO_SWEEP):
            turned = posture.copy()
            turned[names.TORSO] = torso
            assert world.free(turned)
    assert world.held("jar_1") == held


def test_the_right_hand_carries_on_its_own_side(
    robot: Robot, with_bowl: tuple[World, np.ndarray, pin.SE3]
) -> None:
    """The region is mirrored."""
    world, q, held = with_bowl
    posture = next(carries(robot, world, "right", q, held, np.random.default_rng(2)))
    x, y = robot.grip(posture, "right").translation[:2]
    assert REGION_LOW[0] - 2e-3 < x < REGION_HIGH[0] + 2e-3
    assert REGION_LOW[1] - 2e-3 < -y < REGION_HIGH[1] + 2e-3
    assert tilt(robot.grip(posture, "right") * held) < 5e-3


def test_nothing_is_carried_through_a_wall(
    robot: Robot, with_jar: tuple[World, np.ndarray, pin.SE3]
) -> None:
    """No carry posture is found if the torso cannot turn with it."""
    world, q, held = with_jar
    world.put("wall", [Box((0.02, 2.0, 2.0))], standing((0.5, 0.6, 1.2)))
    assert not list(carries(robot, world, "left", q, held, np.random.default_rng(2), tries=30))


@given(lean=st.floats(0.0, 1.5), heading=st.floats(-3.0, 3.0), limit=st.floats(0.05, 1.4))
@pytest.mark.parametrize("side", names.SIDES)
def test_upright_is_the_angle_of_the_things_axis(
    robot: Robot, side: str, lean: float, heading: float, limit: float
) -> None:
    """It holds exactly where the held thing leans by less than the limit."""
    q = np.array(names.START)
    axis = np.array([math.cos(heading), math.sin(heading), 0.0])
    leaning = pin.SE3(pin.exp3(axis * lean), np.array([0.5, 0.0, 1.0]))
    held = robot.grip(q, side).inverse() * leaning
    if abs(lean - limit) > 1e-6:
        np.testing.assert_array_equal(
            upright(robot, side, held, limit)(np.array([q, q])), lean < limit
        )

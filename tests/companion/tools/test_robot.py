"""The picture's kinematics is the robot's."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.telemetry import RobotState
from companion.tools.pictures import robot
from velma.kinematics.frames import transform
from velma.kinematics.robot import Robot
from velma.names import BODY, DISTAL, GRIP_BODY, HEAD, LOWER, PROXIMAL, SIDES, SPREAD, UPPER

LINKS = robot.links()
VELMA = Robot()


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(0.0, 1.0), min_size=15, max_size=15))
def test_hands_are_where_pinocchio_says(shares):
    """Grip frames agree with those of velma.kinematics in every posture."""
    q = LOWER + np.array(shares) * (UPPER - LOWER)
    frames = robot.world_frames(LINKS, dict(zip(BODY, q, strict=True)))
    for side in SIDES:
        found = transform(frames[GRIP_BODY[side]])
        assert np.allclose(found.homogeneous, VELMA.grip(q, side).homogeneous, atol=1e-9)


def test_telemetry_names_every_joint_of_the_model():
    """All joints get a position, and only they."""
    named = robot.joints(RobotState(sim_time_s=0.0, body=(0.0,) * 15))
    hands = {joint for of in (SPREAD, PROXIMAL, DISTAL) for side in SIDES for joint in of[side]}
    assert set(named) == {*BODY, *HEAD} | hands
    assert set(named) == {link.joint for link in LINKS if link.joint}


def test_links_have_looks():
    """There is something to see of torso, arms, hands and head."""
    seen = {link.name for link in LINKS if link.shapes}
    assert {"torso_link0", "right_arm_4_link", "left_HandPalmLink"} <= seen

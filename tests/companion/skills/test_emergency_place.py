"""Places where a cancelled task puts down a held thing. Geometry alone; the robot's set-point is
one of a real task.
"""

import numpy as np
import pinocchio as pin
import pytest

from companion.skills import emergency_place
from companion.skills.situation import Held, beginning
from velma.kinematics.frames import standing
from velma.kinematics.robot import Robot

BOWL, LEFT = "bowl_1", "left"
THINGS = {"table_1": "table", BOWL: "bowl_high"}
TORSO, RIGHT = -0.285, (-0.3, -1.8, 1.25, 0.85, 0.0, -0.5, 0.0)
Q = (TORSO, *RIGHT, -1.2691, 1.6345, -0.5411, -0.6871, 0.3599, -1.0661, -2.6567)
"""[rad] The left hand has the bowl at the far end of its reach, 0.1 m above the table."""
IN_HAND = (
    ((0.9899, -0.1375, 0.0354), (-0.1182, -0.6604, 0.7415), (-0.0786, -0.7382, -0.6700)),
    (-0.001, -0.013, 0.153),
)
RETREAT = [
    (pin.SE3(np.eye(3), np.array([0.0, 0.0, back])), 1.2) for back in (-0.025, -0.125, -0.16)
]


@pytest.fixture
def far_out():
    """The afternoon (docs/results/scheduling.md), seed 10: "put down the bowl" was cancelled."""
    here = beginning(Robot(), THINGS, {})
    here.q = np.array(Q)
    here.place("table_1", standing(np.array([0.78, -0.843, 0.0])))
    here.place(BOWL, standing(np.array([0.853, 0.446, 0.881])))
    rotation, at = IN_HAND
    u, _, vt = np.linalg.svd(np.array(rotation))
    here.take(LEFT, Held(BOWL, "", pin.SE3(u @ vt, np.array(at)), 0.3))
    return here


def test_what_is_held_far_out_is_put_down_there(far_out):
    """A spot as far from the shoulder as the hand is now can be reached."""
    found = emergency_place.free_spot(far_out, LEFT, RETREAT)
    place, path = found
    now = emergency_place.held_pose(far_out, LEFT).translation
    assert np.linalg.norm((place.translation - now)[:2]) < 0.4
    assert all(far_out.world.free(q) for q in path)

"""What the robot believes to be hidden by its own hand."""

import numpy as np
import pinocchio as pin
import pytest
from robot import Acting

from velma import names

BOWL = "bowl_1"
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


def test_fingers_that_are_closed_round_a_thing_hide_what_is_behind_them(jar_out: Acting) -> None:
    """Open ones, with which paths are checked, would leave it in view."""
    here, data = jar_out.here, jar_out.core.backend.data
    assert here.bent["left"] > here.fingers["left"] + 0.5
    knuckles = [data.joint(name).xanchor for name in names.DISTAL["left"]]
    eye = here.robot.camera(float(here.q[names.TORSO]), *here.head).translation
    here.place(BOWL, pin.SE3.Identity())  # so that its markers are where they are said to be
    here.markers = {BOWL: np.array([facing(eye, eye + 1.2 * (knuckle - eye)) for knuckle in knuckles])}
    closed = here.in_view(BOWL)
    here.bent.clear()
    assert not closed
    assert here.in_view(BOWL)


def facing(eye: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the corners (4, 3) of a marker of 1 mm that faces the eye."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), eye - at).matrix()
    half = 0.0005
    square = np.array([(-half, half, 0.0), (half, half, 0.0), (half, -half, 0.0), (-half, -half, 0.0)])
    return np.asarray(at + square @ turn.T)

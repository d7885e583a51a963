"""What the robot believes to be hidden by its own hand."""

import numpy as np
import pinocchio as pin
import pytest

from companion.skills import situation
from velma import names

BOWL = "bowl_1"
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


def test_fingers_that_are_closed_round_a_thing_hide_what_is_behind_them(jar_out, monkeypatch):
    """Open ones, with which paths are checked, would leave it in view. Markers are as small as what
    hides them.
    """
    monkeypatch.setattr(situation, "SURE_PX", 0.0)
    here, data = jar_out.here, jar_out.core.backend.data
    assert here.bent["left"] > here.fingers["left"] + 0.5
    knuckles = [data.joint(name).xanchor for name in names.DISTAL["left"]]
    eye = here.robot.camera(float(here.q[names.TORSO]), *here.head).translation
    here.place(BOWL, pin.SE3.Identity())  # so that its markers are where they are said to be
    here.markers = {
        BOWL: np.array([facing(eye, eye + 1.2 * (knuckle - eye), 0.001) for knuckle in knuckles])
    }
    closed = here.in_view(BOWL)
    here.bent.clear()
    assert not closed
    assert here.in_view(BOWL)


@pytest.mark.parametrize(
    ("side", "angle", "read"),
    [(0.026, 23.0, True), (0.026, 42.0, True), (0.026, 59.0, False), (0.06, 59.0, True)],
)
def test_a_marker_that_is_narrow_in_the_picture_is_not_surely_read(jar_out, side, angle, read):
    """A jar 1 m away showed three markers, turned so, and was not seen by the two that were read
    (env2, seed 134).
    """
    here = jar_out.here
    eye = here.robot.camera(float(here.q[names.TORSO]), *here.head).translation
    here.place(BOWL, pin.SE3.Identity())
    here.world.remove(BOWL)  # nothing but the width of the marker counts
    corners = facing(eye, eye + np.array([0.0, 0.0, 1.0]), side)
    turn = pin.exp3(np.radians(angle) * np.array([1.0, 0.0, 0.0]))
    here.markers = {
        BOWL: np.array([(corners - corners.mean(axis=0)) @ turn.T + corners.mean(axis=0)])
    }
    assert (here.in_view(BOWL) == {0}) is read


def facing(eye, at, side):
    """Return the corners (4, 3) of a marker of this size [m] that faces the eye."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), eye - at).matrix()
    half = side / 2.0
    square = np.array(
        [(-half, half, 0.0), (half, half, 0.0), (half, -half, 0.0), (-half, -half, 0.0)]
    )
    return np.asarray(at + square @ turn.T)

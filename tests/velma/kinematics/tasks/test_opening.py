"""A leaf is where the hand that leads it has brought its bar, also where the hand slides about the
bar meanwhile.
"""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from velma.kinematics.frames import standing
from velma.kinematics.tasks import opening

BAR = np.array([0.3, 0.05, 0.0])  # in the leaf's frame [m]; any but its axis
DEEP = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.1]))  # the hand before the bar


def about_bar(angle: float) -> pin.SE3:
    """Return a hand at the bar (T_leaf_grip), seen from the bar at this angle."""
    towards = pin.Quaternion.FromTwoVectors(
        np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
    ).matrix()
    return (
        pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), BAR) * pin.SE3(towards, np.zeros(3)) * DEEP
    )


@given(turn=st.floats(-1.6, 1.6), slide=st.floats(-0.8, 0.8), part=st.floats(0.0, 1.0))
def test_a_leaf_is_where_the_hand_has_led_its_bar(turn: float, slide: float, part: float) -> None:
    """To a step of the turn: the bar keeps its distance from the hand, and the hinge its place."""
    assume(abs(turn) > 0.1)
    leaf = standing(np.array([0.8, 0.4, 1.1]), 2.0)
    begin = about_bar(0.1)
    end = about_bar(0.1 + slide)
    truly = opening.turned(leaf, turn * part)
    now = truly * about_bar(0.1 + slide * part)
    found = opening.led(leaf, turn, begin, end, now)
    assert found.translation == pytest.approx(leaf.translation)
    assert abs(float(pin.log3(found.rotation.T @ truly.rotation)[2])) <= opening.STEP

"""Grasps by contact, as the loop does them: touch, squeeze, lock, lift. Nothing is welded."""

import math

import numpy as np
import pytest
from grips import BOWL_POSTURE, DYNAMICS, JAR_POSTURE, at, jar_gripped, lever, raised, standing

from companion.skills.loop_messages import Close, Move, Open, Payload, Phase, Until, motion
from velma.names import BODY


def test_a_jar_is_held_and_lifted():
    """Squeezed against the palm by three fingers: it slips less than 2 mm and keeps its content."""
    core, truth = jar_gripped()
    result = core.report
    assert (result.phase, result.ended_by) == (Phase.DONE, Until.TOUCH)
    assert result.left.touched == (True, True, True)
    assert truth.fingers_on("jar_1")["left"] >= 4  # fingertips and palm
    held = np.array(lever(core, truth, 1, "jar_1"))
    payload = Payload(0.26, tuple(held))
    result = core.run(
        motion("lift", raised(core.setpoint, 1, 0.03), payload_left=payload, settle_s=0.5)
    )
    assert result.phase is Phase.DONE
    assert np.linalg.norm(lever(core, truth, 1, "jar_1") - held) < 0.002
    assert at(truth, "jar_1")[2] > 1.305
    assert truth.grains_in("jar_1") == 30


def test_a_bowl_is_held_by_its_rim_without_tilting_and_let_go():
    """Touch and 0.8 degrees of squeeze: lifted it tilts below 2 degrees; set down by contact and
    let go, it stays.
    """
    core, truth = standing(BOWL_POSTURE, 0, math.radians(60))
    start = np.array(at(truth, "bowl_1"))
    result = core.run(
        motion("grip", core.setpoint, until="touch", right=Close(squeeze=math.radians(0.8)))
    )
    assert result.right.touched == (True, True, True)
    assert truth.fingers_on("bowl_1")["right"] == 3
    assert np.linalg.norm(at(truth, "bowl_1") - start) < 0.004
    up = raised(core.setpoint, 0, 0.03)
    payload = Payload(0.3, lever(core, truth, 0, "bowl_1"))
    core.run(motion("lift", up, payload_right=payload, settle_s=1.0))
    assert truth.tilt_deg("bowl_1") < 2.0
    assert at(truth, "bowl_1")[2] > start[2] + 0.025
    down = raised(core.setpoint, 0, -0.045)
    result = core.run(motion("down", down, until="contact", contact_side="right", settle_s=0.3))
    assert result.ended_by is Until.CONTACT
    core.run(motion("open", core.setpoint, right=Open(), payload_right=Payload(), settle_s=0.2))
    core.run(motion("wide", core.setpoint, right=Move((1.05, 1.05, 1.05), speed=0.5), settle_s=0.5))
    assert truth.fingers_on("bowl_1")["right"] == 0
    assert truth.tilt_deg("bowl_1") < 0.5
    assert np.linalg.norm(np.subtract(at(truth, "bowl_1"), start)[:2]) < 0.006


@pytest.mark.parametrize("row", [0, 1])
def test_raised_hands_go_straight_up(row):
    """The helper of these tests does what it says."""
    q = np.array((BOWL_POSTURE, JAR_POSTURE)[row])
    before = DYNAMICS.grips(q)[1][row].copy()
    after = DYNAMICS.grips(raised(q, row, 0.03)[-1])[1][row]
    np.testing.assert_allclose(after - before, (0, 0, 0.03), atol=1e-4)
    assert len(q) == len(BODY)

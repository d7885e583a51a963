"""A motion is done only if joints, hands and fingers are at its end: simulated physics, joints that
stick.
"""

import copy

import numpy as np
import pytest
from grips import DYNAMICS

from companion.languages.facts import Kind
from companion.skills.loop_messages import Move, Phase, motion
from services.executor.loop.core import JOINT_BESIDE, JOINT_OFF, LoopCore
from velma.model import scene
from velma.names import BODY
from velma.sim.mujoco_backend import MujocoBackend

STICKS_NM = 500.0  # more than any motor gives
NEAR_RAD = 0.02


@pytest.fixture(scope="module")
def _core():
    made = LoopCore(MujocoBackend(scene.load()), dynamics=DYNAMICS)
    made.hold(0.2)
    return made


@pytest.fixture
def core(_core):
    """A robot at rest."""
    return copy.deepcopy(_core)


def stick(core, *words):
    """Let the joints whose names have all these words stick; return their names."""
    model = core.backend.model
    names = [model.joint(k).name for k in range(model.njnt)]
    for name in (found := [one for one in names if all(word in one for word in words)]):
        model.dof_frictionloss[model.joint(name).dofadr[0]] = STICKS_NM
    return found


def turn(core, joint, by=0.35, seconds=2.0):
    """A motion of one joint, smooth, and back from its limits."""
    s = np.linspace(0, 1, round(seconds * 100))[:, None]
    way = by * (-1.0 if core.setpoint[joint] > 0 else 1.0) * s * s * (3 - 2 * s)
    return motion("turn", core.setpoint + way * (np.arange(15) == joint))


@pytest.mark.parametrize("joint", [0, 1, 2, 4, 9, 11, 14])
def test_an_arm_with_a_joint_that_sticks_is_named(joint, core):
    """The motion is not done, and the set-point is where the arm is: the next one can begin
    there.
    """
    assert stick(core, BODY[joint])
    asked = turn(core, joint)
    report = core.run(asked)
    assert report.phase is Phase.BLOCKED
    assert abs(core.state.q[joint] - asked.path()[-1][joint]) > JOINT_OFF, "it did not stick"
    part = "torso" if joint == 0 else "right_arm" if joint < 8 else "left_arm"
    (why,) = report.why
    assert (why.kind, why.words) == (Kind.NOT_FOLLOWED, (part,)) or why.kind is Kind.BESIDE_ITS_PATH
    np.testing.assert_allclose(core.setpoint, core.state.q, atol=NEAR_RAD)
    other = 2 if joint != 2 else 9
    assert core.begin(turn(core, other, 0.1)) is None


@pytest.mark.parametrize("joint", [0, 4, 11])
def test_a_joint_that_stays_behind_ends_the_motion_on_the_way(joint, core):
    """Before the end of the path, whatever the hands are allowed."""
    assert stick(core, BODY[joint])
    way, seconds = turn(core, joint, 0.9, 3.0), 3.0
    report = core.run(motion("turn", way.path(), tolerance_m=10.0))
    assert (report.phase, report.why[0].kind) == (Phase.BLOCKED, Kind.NOT_FOLLOWED)
    assert report.time_s < seconds
    assert report.why[0].numbers[0] < 2 * JOINT_BESIDE


def test_a_joint_that_sticks_a_little_less_far_than_is_tolerated_is_there(core):
    """What is off by less than good runs are is done."""
    stick(core, BODY[4])
    assert core.run(turn(core, 4, 0.5 * JOINT_OFF)).phase is Phase.DONE


def test_a_finger_that_sticks_is_named(core):
    """The other two move."""
    found = stick(core, "right_HandFingerTwo", "KnuckleTwo")
    assert found
    report = core.run(motion("open", core.setpoint, right=Move((1.0, 1.0, 1.0))))
    assert report.phase is Phase.BLOCKED
    (why,) = report.why
    assert (why.kind, why.side, why.numbers[0]) == (Kind.FINGER_NOT_FOLLOWED, "right", 2)


def test_a_hand_that_is_pushed_aside_is_told(core):
    """60 N, which the impedance yields to by 4 cm: within the path's tolerance, not at the end."""
    model, data = core.backend.model, core.backend.data
    data.xfrc_applied[model.body("right_HandPalmLink").id, 1] = -60.0
    core.hold(1.0)
    report = core.run(turn(core, 2, 0.1))
    assert report.phase is Phase.BLOCKED
    assert report.why[0].kind in (Kind.NOT_FOLLOWED, Kind.HAND_OFF)

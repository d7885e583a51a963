"""Numbers that are set behind every check, on the simulated robot: a fault is counted and no hand
sinks, a stop holds, and after a release a new motion is done.
"""

import copy
import math

import numpy as np
import pytest
from doubles import RobotDouble
from grips import DYNAMICS, jar_gripped, lever, raised
from msgspec.structs import replace

from companion.skills.loop_messages import HeadGoal, Mode, Move, Payload, Phase, motion
from services.executor.loop.core import LoopCore
from velma.control import safety
from velma.model import scene
from velma.names import BODY, SIDES
from velma.sim.mujoco_backend import MujocoBackend

SUNK_M = 0.003  # allowed; 0.13 without the checks


def _set(path, value):
    """What sets an attribute of a core, or a part of it, to a value."""
    name, _, part = path.partition(".")

    def set_it(core):
        owner, attribute = (getattr(core, name), part) if part else (core, name)
        found = getattr(owner, attribute)
        if isinstance(found, np.ndarray):
            found[:] = value
        else:
            setattr(owner, attribute, value)

    return set_it


JAR_KG = 0.2 + 30 * 0.002  # with its content
VALUES = (math.nan, math.inf, -math.inf, 1e12)
# an open hand drops the jar
NOT_A_NUMBER, NOT_FINITE, NOT_OPEN = VALUES[:1], VALUES[:3], (math.nan, math.inf, 1e12)
INJECTED = {
    "_head_target": NOT_A_NUMBER, "_head_goal": VALUES, "payloads.mass": VALUES,
    "payloads._goal": VALUES,
    "payloads.lever": NOT_FINITE, "setpoint": NOT_FINITE, "impedance._damping": NOT_FINITE,
    "fingers.spread": VALUES, "fingers.locked": VALUES,
    "fingers.motor": NOT_OPEN, "fingers._goal": NOT_OPEN, "fingers._speed": NOT_OPEN,
    "fingers._spread_goal": VALUES,
}  # fmt: skip


def grips(core):
    """Heights of both grips [m]."""
    return core.dynamics.grips(core.backend.data.qpos[core.backend._q])[1][:, 2].copy()


@pytest.fixture(scope="module")
def carrying():
    """A loop that holds the jar 3 cm above its shelf, and all that is needed to return to this."""
    core, truth = jar_gripped()
    payload = Payload(JAR_KG, lever(core, truth, 1, "jar_1"))
    core.run(motion("lift", raised(core.setpoint, 1, 0.03), payload_left=payload, settle_s=0.5))
    assert core.report.phase is Phase.DONE
    return core


def again(core):
    """Another loop on another world, in the same state."""
    other = copy.deepcopy(core)
    other.hold(0.1)
    return other


@pytest.mark.timeout(300)
def test_no_value_lets_a_hand_sink(carrying, some):
    """Whatever it is: the arms stay up, a person's stop holds, a release is granted, a new motion
    is done.
    """
    rows = [(path, value) for path, values in INJECTED.items() for value in values]
    for path, value in some(rows, 13):
        print(path, value)
        stays_up(again(carrying), path, value)


def stays_up(core, path, value):
    """Of a loop that carries the jar."""
    before = grips(core)
    _set(path, value)(core)
    core.hold(0.2)
    assert core.faults >= (0 if _harmless(path, value) else 1)
    assert core.faults < 20
    core.stop()
    core.hold(0.4)
    assert core.mode is Mode.STOPPED
    assert np.abs(grips(core) - before).max() < SUNK_M
    core.release()
    core.hold(0.7)
    assert core.mode is Mode.MOTION
    faults = core.faults
    asked = motion(
        "on", raised(core.setpoint, 1, 0.02), head=HeadGoal(0.1, 0.1), right=Move((0.1, 0.1, 0.1))
    )
    assert core.run(asked).phase is Phase.DONE
    assert (core.faults, core.report.left.locked) == (faults, True)
    assert np.abs(grips(core) - before - (0.0, 0.02)).max() < 2 * SUNK_M


def _harmless(path, value):
    """Whether a value changes no command: laws cut to what can be reached, and a hand at rest has
    no speed.
    """
    limited = ("_head_goal", "fingers.motor", "fingers._goal", "fingers._spread_goal")
    cut = not math.isnan(value) and path in limited
    return cut or path in ("fingers._speed", "_head_target")


@pytest.mark.parametrize("name", ["q", "v", "proximal", "distal", "head", "spread", "wrist"])
def test_readings_that_are_none_let_no_hand_sink(carrying, name):
    """For a second, of one part: the jar's weight is held meanwhile."""
    core = again(carrying)
    before, observe = grips(core), core.backend.observe

    def lying():
        state = observe()
        getattr(state, name).ravel()[0] = math.nan
        return state

    core.backend.observe = lying
    core.hold(1.0)
    core.backend.observe = observe
    # no posture: no weight is known
    assert np.abs(grips(core) - before).max() < (0.02 if name == "q" else SUNK_M)
    core.stop()
    core.release()
    core.hold(1.1)
    assert core.run(motion("on", raised(core.setpoint, 1, 0.02))).phase is Phase.DONE
    assert all(math.isfinite(core.report.hand(side).grip.mass) for side in SIDES)


# rad/s: half as much again as the joints' own limits (KUKA LWR; torso of robot.yaml)
_ARM_TOO_FAST = (2.88, 2.88, 3.40, 3.40, 3.40, 4.71, 4.71)
TOO_FAST = (0.785, *_ARM_TOO_FAST, *_ARM_TOO_FAST)


def turning(joint, speed, count):
    """A core one of whose joints turns at a speed that nobody commands, for some cycles."""

    def moved(robot, before, _):
        robot.damped = safety.damping_torque(before.v)
        if len(robot.taus) <= count:
            robot._state.v[joint] = speed

    return LoopCore(RobotDouble(moved=moved), dynamics=DYNAMICS)


def test_a_joint_that_is_too_fast_is_damped(some):
    """By its own limit, after five cycles in a row; with four it is noise. A stop that held before
    holds after it.
    """
    for joint in some(range(15), 5):
        for share, count in ((-1.01, 4), (-0.99, 30)):
            core = turning(joint, share * TOO_FAST[joint], count)
            core.hold(0.1)
            assert core.faults == 0, (joint, share)
        core = turning(joint, -1.01 * TOO_FAST[joint], 8)
        core.stop()
        for _ in range(7):
            core.cycle()
        assert (core.mode, core.faults > 0) == (Mode.DAMPING, True), joint
        assert BODY[joint] in core.last_fault
        np.testing.assert_allclose(core.command.tau, core.backend.damped)
        core.hold(0.1)
        assert core.mode is Mode.STOPPED, "the stop of a person outlasts a fault"
        core.release()
        core.hold(1.1)
        assert core.mode is Mode.MOTION


def test_noise_of_the_joints_is_no_speed():
    """Of the size that the documented scenes have."""
    noisy = replace(scene.load(), noise=scene.Noise(joint=3e-4))
    core = LoopCore(MujocoBackend(noisy), dynamics=DYNAMICS)
    core.hold(8.0)
    assert core.faults == 0

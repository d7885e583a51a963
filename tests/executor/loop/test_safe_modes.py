"""The loop's core on a pretended robot, to the cycle: how long a safe mode lasts, which posture it holds, the counts.

Figures are those of Velma's lower level (common_predicates.cpp, safe state): torques of an arm up to 50 50 30 20 20 10
10 Nm, at least 500 cycles in the safe state, left by an explicit release only.
"""

import msgspec
import numpy as np
import pytest

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import Close, HeadGoal, Mode, Move, Payload, Phase, motion
from services.executor.loop.core import LoopCore, impossible
from velma.control.dynamics import Dynamics
from velma.control.joint import JointGains
from velma.model.build import ROBOT_XML
from velma.names import BODY, LOWER, START, UPPER
from velma.sim.mock_backend import MockBackend

DYNAMICS = Dynamics(ROBOT_XML)
ARM = (50.0, 50.0, 30.0, 20.0, 20.0, 10.0, 10.0)
MOVED, BENT = Move((0.5, 0.5, 0.5), spread=0.4), 0.8


@pytest.fixture
def core():
    return LoopCore(MockBackend(), dynamics=DYNAMICS)


@pytest.fixture
def grip():
    """A core whose right hand holds something, locked; the left one is a bit bent."""
    backend = MockBackend()
    backend.grasped[0] = BENT
    core = LoopCore(backend, dynamics=DYNAMICS)
    core.run(motion("grip", core.setpoint, until="touch", right=Close(squeeze=0.02), left=Move((0.3, 0.3, 0.3))))
    return core


def line(core, seconds=1.0, speed=0.1):
    """Knots of all joints at one speed [rad/s]."""
    return core.setpoint + np.arange(0.0, seconds, 0.01)[:, None] * speed


def cycles(core, count):
    for _ in range(count):
        core.cycle()


def broken(core, count=1):
    """Cycles in which the sensors throw."""
    observe, core.backend.observe = core.backend.observe, lambda: 1 / 0
    cycles(core, count)
    core.backend.observe = observe


def test_a_new_core_has_counted_nothing(core):
    """And is told of nothing: no cycle, no fault, no cut torque, no motion."""
    assert (core.cycles, core.faults, core.saturated, core.last_fault) == (0, 0, 0, "")
    assert (core.report.key, core.report.phase, core.busy) == ("", Phase.IDLE, False)
    core.hold(0.4)
    assert (core.cycles, core.state.time) == (200, pytest.approx(0.4))


def test_hands_stay_as_they_are_found():
    """A loop that starts again beside a robot with bent fingers lets nothing fall."""
    backend = MockBackend()
    backend.observe().proximal[:], backend.observe().spread[:] = BENT, 0.4
    core = LoopCore(backend, dynamics=DYNAMICS)
    cycles(core, 100)
    np.testing.assert_allclose(core.state.proximal, BENT)
    np.testing.assert_allclose(core.state.spread, 0.4)


@pytest.mark.parametrize("side", ["right", "left"])
def test_each_hand_does_what_it_alone_was_told(core, side):
    """It moves and takes its load; the other hand keeps both, and the report has each in its place."""
    own, other = (0, 1) if side == "right" else (1, 0)
    report = core.run(motion("move", START, **{side: MOVED, f"payload_{side}": Payload(0.3)}, settle_s=0.3))
    assert report.hand(side).proximal == pytest.approx((0.5,) * 3)
    assert report.hand("left" if own == 0 else "right").proximal == (0.0,) * 3
    assert core.state.spread[own] == pytest.approx(0.4)
    assert (core.payloads.mass[own], core.payloads.mass[other]) == (pytest.approx(0.3), 0.0)


@pytest.mark.parametrize("side", ["right", "left"])
def test_what_either_hand_cannot_do_is_refused_before_anything_begins(core, side):
    """With its name, in the report of a motion that never ran."""
    asked = motion("bend", line(core), head=HeadGoal(0.4, 0.0))
    refused = core.begin(msgspec.structs.replace(asked, **{side: Move((9.0, 0.0, 0.0))}))
    assert refused.why == (fact(Kind.MOTION_REFUSED, f"{side}.fingers[0]"),)
    assert f"{side}.fingers[0] is 9.0" in refused.text
    assert (core.report.key, core.report.phase, core.report.why) == ("bend", Phase.FAILED, refused.why)
    cycles(core, 50)
    np.testing.assert_allclose(core.setpoint, START)
    np.testing.assert_allclose(core.command.head, 0.0)


def test_a_refusal_reports_both_hands_as_they_are(grip):
    """The right one locked around something, the left one unlocked and bent less."""
    grip.begin(motion("far", START + 1.0))
    assert grip.report.phase is Phase.FAILED
    assert (grip.report.right.locked, grip.report.left.locked) == (True, False)
    assert grip.report.right.proximal[0] == pytest.approx(BENT, abs=0.01)
    assert grip.report.left.proximal[0] == pytest.approx(0.3)


def test_without_a_motion_a_cancel_changes_nothing(core):
    """With or without a key."""
    core.cancel()
    core.cancel("up")
    cycles(core, 5)
    assert (core.report.phase, core.mode, core.faults) == (Phase.IDLE, Mode.MOTION, 0)


def test_a_cancel_stops_the_fingers_at_once(core):
    """The arm needs 0.3 s to come to rest, a hand none."""
    core.begin(motion("up", line(core, 2.0), left=Move((1.0, 1.0, 1.0), speed=0.5)))
    cycles(core, 100)
    core.cancel("up")
    cycles(core, 1)
    at = core.command.proximal.copy()
    assert at[1, 0] == pytest.approx(0.1, abs=0.002)
    cycles(core, 100)
    assert core.report.phase is Phase.RUNNING
    np.testing.assert_array_equal(core.command.proximal, at)


@pytest.mark.parametrize("way", [-1, 1])
def test_each_joint_that_is_beyond_its_end_is_named(core, way):
    """Half a radian is the most; with a speed that is just possible the posture is to blame."""
    core.state.v[7] = 100.0
    for joint, name in enumerate(BODY):
        before = core.state.q[joint]
        core.state.q[joint] = (LOWER if way < 0 else UPPER)[joint] + way * 0.51
        assert impossible(core.state).startswith(f"{name} is measured at ")
        assert " rad, possible are " in impossible(core.state)
        core.state.q[joint] = before
    assert impossible(core.state) == ""


@pytest.mark.parametrize("joint", range(1, 15))
def test_a_torque_is_cut_to_what_the_lower_level_accepts_and_counted(core, joint):
    """One joint at a time, to the figures of VS; at its limit it is neither cut nor counted."""
    most = ARM[(joint - 1) % 7]
    for asked, sent, count in ((most, most, 0), (-most - 0.1, -most, 1), (1e6, most, 2), (0.0, 0.0, 2)):
        core.impedance.torque = lambda *_, asked=asked: asked * np.eye(15)[joint]
        core.cycle()
        assert core.command.tau[joint] == sent
        assert core.saturated == count
    assert core.faults == 0


def test_a_body_that_follows_is_not_damped_against_its_own_motion(core):
    """The speed that the law damps is the body's beside the path's: at 0.1 rad/s on a path of 0.1 rad/s it is 0."""
    slips, torque = [], core.impedance.torque
    core.impedance.torque = lambda terms, error, slip, *rest: (
        slips.append(slip.copy()) or torque(terms, error, slip, *rest)
    )
    core.begin(motion("line", line(core)))
    cycles(core, 250)
    core.state.v[:] = 0.1
    core.cycle()
    np.testing.assert_allclose(slips[-1], 0.0, atol=1e-9)


def test_every_fault_is_counted_once_and_named(core):
    """Of sensors, law and drive."""
    broken(core, 3)
    assert (core.faults, core.last_fault) == (3, "ZeroDivisionError: division by zero")
    core.backend.step = lambda _: [][0]
    core.cycle()
    assert (core.faults, core.last_fault) == (4, "IndexError: list index out of range")


def test_the_posture_held_is_that_in_which_damping_has_left_the_body(core):
    """Not the one at the fault, 40 ms before: the body ran on meanwhile."""
    core.begin(motion("line", line(core, 0.62, speed=0.5)))
    cycles(core, 300)
    core.abandon(())
    at_fault = core.setpoint.copy()
    core.state.v[:] = 0.4
    cycles(core, 19)
    before = core.state.q.copy()
    np.testing.assert_array_equal(core.setpoint, at_fault)
    cycles(core, 1)
    assert core.mode is Mode.HOLD
    np.testing.assert_array_equal(core.setpoint, before)
    assert (before > at_fault + 0.005).all()


def test_a_stop_holds_the_body_where_it_is(core):
    """Not where the path wanted it. A second stop does not begin the dwell again."""
    core.begin(motion("line", line(core, 0.62, speed=0.5)))
    cycles(core, 300)
    at = core.state.q.copy()
    assert np.abs(core.setpoint - at).max() > 0.005
    core.stop()
    np.testing.assert_array_equal(core.setpoint, at)
    core.release()
    cycles(core, 250)
    core.stop()
    cycles(core, 249)
    assert core.mode is Mode.STOPPED
    cycles(core, 1)
    assert core.mode is Mode.MOTION


@pytest.mark.parametrize("how", ["stop", "fault"])
def test_a_safe_mode_lasts_five_hundred_cycles_in_all(core, how):
    """Those of damping are of them."""
    core.stop() if how == "stop" else core.abandon(())
    core.release()
    cycles(core, 499)
    assert core.mode is (Mode.STOPPED if how == "stop" else Mode.HOLD)
    cycles(core, 1)
    assert core.mode is Mode.MOTION


def test_a_release_is_used_up_by_the_mode_it_ends(core):
    """The next fault waits for a release of its own, and so does one behind a release that came too early."""
    core.release()
    core.abandon(())
    core.release()
    broken(core)
    cycles(core, 1000)
    assert core.mode is Mode.HOLD
    core.release()
    cycles(core, 1)
    core.stop()
    cycles(core, 1000)
    assert core.mode is Mode.STOPPED


def test_abandoned_in_a_safe_mode_a_robot_stays_in_it(core):
    """A hold is not given up for damping."""
    core.stop()
    core.abandon(())
    assert core.mode is Mode.STOPPED


@pytest.mark.parametrize(("gains", "torso", "arm"), [(None, 10.0, 2.0), (JointGains((500.0, 400.0)), 5.0, 4.0)])
def test_a_posture_is_held_with_the_gains_asked_for(gains, torso, arm):
    """A hundredth of a radian beside it, at rest: 1000 and 200 Nm/rad where nobody asks for others."""
    core = LoopCore(MockBackend(), dynamics=DYNAMICS, hold=gains)
    core.stop()
    core.setpoint[:] += 0.01
    core.cycle()
    np.testing.assert_allclose(core.command.tau, [torso, *[arm] * 14])

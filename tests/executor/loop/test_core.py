"""The loop's core on a pretended robot: motions end, cycles end in a command, safe modes are left
only on demand. Figures are those of Velma's lower level (common_predicates.cpp, safe state).
"""

import itertools

import msgspec
import numpy as np
import pytest
from doubles import RobotDouble, reading, stays, throws
from grips import DYNAMICS
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import (
    FAULT,
    Close,
    HeadGoal,
    Mode,
    Move,
    Open,
    Payload,
    Phase,
    Until,
    motion,
)
from services.executor.loop.core import (
    BEYOND,
    DAMPING_CYCLES,
    HAND_OFF_M,
    LoopCore,
    Payloads,
    impossible,
)
from velma.control import safety
from velma.control.joint import JointGains
from velma.errors import MotionError
from velma.names import BODY, LOWER, SIDES, START, TORQUE, UPPER
from velma.sim.mock_backend import MockBackend

# Nm; at least 500 cycles in the safe state, left by a release
ARM = (50.0, 50.0, 30.0, 20.0, 20.0, 10.0, 10.0)
MOVED, BENT = Move((0.5, 0.5, 0.5), spread=0.4), 0.8
WIDE = Move((1.0, 1.0, 1.0), speed=0.5)


def made(**hooks):
    return LoopCore(RobotDouble(**hooks), dynamics=DYNAMICS)


@pytest.fixture
def core():
    return made()


@pytest.fixture
def grip(core):
    """A core whose right hand holds something, locked; the left one is a bit bent."""
    core.backend.grasped[0] = BENT
    left = Move((0.3, 0.3, 0.3))
    core.run(motion("grip", START, until="touch", right=Close(squeeze=0.02), left=left))
    return core


def rise(core, reach=0.1, seconds=1.0):
    u = np.linspace(0, 1, round(seconds / 0.01) + 1)
    return core.setpoint + reach * (u**3 * (10 - 15 * u + 6 * u * u))[:, None]


def line(core, seconds=1.0, speed=0.1):
    """Knots of all joints at one speed [rad/s]."""
    return core.setpoint + np.arange(0.0, seconds, 0.01)[:, None] * speed


def cycles(core, count):
    for _ in range(count):
        core.cycle()


def rising(core, count=200, **options):
    """Begin a motion and run some cycles of it."""
    assert core.begin(motion("up", rise(core), **options)) is None
    cycles(core, count)


def broken(core, count=1):
    """Cycles in which the sensors throw."""
    core.backend.observed = throws
    cycles(core, count)
    core.backend.observed = None


# --- motions --------------------------------------------------------------------------------------


def test_a_motion_ends_where_it_was_told(core):
    """Done, in its own time, with the set-point held afterwards."""
    path = rise(core)
    result = core.run(motion("up", path, settle_s=0.2))
    assert (result.key, result.phase, result.ended_by) == ("up", Phase.DONE, Until.END)
    assert result.time_s == pytest.approx(1.2, abs=0.02)
    np.testing.assert_allclose(core.setpoint, path[-1])
    cycles(core, 100)
    np.testing.assert_allclose(core.setpoint, path[-1])
    assert core.mode is Mode.MOTION


def test_a_cancelled_motion_slows_down_and_stays_and_the_next_one_begins_there(core):
    """Within 0.3 s. It counts as cancelled once it rests, not while its set-point still moves. The
    arm needs that time, a hand none.
    """
    rising(core, left=WIDE)
    core.cancel("other")
    cycles(core, 1)
    core.cancel("up")
    before = core.setpoint.copy()
    cycles(core, 1)
    at = core.command.proximal.copy()
    assert at[1, 0] == pytest.approx(0.2, abs=0.002)
    assert not np.array_equal(core.setpoint, before)
    count = 1
    while core.report.phase is Phase.RUNNING:
        cycles(core, 1)
        count += 1
    assert 140 < count <= 155
    assert core.report.phase is Phase.CANCELLED
    np.testing.assert_array_equal(core.command.proximal, at)
    before = core.setpoint.copy()
    cycles(core, 50)
    np.testing.assert_array_equal(core.setpoint, before)
    assert core.run(motion("on", rise(core))).phase is Phase.DONE


def test_without_a_motion_a_cancel_changes_nothing(core):
    """With or without a key."""
    core.cancel()
    core.cancel("up")
    cycles(core, 5)
    assert (core.report.phase, core.mode, core.faults) == (Phase.IDLE, Mode.MOTION, 0)


def test_a_second_motion_is_refused_and_the_first_goes_on(core):
    """One at a time; the report stays that of the running one."""
    core.begin(motion("first", rise(core)))
    refused = core.begin(motion("second", rise(core)))
    assert refused.why == (fact(Kind.BUSY, "loop"),)
    assert "first" in refused.text
    assert core.report.key == "first"
    with pytest.raises(MotionError, match="first"):
        core.run(motion("second", rise(core)))


def test_a_motion_that_starts_elsewhere_is_refused_with_a_reason(grip):
    """Nothing moves, and the report has both hands as they are."""
    result = grip.run(motion("far", START + 0.5))
    assert result.phase is Phase.FAILED
    assert result.why == (fact(Kind.MOTION_REFUSED, "first_knot"),)
    np.testing.assert_allclose(grip.setpoint, START)
    assert (result.right.locked, result.left.locked) == (True, False)
    assert result.right.proximal[0] == pytest.approx(BENT, abs=0.01)
    assert result.left.proximal[0] == pytest.approx(0.3)


def test_what_either_hand_cannot_do_is_refused_before_anything_begins(core):
    """With its name, in the report of a motion that never ran."""
    asked = motion("bend", line(core), head=HeadGoal(0.4, 0.0))
    for side in ("right", "left"):
        refused = core.begin(msgspec.structs.replace(asked, **{side: Move((9.0, 0.0, 0.0))}))
        assert refused.why == (fact(Kind.MOTION_REFUSED, f"{side}.fingers[0]"),)
        assert f"{side}.fingers[0] is 9.0" in refused.text
        report = core.report
        assert (report.key, report.phase, report.why) == ("bend", Phase.FAILED, refused.why)
    cycles(core, 50)
    np.testing.assert_allclose(core.setpoint, START)
    np.testing.assert_allclose(core.command.head, 0.0)


def test_a_paused_motion_rests_on_its_way_and_ends_all_the_same(core):
    """It runs as long as it takes; without a motion there is nothing to pause."""
    core.pause()
    goal = rise(core)[-1]
    rising(core)
    core.pause()
    cycles(core, 200)
    rest = core.setpoint.copy()
    cycles(core, 1000)
    np.testing.assert_allclose(core.setpoint, rest)
    assert core.report.phase is Phase.RUNNING
    assert not np.allclose(rest, goal)
    core.pause(False)
    cycles(core, 600)
    assert core.report.phase is Phase.DONE
    np.testing.assert_allclose(core.setpoint, goal)


def test_head_arrives_before_the_motion_is_done(core):
    """A look lasts as long as the head needs."""
    result = core.run(motion("look", core.setpoint, head=HeadGoal(0.4, 0.3, speed=0.5)))
    assert result.phase is Phase.DONE
    assert result.time_s == pytest.approx(0.5 / 0.5, abs=0.05)
    np.testing.assert_allclose(core.state.head, (0.4, 0.3), atol=0.02)


def test_contact_ends_a_motion_and_leaves_no_force():
    """A hand held up on its way down, as on a table: the set-point becomes where the body is."""
    core = made(moved=lambda robot, before, _: before.time > 0.5 and stays(robot, before, _))
    down = np.linalg.pinv(DYNAMICS.terms(START).jacobian)[:, 2] * -0.08
    path = core.setpoint + np.linspace(0, 1, 201)[:, None] * down
    result = core.run(motion("down", path, until="contact", contact_m=0.02, settle_s=0.1))
    assert (result.phase, result.ended_by) == (Phase.DONE, Until.CONTACT)
    assert 0.5 < result.time_s < 1.2
    np.testing.assert_allclose(core.setpoint, core.state.q)


def test_a_hand_far_from_its_path_ends_the_motion():
    """Beyond the tolerance it failed, by which hand and how far, and the body stays where it is."""
    core = made(moved=stays)
    result = core.run(motion("up", rise(core, 0.3)))
    assert result.phase is Phase.BLOCKED
    (why,) = result.why
    assert why.kind is Kind.BESIDE_ITS_PATH
    assert 0.1 < why.numbers[0] < 0.2
    np.testing.assert_allclose(core.setpoint, START)


def test_a_body_that_follows_is_not_damped_against_its_own_motion(core):
    """The speed that the law damps is the body's beside the path's: at 0.1 rad/s on a path of 0.1
    rad/s it is 0.
    """
    slips, torque = [], core.impedance.torque
    core.impedance.torque = lambda terms, error, slip, *rest: (
        slips.append(slip.copy()) or torque(terms, error, slip, *rest)
    )
    core.begin(motion("line", line(core)))
    cycles(core, 250)
    core.state.v[:] = 0.1
    core.cycle()
    np.testing.assert_allclose(slips[-1], 0.0, atol=1e-9)


ELBOW = 4


def bends_late(until_s):
    """Bend an elbow by a tenth of a radian in a second; it stays as it is until this time [s]."""

    def moved(robot, before, _):
        robot._state.q[ELBOW] = before.q[ELBOW] if before.time < until_s else START[ELBOW] + 0.1

    core = made(moved=moved)
    return core, core.run(motion("bend", START + (rise(core) - START) * (np.arange(15) == ELBOW)))


def test_a_joint_that_is_late_is_waited_for():
    """For three seconds. The motion is done if it comes meanwhile; else its arm is named and the
    body stays where it is.
    """
    _, late = bends_late(3.5)
    assert late.phase is Phase.DONE
    assert 3.5 < late.time_s < 4.0
    core, stuck = bends_late(99.0)
    assert (stuck.phase, stuck.time_s) == (Phase.BLOCKED, pytest.approx(4.0, abs=0.01))
    (why,) = stuck.why
    assert (why.kind, why.words) == (Kind.NOT_FOLLOWED, ("right_arm",))
    np.testing.assert_allclose(core.setpoint, core.state.q, atol=1e-4)


def test_at_the_end_of_a_motion_a_hand_may_be_a_centimetre_off(core):
    """A bit more is told by its side."""
    for row, side in enumerate(SIDES):
        error = np.zeros((2, 2, 3))
        error[row, 0, 1] = HAND_OFF_M
        assert core._off(motion("up", START), np.zeros(15), error.ravel()) == ()
        error[row, 0, 1] += 1e-6
        (why,) = core._off(motion("up", START), np.zeros(15), error.ravel())
        assert (why.kind, why.side) == (Kind.HAND_OFF, side)


def test_a_look_at_a_motion_is_due_after_each_time_that_was_asked_for(core):
    """The first one after the time in the motion, the next after the time in the answer. Only an
    answer to the running motion counts, and none before a look is due.
    """
    core.look_again("up", 0.1)
    assert core.look_due is False
    rising(core, 50, look_every_s=0.1)
    core.look_again("up", 5.0)
    assert core.look_due is False
    cycles(core, 1)
    core.look_again("other", 0.1)
    assert core.look_due is True
    core.look_again("up", 0.2)
    cycles(core, 99)
    assert core.look_due is False
    cycles(core, 1)
    assert core.look_due is True


# --- hands and loads ------------------------------------------------------------------------------


def test_closing_by_touch_stops_squeezes_and_locks(core):
    """Fingers that meet something have touched it; the hand ends locked."""
    core.backend.grasped[1] = 1.2
    result = core.run(motion("grip", core.setpoint, until="touch", left=Close(squeeze=0.02)))
    assert (result.phase, result.ended_by) == (Phase.DONE, Until.TOUCH)
    assert result.left.touched == (True, True, True)
    assert result.left.locked
    assert result.left.proximal[0] == pytest.approx(1.2, abs=0.01)
    assert not result.right.locked


def test_closing_on_nothing_ends_too(core):
    """At the angle where it is told to give up, with no finger touched and no squeeze."""
    close = Close(squeeze=0.02, upto=1.0, speed=1.0, lock=False)
    result = core.run(motion("grip", core.setpoint, until="touch", left=close))
    assert (result.phase, result.left.touched) == (Phase.DONE, (False, False, False))
    assert result.left.proximal[0] == pytest.approx(1.0, abs=0.015)


def test_a_locked_hand_must_be_opened_before_it_moves(grip):
    """So that nothing held is dropped by a motion that only forgot about it."""
    asked = motion("move", grip.setpoint, right=Move((0.2, 0.2, 0.2)))
    result = grip.run(asked)
    assert result.phase is Phase.FAILED
    assert result.why == (fact(Kind.MOTION_REFUSED, "right_hand"),)
    assert grip.run(motion("open", grip.setpoint, right=Open())).phase is Phase.DONE
    result = grip.run(asked)
    assert result.right.proximal[0] == pytest.approx(0.2, abs=0.02)
    assert not result.right.locked


def test_each_hand_does_what_it_alone_was_told():
    """It moves and takes its load; the other hand keeps both, and the report has each in its
    place.
    """
    for side, own, other in (("right", 0, 1), ("left", 1, 0)):
        core = made()
        options = {side: MOVED, f"payload_{side}": Payload(0.3)}
        report = core.run(motion("move", START, settle_s=0.3, **options))
        assert report.hand(side).proximal == pytest.approx((0.5,) * 3)
        assert report.hand("left" if own == 0 else "right").proximal == (0.0,) * 3
        assert core.state.spread[own] == pytest.approx(0.4)
        assert (core.payloads.mass[own], core.payloads.mass[other]) == (pytest.approx(0.3), 0.0)


def test_hands_stay_as_they_are_found():
    """A loop that starts again beside a robot with bent fingers lets nothing fall."""
    backend = RobotDouble()
    backend.observe().proximal[:], backend.observe().spread[:] = BENT, 0.4
    core = LoopCore(backend, dynamics=DYNAMICS)
    cycles(core, 100)
    np.testing.assert_allclose(core.state.proximal, BENT)
    np.testing.assert_allclose(core.state.spread, 0.4)


def test_a_stop_keeps_hands_locked_and_weight_carried(grip):
    """A held thing stays held."""
    rising(grip, payload_right=Payload(0.3, (0.0, 0.0, 0.02)))
    grip.stop()
    cycles(grip, 10)
    assert grip.command.locked[0] == 1.0
    assert grip.payloads.mass[0] == pytest.approx(0.3)


def test_a_weight_is_taken_up_gradually(core):
    """No step in the torques when something is lifted."""
    load = Payload(0.3, (0.0, 0.0, 0.02))
    core.begin(motion("lift", core.setpoint, settle_s=0.5, payload_left=load))
    masses = []
    for _ in range(150):
        core.cycle()
        masses.append(core.payloads.mass[1])
    assert max(np.diff(masses)) <= 0.0031
    assert masses[-1] == pytest.approx(0.3)


@pytest.mark.parametrize("wrong", ["mass", "_goal"])
def test_a_load_that_is_no_weight_is_a_fault_and_the_possible_number_stays(wrong):
    """Of the mass that is carried and of the mass to carry, whichever is possible."""
    loads = Payloads()
    loads.take(1, Payload(0.3))
    loads.advance(1.0)
    loads.take(1, Payload(0.2))
    kept = 0.2 if wrong == "mass" else 0.3
    getattr(loads, wrong)[1] = np.nan
    with pytest.raises(MotionError, match="payload"):
        loads.advance(0.002)
    loads.advance(1.0)
    np.testing.assert_allclose(loads.mass, (0.0, kept))


# --- faults ---------------------------------------------------------------------------------------


BROKEN = ({"observed": throws}, {"observed": reading("v", 3, np.nan)}, {"asked": throws})


@settings(max_examples=25, deadline=None)
@given(hooks=st.sampled_from(BROKEN), when=st.integers(0, 60))
def test_whatever_breaks_every_cycle_ends_in_an_accepted_command(hooks, when):
    """No exception leaves `cycle`; the command is finite and accepted; the motion ends with the
    reason.
    """
    core = made()
    rising(core, when)
    for name, hook in hooks.items():
        setattr(core.backend, name, hook)
    cycles(core, 5)
    taus = core.backend.taus
    assert len(taus) == when + 5
    assert all(np.isfinite(tau).all() and (np.abs(tau) <= TORQUE).all() for tau in taus)
    assert (core.report.phase, core.mode) == (Phase.FAILED, Mode.DAMPING)
    assert core.faults >= 5


READINGS = (("v", 1e8), ("v", -101.0), ("v", 1e308), ("q", 1e308), ("q", -1e200), ("q", 4.0))


def test_an_impossible_reading_pushes_nothing():
    """One joint's sensor is wrong: the motion ends in this cycle, no torque goes where a speed is
    not known, and no posture is held that nobody can be in.
    """
    for name, value in READINGS:
        core = made()
        rising(core, 100)
        core.backend.observed = reading(name, 3, value)
        cycles(core, 1)
        taus = core.backend.taus
        found = core.mode, core.report.phase, core.faults, core.report.why
        assert found == (Mode.DAMPING, Phase.FAILED, 1, FAULT), (name, value)
        assert BODY[3] in core.last_fault, (name, value)
        assert taus[-1][3] == 0.0 or name == "q", value
        cycles(core, 50)
        assert np.isfinite(taus).all(), (name, value)
        assert (np.abs(taus) <= TORQUE).all(), (name, value)
        assert core.mode is Mode.DAMPING, (name, value)
        assert np.abs(core.setpoint).max() < 4.0, (name, value)


def test_a_law_without_an_answer_is_a_fault(core):
    """A value that is not finite is never sent: damping goes out in the same cycle."""
    rising(core, 100)
    core.impedance.torque = lambda *_: np.full(15, np.nan)
    cycles(core, 1)
    assert (core.mode, core.report.phase, core.faults) == (Mode.DAMPING, Phase.FAILED, 1)
    np.testing.assert_allclose(core.backend.taus[-1], safety.damping_torque(core.state.v), atol=0.5)


def test_a_weight_is_held_in_damping_too(core):
    """For as long as it lasts."""
    core.payloads.mass[:] = core.payloads._goal[:] = 1.0
    core.abandon(())
    core.cycle()
    assert core.mode is Mode.DAMPING
    weight = core.dynamics.terms(core.state.q).jacobian[[2, 8]].sum(axis=0) * 9.81
    np.testing.assert_allclose(core.command.tau, weight, atol=0.5)
    assert np.abs(weight).max() > 1.5


def test_a_set_point_that_is_impossible_from_the_beginning_is_a_fault():
    """A head that tells no number is sent where an idle robot has it, and the fault is named."""
    core = made(observed=reading("head", 0, np.nan))
    cycles(core, 1)
    assert (core.mode, core.faults) == (Mode.DAMPING, 1)
    assert "the head's pan is nan rad" in core.last_fault
    np.testing.assert_array_equal(core.command.head, 0.0)


def test_every_fault_is_counted_once_and_named(core):
    """Of sensors, law and drive; cycles are counted whatever happens in them."""
    broken(core, 3)
    assert (core.cycles, core.faults) == (3, 3)
    assert core.last_fault == "RuntimeError: the bus is gone"
    core.backend.step = lambda _: [][0]
    core.cycle()
    assert (core.faults, core.last_fault) == (4, "IndexError: list index out of range")


def test_a_fault_stops_moving_fingers(core):
    """Twenty cycles of damping and the hold after them find the hand where it was."""
    rising(core, left=WIDE)
    broken(core)
    before = core.state.proximal.copy()
    cycles(core, 200)
    np.testing.assert_allclose(core.state.proximal, before, atol=0.01)


def test_what_is_just_possible_is_no_fault_and_a_bit_more_is_told_by_its_joint(core):
    """At the fastest speed, and half a radian beyond an end. With a speed that is just possible the
    posture is to blame.
    """
    state, limit = core.state, safety.FASTEST
    ends = ((LOWER - BEYOND, -1.0), (UPPER + BEYOND, 1.0))
    speeds = ((np.full(15, -limit), -1.0), (np.full(15, limit), 1.0))
    rows = [*(("v", *one) for one in speeds), *(("q", *one) for one in ends)]
    for (name, most, way), joint in itertools.product(rows, range(15)):
        state.v[7] = limit if name == "q" else 0.0
        values = getattr(state, name)
        before, values[joint] = values[joint], most[joint]
        assert impossible(state) == "", (name, joint)
        values[joint] = np.nextafter(most[joint], way * np.inf)
        assert impossible(state).startswith(f"{BODY[joint]} is measured at "), (name, joint)
        assert name == "v" or " rad, possible are " in impossible(state)
        values[joint] = np.nan
        assert impossible(state) == "a joint measurement is not a finite number"
        values[joint] = before


def test_a_torque_is_cut_to_what_the_lower_level_accepts_and_counted(core):
    """One joint at a time, to the figures of VS; at its limit it is neither cut nor counted."""
    for joint in range(1, 15):
        most, before = ARM[(joint - 1) % 7], core.saturated
        rows = ((most, most, 0), (-most - 0.1, -most, 1), (1e6, most, 2), (0.0, 0.0, 2))
        for asked, sent, count in rows:
            core.impedance.torque = lambda *_, asked=asked, joint=joint: asked * np.eye(15)[joint]
            core.cycle()
            assert core.command.tau[joint] == sent, joint
            assert core.saturated == before + count, joint
    assert core.faults == 0


# --- safe modes, to the cycle ---------------------------------------------------------------------


def test_a_new_core_has_counted_nothing(core):
    """And is told of nothing: no cycle, no fault, no cut torque, no motion."""
    assert (core.cycles, core.faults, core.saturated, core.last_fault) == (0, 0, 0, "")
    assert (core.report.key, core.report.phase, core.busy) == ("", Phase.IDLE, False)
    core.hold(0.4)
    assert (core.cycles, core.state.time) == (200, pytest.approx(0.4))


def test_damping_becomes_hold_after_twenty_cycles_and_hold_waits_for_a_release(core):
    """velma_core_ve_body leaves its safe state by joint impedance after that. No motion begins
    until somebody releases it and the dwell is over.
    """
    core.abandon((fact(Kind.GAVE_NO_ANSWER, "ex"),))
    cycles(core, 19)
    assert core.mode is Mode.DAMPING
    cycles(core, 1)
    assert core.mode is Mode.HOLD
    assert core.begin(motion("up", rise(core))).why == (fact(Kind.HELD_STILL, "hold"),)
    cycles(core, 2 * safety.DWELL_CYCLES)
    assert core.mode is Mode.HOLD
    core.release()
    cycles(core, 1)
    assert core.mode is Mode.MOTION
    assert core.run(motion("up", rise(core))).phase is Phase.DONE


def test_a_safe_mode_lasts_five_hundred_cycles_in_all(core):
    """However soon it is released. Those of damping are of them; a second stop does not begin it
    again.
    """
    for begin, mode in ((lambda: core.abandon(()), Mode.HOLD), (core.stop, Mode.STOPPED)):
        rising(core, 50)
        begin()
        assert core.report.phase is (Phase.FAILED if mode is Mode.STOPPED else Phase.INTERRUPTED)
        core.release()
        cycles(core, 250)
        if mode is Mode.STOPPED:
            core.stop()
        cycles(core, 249)
        assert core.mode is mode
        cycles(core, 1)
        assert core.mode is Mode.MOTION


def test_a_release_is_used_up_by_the_mode_it_ends(core):
    """The next fault waits for a release of its own, and so does one behind a release that came too
    early. A hold is not given up for damping.
    """
    core.release()
    core.abandon(())
    core.release()
    broken(core)
    cycles(core, 1000)
    assert core.mode is Mode.HOLD
    core.release()
    cycles(core, 1)
    core.stop()
    core.abandon(())
    assert core.mode is Mode.STOPPED
    cycles(core, 1000)
    assert core.mode is Mode.STOPPED


def test_time_has_to_go_on_while_something_is_to_happen(core):
    """A motion, damping, a release that waits for its dwell; neither at rest nor in hold."""
    rising(core, 0)
    assert core.busy is True
    broken(core)
    assert (core.mode, core.busy) == (Mode.DAMPING, True)
    cycles(core, DAMPING_CYCLES)
    assert (core.mode, core.busy) == (Mode.HOLD, False)
    core.release()
    assert core.busy is True
    cycles(core, safety.DWELL_CYCLES)
    assert (core.mode, core.busy) == (Mode.MOTION, False)


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
    """Not where the path wanted it."""
    core.begin(motion("line", line(core, 0.62, speed=0.5)))
    cycles(core, 300)
    at = core.state.q.copy()
    assert np.abs(core.setpoint - at).max() > 0.005
    core.stop()
    np.testing.assert_array_equal(core.setpoint, at)


@pytest.mark.parametrize(
    ("gains", "torso", "arm"), [(None, 10.0, 2.0), (JointGains((500.0, 400.0)), 5.0, 4.0)]
)
def test_a_posture_is_held_with_the_gains_asked_for(gains, torso, arm):
    """A hundredth of a radian beside it, at rest: 1000 and 200 Nm/rad where nobody asks for
    others.
    """
    core = LoopCore(MockBackend(), dynamics=DYNAMICS, hold=gains)
    core.stop()
    core.setpoint[:] += 0.01
    core.cycle()
    np.testing.assert_allclose(core.command.tau, [torso, *[arm] * 14])

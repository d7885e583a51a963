"""The loop's core on a pretended robot: motions end, cycles end in a command, safe modes are left
only on demand.
"""

import itertools

import msgspec
import numpy as np
import pytest
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
from services.executor.loop.core import BEYOND, DAMPING_CYCLES, LoopCore, impossible
from velma.control import safety
from velma.control.joint import JointGains
from velma.errors import MotionError
from velma.names import BODY, LOWER, START, TORQUE, UPPER
from velma.sim.mock_backend import MockBackend

# Nm; at least 500 cycles in the safe state, left by a release
ARM = (50.0, 50.0, 30.0, 20.0, 20.0, 10.0, 10.0)
MOVED, BENT = Move((0.5, 0.5, 0.5), spread=0.4), 0.8


class Watched(MockBackend):
    """Keeps the commands; throws or lies on demand."""

    def __init__(self):
        super().__init__()
        self.taus, self.broken = [], {}

    def observe(self):
        state = super().observe()
        if self.broken.get("observe") == "throws":
            raise RuntimeError("sensor bus is gone")
        if self.broken.get("observe") == "lies":
            state.v[3] = np.nan
        for name, value in self.broken.get("reading", {}).items():
            getattr(state, name)[3] = value
        return state

    def step(self, command):
        self.taus.append(command.tau.copy())
        if self.broken.get("step"):
            raise RuntimeError("drive bus is gone")
        super().step(command)


@pytest.fixture
def core():
    return LoopCore(Watched(), dynamics=DYNAMICS)


def rise(core, reach=0.1, seconds=1.0):
    u = np.linspace(0, 1, round(seconds / 0.01) + 1)
    return core.setpoint + reach * (u**3 * (10 - 15 * u + 6 * u * u))[:, None]


def cycles(core, count):
    for _ in range(count):
        core.cycle()


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


def test_a_cancelled_motion_slows_down_and_stays(core):
    """Within 0.3 s, with the reason in the report; the hands stop too."""
    core.begin(motion("up", rise(core), left=Move((1.0, 1.0, 1.0), speed=0.2)))
    cycles(core, 200)
    core.cancel("other")
    assert core.report.phase is Phase.RUNNING
    core.cancel("up")
    cycles(core, 155)
    assert core.report.phase is Phase.CANCELLED
    before = core.setpoint.copy()
    cycles(core, 50)
    np.testing.assert_array_equal(core.setpoint, before)
    assert core.report.left.proximal[0] < 0.2


def test_the_next_motion_may_begin_where_a_cancelled_one_stopped(core):
    """From the reported set-point."""
    core.begin(motion("up", rise(core)))
    cycles(core, 200)
    core.cancel()
    cycles(core, 155)
    assert core.run(motion("on", rise(core))).phase is Phase.DONE


def test_a_second_motion_is_refused_and_the_first_goes_on(core):
    """One at a time; the report stays that of the running one."""
    core.begin(motion("first", rise(core)))
    refused = core.begin(motion("second", rise(core)))
    assert refused.why == (fact(Kind.BUSY, "loop"),)
    assert "first" in refused.text
    assert core.report.key == "first"
    with pytest.raises(MotionError, match="first"):
        core.run(motion("second", rise(core)))


def test_a_motion_that_starts_elsewhere_is_refused_with_a_reason(core):
    """Nothing moves."""
    result = core.run(motion("far", START + 0.5))
    assert result.phase is Phase.FAILED
    assert result.why == (fact(Kind.MOTION_REFUSED, "first_knot"),)
    np.testing.assert_allclose(core.setpoint, START)


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
    result = core.run(
        motion(
            "grip",
            core.setpoint,
            until="touch",
            left=Close(squeeze=0.02, upto=1.0, speed=1.0, lock=False),
        )
    )
    assert result.phase is Phase.DONE
    assert result.left.touched == (False, False, False)
    assert result.left.proximal[0] == pytest.approx(1.0, abs=0.015)


def test_a_locked_hand_must_be_opened_before_it_moves(core):
    """So that nothing held is dropped by a motion that only forgot about it."""
    core.backend.grasped[0] = 0.8
    core.run(motion("grip", core.setpoint, until="touch", right=Close(squeeze=0.02)))
    result = core.run(motion("move", core.setpoint, right=Move((0.2, 0.2, 0.2))))
    assert result.phase is Phase.FAILED
    assert result.why == (fact(Kind.MOTION_REFUSED, "right_hand"),)
    assert core.run(motion("open", core.setpoint, right=Open())).phase is Phase.DONE
    result = core.run(motion("move", core.setpoint, right=Move((0.2, 0.2, 0.2))))
    assert result.right.proximal[0] == pytest.approx(0.2, abs=0.02)
    assert not result.right.locked


def test_head_arrives_before_the_motion_is_done(core):
    """A look lasts as long as the head needs."""
    result = core.run(motion("look", core.setpoint, head=HeadGoal(0.4, 0.3, speed=0.5)))
    assert result.time_s >= 0.5 / 0.5 - 0.05
    np.testing.assert_allclose(core.state.head, (0.4, 0.3), atol=0.02)


def test_contact_ends_a_motion_and_leaves_no_force():
    """A hand held up on its way down: the set-point becomes where the body is."""

    class Floor(Watched):
        """A torso and arms that stop as if on a table."""

        def step(self, command):
            q = self._state.q.copy()
            super().step(command)
            if self._state.time > 0.5:
                self._state.q[:], self._state.v[:] = q, 0.0

    core = LoopCore(Floor(), dynamics=DYNAMICS)
    terms = DYNAMICS.terms(START)
    down = np.linalg.pinv(terms.jacobian)[:, 2] * -0.08
    u = np.linspace(0, 1, 201)[:, None]
    result = core.run(
        motion("down", core.setpoint + u * down, until="contact", contact_m=0.02, settle_s=0.1)
    )
    assert (result.phase, result.ended_by) == (Phase.DONE, Until.CONTACT)
    assert 0.5 < result.time_s < 1.2
    np.testing.assert_allclose(core.setpoint, core.state.q)


def test_a_hand_far_from_its_path_ends_the_motion():
    """Beyond the tolerance it failed, by which hand and how far, and the body stays where it is."""

    class Stuck(Watched):
        def step(self, command):
            q = self._state.q.copy()
            super().step(command)
            self._state.q[:], self._state.v[:] = q, 0.0

    core = LoopCore(Stuck(), dynamics=DYNAMICS)
    result = core.run(motion("up", rise(core, 0.3)))
    assert result.phase is Phase.BLOCKED
    (why,) = result.why
    assert why.kind is Kind.BESIDE_ITS_PATH
    assert 0.1 < why.numbers[0] < 0.2
    np.testing.assert_allclose(core.setpoint, START)


@settings(max_examples=25, deadline=None)
@given(
    broken=st.sampled_from(["observe throws", "observe lies", "step throws"]),
    when=st.integers(0, 60),
)
def test_whatever_breaks_every_cycle_ends_in_an_accepted_command(broken, when):
    """No exception leaves `cycle`; the command is finite and accepted; the motion ends with the
    reason.
    """
    backend = Watched()
    core = LoopCore(backend, dynamics=DYNAMICS)
    core.begin(motion("up", rise(core)))
    cycles(core, when)
    place, how = broken.split()
    backend.broken[place] = how
    cycles(core, 5)
    assert len(backend.taus) == when + 5
    assert all(np.isfinite(tau).all() and (np.abs(tau) <= TORQUE).all() for tau in backend.taus)
    assert core.report.phase is Phase.FAILED
    assert core.faults >= 5
    assert core.mode is Mode.DAMPING


def test_an_impossible_reading_pushes_nothing():
    """One joint's sensor is wrong: the motion ends in this cycle, and no torque goes where a speed
    is not known.
    """
    for reading in (
        {"v": 1e8},
        {"v": -101.0},
        {"v": 1e308},
        {"q": 1e308},
        {"q": -1e200},
        {"q": 4.0},
    ):
        print(reading)
        pushes_nothing(reading)


def pushes_nothing(reading):
    """Of the fourth joint."""
    backend = Watched()
    core = LoopCore(backend, dynamics=DYNAMICS)
    core.begin(motion("up", rise(core)))
    cycles(core, 100)
    backend.broken["reading"] = reading
    cycles(core, 1)
    assert (core.mode, core.report.phase, core.faults) == (Mode.DAMPING, Phase.FAILED, 1)
    assert np.isfinite(backend.taus[-1]).all()
    assert (np.abs(backend.taus[-1]) <= TORQUE).all()
    assert BODY[3] in core.last_fault
    assert core.report.why == FAULT
    if "v" in reading:
        assert backend.taus[-1][3] == 0.0
    cycles(core, 50)
    assert np.isfinite(backend.taus).all()
    assert core.mode is Mode.DAMPING, "no posture is held that nobody can be in"
    assert np.abs(core.setpoint).max() < 4.0


def test_a_law_without_an_answer_is_a_fault(core):
    """A value that is not finite is never sent: damping goes out in the same cycle."""
    core.begin(motion("up", rise(core)))
    cycles(core, 100)
    core.impedance.torque = lambda *_: np.full(15, np.nan)
    cycles(core, 1)
    assert (core.mode, core.report.phase, core.faults) == (Mode.DAMPING, Phase.FAILED, 1)
    np.testing.assert_allclose(core.backend.taus[-1], safety.damping_torque(core.state.v), atol=0.5)
    assert np.isfinite(core.backend.taus[-1]).all()


def test_a_fault_stops_moving_fingers(core):
    """Twenty cycles of damping and the hold after them find the hand where it was."""
    core.begin(motion("up", rise(core), left=Move((1.0, 1.0, 1.0), speed=0.5)))
    cycles(core, 200)
    core.backend.broken["observe"] = "throws"
    cycles(core, 1)
    core.backend.broken.clear()
    before = core.state.proximal.copy()
    cycles(core, 200)
    np.testing.assert_allclose(core.state.proximal, before, atol=0.01)


def test_damping_lasts_twenty_cycles(core):
    """velma_core_ve_body leaves its safe state by joint impedance after that."""
    core.abandon((fact(Kind.GAVE_NO_ANSWER, "ex"),))
    cycles(core, 19)
    assert core.mode is Mode.DAMPING
    cycles(core, 1)
    assert core.mode is Mode.HOLD


def test_after_a_fault_damping_becomes_hold_and_hold_waits_for_a_release(core):
    """Twenty cycles of damping, then the posture is held until somebody releases it and the dwell
    is over.
    """
    core.abandon((fact(Kind.GAVE_NO_ANSWER, "ex"),))
    assert core.mode is Mode.DAMPING
    cycles(core, DAMPING_CYCLES + 1)
    assert core.mode is Mode.HOLD
    assert core.begin(motion("up", rise(core))).why == (fact(Kind.HELD_STILL, "hold"),)
    cycles(core, 2 * safety.DWELL_CYCLES)
    assert core.mode is Mode.HOLD
    core.release()
    cycles(core, 1)
    assert core.mode is Mode.MOTION
    assert core.run(motion("up", rise(core))).phase is Phase.DONE


def test_a_release_before_the_dwell_is_granted_after_it(core):
    """A stop lasts its dwell, however impatient the release."""
    core.begin(motion("up", rise(core)))
    cycles(core, 50)
    core.stop()
    assert core.report.phase is Phase.FAILED
    core.release()
    cycles(core, safety.DWELL_CYCLES - 1)
    assert core.mode is Mode.STOPPED
    cycles(core, 2)
    assert core.mode is Mode.MOTION


def test_a_stop_keeps_hands_locked_and_weight_carried(core):
    """A held thing stays held."""
    core.backend.grasped[1] = 1.2
    core.run(motion("grip", core.setpoint, until="touch", left=Close(squeeze=0.02)))
    core.begin(motion("lift", rise(core), payload_left=Payload(0.3, (0.0, 0.0, 0.02))))
    cycles(core, 200)
    core.stop()
    cycles(core, 10)
    assert core.command.locked[1] == 1.0
    assert core.payloads.mass[1] == pytest.approx(0.3)


def test_a_weight_is_taken_up_gradually(core):
    """No step in the torques when something is lifted."""
    core.begin(
        motion("lift", core.setpoint, settle_s=0.5, payload_left=Payload(0.3, (0.0, 0.0, 0.02)))
    )
    masses = []
    for _ in range(150):
        core.cycle()
        masses.append(core.payloads.mass[1])
    assert max(np.diff(masses)) <= 0.0031
    assert masses[-1] == pytest.approx(0.3)


def test_a_paused_motion_rests_on_its_way_and_ends_all_the_same(core):
    """It runs as long as it takes; without a motion there is nothing to pause."""
    core.pause()
    path = rise(core)
    core.begin(motion("up", path))
    cycles(core, 200)
    core.pause()
    cycles(core, 200)
    rest = core.setpoint.copy()
    cycles(core, 1000)
    np.testing.assert_allclose(core.setpoint, rest)
    assert core.report.phase is Phase.RUNNING
    assert not np.allclose(rest, path[-1])
    core.pause(False)
    cycles(core, 600)
    assert core.report.phase is Phase.DONE
    np.testing.assert_allclose(core.setpoint, path[-1])


def test_time_has_to_go_on_while_something_is_to_happen(core):
    """A motion, damping, a release that waits for its dwell; neither at rest nor in hold."""
    assert core.busy is False
    core.begin(motion("up", rise(core)))
    assert core.busy is True
    core.backend.broken["observe"] = "throws"
    core.cycle()
    assert (core.mode, core.busy) == (Mode.DAMPING, True)
    core.backend.broken.clear()
    cycles(core, DAMPING_CYCLES)
    assert (core.mode, core.busy) == (Mode.HOLD, False)
    core.release()
    assert core.busy is True
    cycles(core, safety.DWELL_CYCLES)
    assert (core.mode, core.busy) == (Mode.MOTION, False)


def test_what_is_just_possible_is_no_fault(core):
    """At the fastest speed, and as far beyond its end as a joint can be; a bit more is
    impossible.
    """
    state = core.state
    ends = (("q", -1.0, (LOWER - BEYOND)[3]), ("q", 1.0, (UPPER + BEYOND)[3]))
    for name, way, limit in (("v", -1.0, -safety.FASTEST), ("v", 1.0, safety.FASTEST), *ends):
        values = getattr(state, name)
        before, values[3] = values[3], limit
        assert impossible(state) == ""
        values[3] = np.nextafter(limit, way * np.inf)
        assert BODY[3] in impossible(state)
        values[3] = before


def test_a_reading_that_is_no_number_is_told_so():
    """Of either kind; and cycles are counted whatever happens in them."""
    for name in ("q", "v"):
        core = LoopCore(Watched(), dynamics=DYNAMICS)
        getattr(core.state, name)[3] = np.nan
        assert impossible(core.state) == "a joint measurement is not a finite number"
        count = core.cycles
        core.backend.broken["reading"] = {name: np.nan}
        cycles(core, 3)
        assert (core.cycles, core.faults) == (count + 3, 3)


def test_a_motion_counts_as_cancelled_once_it_rests(core):
    """Not while its set-point still moves."""
    core.begin(motion("up", rise(core)))
    cycles(core, 200)
    core.cancel()
    before = core.setpoint.copy()
    core.cycle()
    assert core.report.phase is Phase.RUNNING
    assert not np.array_equal(core.setpoint, before)
    while core.report.phase is Phase.RUNNING:
        core.cycle()
    rest = core.setpoint.copy()
    cycles(core, 50)
    np.testing.assert_allclose(core.setpoint, rest)


# --- To the cycle: how long a safe mode lasts, which posture it holds, the counts -----------------
# Figures are those of Velma's lower level (common_predicates.cpp, safe state).


@pytest.fixture
def grip():
    """A core whose right hand holds something, locked; the left one is a bit bent."""
    backend = Watched()
    backend.grasped[0] = BENT
    core = LoopCore(backend, dynamics=DYNAMICS)
    core.run(
        motion(
            "grip",
            core.setpoint,
            until="touch",
            right=Close(squeeze=0.02),
            left=Move((0.3, 0.3, 0.3)),
        )
    )
    return core


def line(core, seconds=1.0, speed=0.1):
    """Knots of all joints at one speed [rad/s]."""
    return core.setpoint + np.arange(0.0, seconds, 0.01)[:, None] * speed


def broken(core, count=1):
    """Cycles in which the sensors throw."""
    core.backend.broken["observe"] = "throws"
    cycles(core, count)
    core.backend.broken.clear()


def test_a_new_core_has_counted_nothing(core):
    """And is told of nothing: no cycle, no fault, no cut torque, no motion."""
    assert (core.cycles, core.faults, core.saturated, core.last_fault) == (0, 0, 0, "")
    assert (core.report.key, core.report.phase, core.busy) == ("", Phase.IDLE, False)
    core.hold(0.4)
    assert (core.cycles, core.state.time) == (200, pytest.approx(0.4))


def test_hands_stay_as_they_are_found():
    """A loop that starts again beside a robot with bent fingers lets nothing fall."""
    backend = Watched()
    backend.observe().proximal[:], backend.observe().spread[:] = BENT, 0.4
    core = LoopCore(backend, dynamics=DYNAMICS)
    cycles(core, 100)
    np.testing.assert_allclose(core.state.proximal, BENT)
    np.testing.assert_allclose(core.state.spread, 0.4)


def test_each_hand_does_what_it_alone_was_told():
    """It moves and takes its load; the other hand keeps both, and the report has each in its
    place.
    """
    for side, own, other in (("right", 0, 1), ("left", 1, 0)):
        core = LoopCore(Watched(), dynamics=DYNAMICS)
        report = core.run(
            motion("move", START, **{side: MOVED, f"payload_{side}": Payload(0.3)}, settle_s=0.3)
        )
        assert report.hand(side).proximal == pytest.approx((0.5,) * 3)
        assert report.hand("left" if own == 0 else "right").proximal == (0.0,) * 3
        assert core.state.spread[own] == pytest.approx(0.4)
        assert (core.payloads.mass[own], core.payloads.mass[other]) == (pytest.approx(0.3), 0.0)


def test_what_either_hand_cannot_do_is_refused_before_anything_begins(core):
    """With its name, in the report of a motion that never ran."""
    asked = motion("bend", line(core), head=HeadGoal(0.4, 0.0))
    for side in ("right", "left"):
        refused = core.begin(msgspec.structs.replace(asked, **{side: Move((9.0, 0.0, 0.0))}))
        assert refused.why == (fact(Kind.MOTION_REFUSED, f"{side}.fingers[0]"),)
        assert f"{side}.fingers[0] is 9.0" in refused.text
        assert (core.report.key, core.report.phase, core.report.why) == (
            "bend",
            Phase.FAILED,
            refused.why,
        )
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


def test_each_joint_that_is_beyond_its_end_is_named(core):
    """Half a radian is the most; with a speed that is just possible the posture is to blame."""
    core.state.v[7] = 100.0
    for (joint, name), way in itertools.product(enumerate(BODY), (-1, 1)):
        before = core.state.q[joint]
        core.state.q[joint] = (LOWER if way < 0 else UPPER)[joint] + way * 0.51
        assert impossible(core.state).startswith(f"{name} is measured at ")
        assert " rad, possible are " in impossible(core.state)
        core.state.q[joint] = before
    assert impossible(core.state) == ""


def test_a_torque_is_cut_to_what_the_lower_level_accepts_and_counted(core):
    """One joint at a time, to the figures of VS; at its limit it is neither cut nor counted."""
    for joint in range(1, 15):
        most, before = ARM[(joint - 1) % 7], core.saturated
        for asked, sent, count in (
            (most, most, 0),
            (-most - 0.1, -most, 1),
            (1e6, most, 2),
            (0.0, 0.0, 2),
        ):
            core.impedance.torque = lambda *_, asked=asked, joint=joint: asked * np.eye(15)[joint]
            core.cycle()
            assert core.command.tau[joint] == sent, joint
            assert core.saturated == before + count, joint
    assert core.faults == 0


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


def test_every_fault_is_counted_once_and_named(core):
    """Of sensors, law and drive."""
    broken(core, 3)
    assert (core.faults, core.last_fault) == (3, "RuntimeError: sensor bus is gone")
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


def test_a_safe_mode_lasts_five_hundred_cycles_in_all(core):
    """Those of damping are of them."""
    for begin, mode in ((core.stop, Mode.STOPPED), (lambda: core.abandon(()), Mode.HOLD)):
        begin()
        core.release()
        cycles(core, 499)
        assert core.mode is mode
        cycles(core, 1)
        assert core.mode is Mode.MOTION


def test_a_release_is_used_up_by_the_mode_it_ends(core):
    """The next fault waits for a release of its own, and so does one behind a release that came too
    early.
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
    cycles(core, 1000)
    assert core.mode is Mode.STOPPED


def test_abandoned_in_a_safe_mode_a_robot_stays_in_it(core):
    """A hold is not given up for damping."""
    core.stop()
    core.abandon(())
    assert core.mode is Mode.STOPPED


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

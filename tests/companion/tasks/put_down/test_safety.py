"""State after a cancelled act, and putting down of the held thing, with the true loop and simulated
physics.
"""

import numpy as np
import pinocchio as pin
import pytest
from robot import LIFT_M

from companion.languages import rc
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from companion.skills.loop_messages import Close, Move, Open, Phase
from velma.kinematics import ik
from velma.kinematics.frames import standing, xyz_quat
from velma.names import ARM, START

JAR, LEFT = "jar_1", Side.LEFT
UPRIGHT_DEG, QUARTER = 3.0, np.pi / 4


def stands(acting):
    """The jar stands upright and no hand touches it."""
    truth = acting.truth
    assert truth.tilt_deg[JAR] < UPRIGHT_DEG
    assert truth.fingers_on[JAR] == {"right": 0, "left": 0}
    assert not acting.here.held


def is_home(acting):
    """The left arm is in its start posture."""
    assert np.abs(acting.core.state.q - START)[ARM["left"]].max() < 0.03


def closing_for(seconds):
    """Cancel so long after the fingers began to close."""
    began = []

    def when(motion, core):
        if isinstance(motion.left, Close):
            began.append(core.state.time)
        return bool(began) and core.state.time - began[0] > seconds

    return when


@pytest.mark.parametrize("seconds", [0.05, 1.2])
def test_a_cancelled_grasp_backs_out(before_the_jar, seconds):
    """Cancelled while its fingers close, the hand opens and draws back to where it can move
    freely.
    """
    outcome = before_the_jar.act(before_the_jar.taking[1], closing_for(seconds))
    assert (outcome.kind, outcome.held) == ("cancelled", {})
    stands(before_the_jar)
    assert before_the_jar.here.world.free(before_the_jar.core.setpoint)


def test_what_has_just_been_grasped_is_left_where_it_stands(holding):
    """Nothing moves but the hand."""
    stood = np.array(holding.truth.at[JAR])
    holding.done(holding.put_down(JAR, LEFT))
    stands(holding)
    assert np.linalg.norm(holding.truth.at[JAR] - stood) < 0.01


def test_half_out_it_is_put_back(holding):
    """Cancelled between shelf and open, the jar goes back where it stood."""
    stood = np.array(holding.truth.at[JAR])

    def half_way(motion, core):
        return bool(np.linalg.norm((holding.truth.at[JAR] - stood)[:2]) > 0.14)

    outcome = holding.act(holding.taking[2], half_way)
    assert isinstance(outcome, rc.NotDone)
    assert set(outcome.held) == {LEFT}
    holding.done(holding.put_down(JAR, LEFT))
    stands(holding)
    assert np.linalg.norm(holding.truth.at[JAR] - stood) < 0.03


def test_a_tilted_jar_is_put_down_upright(jar_out):
    """From a tilt of 45 degrees in mid-air ex finds a place and a way there, and stands it up."""
    grip = jar_out.robot.grip(jar_out.here.q, LEFT)
    jar = grip * jar_out.here.held[LEFT].T_grip_object
    for sign in (1.0, -1.0):
        turn = pin.SE3(pin.exp3(sign * QUARTER * grip.rotation[:, 2]), np.zeros(3))
        about = pin.SE3(np.eye(3), jar.translation)
        goal = about * turn * about.inverse() * grip
        tilted = ik.solve(jar_out.robot, LEFT, goal, jar_out.here.q)
        if tilted is not None:
            break
    assert tilted is not None
    jar_out.done(jar_out.move(LEFT, [jar_out.here.q, tilted]))
    assert jar_out.truth.tilt_deg[JAR] > 35.0
    jar_out.done(jar_out.put_down(JAR, LEFT))
    stands(jar_out)
    jar_out.done(jar_out.home(LEFT))
    is_home(jar_out)


@pytest.mark.parametrize("kind", [Open, Move])
def test_letting_go_is_carried_to_its_end(holding, kind):
    """A cancel while the fingers open changes nothing: the hand lets go and draws back to where it
    is free.
    """
    down = holding.put_down(JAR, LEFT)
    outcome = holding.act(down, lambda motion, core: isinstance(motion.left, kind))
    assert isinstance(outcome, rc.Done)
    assert not outcome.held
    stands(holding)
    assert holding.here.world.free(holding.core.setpoint)


def test_cancelled_on_the_way_down_it_is_still_held(jar_out):
    """A put-down that is cancelled in the air leaves the jar in the hand; the next one puts it
    down.
    """

    def moving(motion, core):
        return bool(np.abs(core.state.v).max() > 0.1)

    outcome = jar_out.act(jar_out.put_down(JAR, LEFT), moving)
    assert isinstance(outcome, rc.NotDone)
    assert set(outcome.held) == {LEFT}
    assert jar_out.truth.fingers_on[JAR]["left"] >= 3
    jar_out.done(jar_out.put_down(JAR, LEFT))
    stands(jar_out)


def test_what_slips_while_it_is_put_down_is_put_down(jar_out, monkeypatch):
    """Pushed with 3 N for 0.2 s, which ends a motion as slipped, it is lowered from there, and
    stands.
    """
    core, cycle = jar_out.core, jar_out.core.cycle
    force, pushed_at, slipped = (
        core.backend.data.xfrc_applied[core.backend.model.body(JAR).id],
        [],
        [],
    )

    def pushed():
        cycle()
        if not pushed_at and np.abs(core.state.v).max() > 0.1:
            pushed_at.append(core.state.time)
        force[1] = 3.0 if pushed_at and core.state.time - pushed_at[0] < 0.2 else 0.0
        slipped.extend([core.report.why] if core.report.phase is Phase.SLIPPED else ())

    monkeypatch.setattr(core, "cycle", pushed)
    jar_out.done(jar_out.put_down(JAR, LEFT))
    assert len(slipped) == 1
    stands(jar_out)


def test_a_thing_goes_through_an_opening_to_its_place(jar_out):
    """In from the front and down where it stood, upright; the hand comes out and home."""
    seen = jar_out.here.seen[JAR]
    out = jar_out.taking[2].segments[1].offset
    way = ((out[0], out[1], LIFT_M), (0.0, 0.0, LIFT_M))
    retreat = jar_out.retreats[JAR]
    jar_out.done(rc.Release("in", LEFT, JAR, "cabinet_2", Pose(*xyz_quat(seen)), retreat, way))
    stands(jar_out)
    assert np.linalg.norm(jar_out.truth.at[JAR] - seen.translation) < 0.02
    jar_out.done(jar_out.home(LEFT))
    is_home(jar_out)


def test_an_opening_that_is_blocked_is_told(jar_out):
    """If something stands in the way, nothing moves: a new plan is wanted."""
    seen, before = jar_out.here.seen[JAR], jar_out.core.setpoint.copy()
    out = jar_out.taking[2].segments[1].offset
    bowl = seen.translation + 0.5 * np.array(out)
    jar_out.here.place("bowl_1", standing((bowl[0], bowl[1], bowl[2] - 0.1)))
    way = ((out[0], out[1], LIFT_M), (0.0, 0.0, LIFT_M))
    place = Pose(*xyz_quat(seen))
    into = rc.Release("in", LEFT, JAR, "cabinet_2", place, jar_out.retreats[JAR], way)
    outcome = jar_out.act(into)
    assert (outcome.kind, set(outcome.held)) == ("replan", {LEFT})
    assert (jar_out.core.setpoint == before).all()


def test_an_arm_comes_home_from_among_things(holding):
    """With its open hand still around the jar the arm first gets free, then goes home; the jar
    stays where it is.
    """
    around, stood = holding.here.q.copy(), np.array(holding.truth.at[JAR])
    holding.done(holding.put_down(JAR, LEFT))
    holding.here.world.allow((JAR, "left_hand"))
    holding.done(holding.move(LEFT, [holding.here.q, around], holding.retreats[JAR][0].fingers))
    holding.here.world.allow()
    holding.done(holding.home(LEFT))
    is_home(holding)
    assert np.linalg.norm(holding.truth.at[JAR] - stood) < 0.02


def test_an_empty_hand_has_nothing_to_put_down(before_the_jar):
    """It is done, and nothing moves."""
    before = before_the_jar.core.setpoint.copy()
    before_the_jar.done(before_the_jar.put_down(JAR, LEFT))
    assert (before_the_jar.core.setpoint == before).all()


def test_a_full_hand_does_not_go_home(jar_out):
    """It says why."""
    outcome = jar_out.act(jar_out.home(LEFT))
    assert outcome.why == (fact(Kind.PUT_DOWN_FIRST, LEFT, JAR),)

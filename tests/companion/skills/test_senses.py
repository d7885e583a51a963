"""Senses that are not well, in the true loop with simulated physics: told as what they are, not as
the world's.
"""

import dataclasses

import pytest
from msgspec.structs import replace

from companion.acts import ACTS
from companion.languages import rc
from companion.languages.evidence import Claim, Sense
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.look_around import POINTS
from companion.skills import motions, senses
from companion.skills.performing import SKILLS, perform
from companion.skills.senses import BLIND_LOOKS, TELLS
from companion.skills.senses import evidence as evidence_of
from companion.tasks.pour.done import Pour
from services.executor.receptor import OwnPixelReceptor, Receptor
from services.executor.simulation import InProcess
from services.executor.skill_process import remembered
from velma import names
from velma.control import grip
from velma.control.grip import Grip
from velma.eyes import health
from velma.model.scene import load, vary

JAR, BOWL, LEFT = "jar_1", "bowl_1", Side.LEFT
OFF = 0.05
CAMERA = rc.Ill(rc.Sensor.CAMERA, rc.Fault.FROZEN)
WRIST = rc.Ill(rc.Sensor.LEFT_WRIST, rc.Fault.ZERO)
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


class Unwell(Receptor):
    """Eyes whose camera is not well: they see nothing, and say why, if they know."""

    def __init__(self, wrong):
        self.wrong = wrong

    def look(self, _qpos, _neck=None):
        """Return nothing."""
        return []


def spoilt(acting, spoil, monkeypatch):
    """From now on the loop of this robot measures otherwise."""
    observe = acting.core.backend.observe

    def observed():
        state = observe()
        state.q, state.wrist = state.q.copy(), state.wrist.copy()
        spoil(state)
        return state

    monkeypatch.setattr(acting.core.backend, "observe", observed)


def measured_off(joint):
    """A joint of the body is measured 0.05 rad too far."""

    def spoil(state):
        state.q[joint] += OFF

    return spoil


def drifting(joint):
    """A joint of the body is measured more and more too far, within three seconds by 0.05 rad."""
    began = []

    def spoil(state):
        began.append(state.time)
        state.q[joint] += OFF * min(1.0, (state.time - began[0]) / 3.0)

    return spoil


def numb(state):
    """Both wrists read zero."""
    state.wrist[:] = 0.0


def at(acting, name, times=1):
    """A look, or several, at a thing: where it stands or in a hand."""
    side = acting.here.holder(name)
    at = acting.here.seen.get(name)
    if side is not None:
        at = acting.robot.grip(acting.here.q, side) * acting.here.held[side].T_grip_object
    x, y, z = at.translation
    return rc.Look(acting._key(), ((float(x), float(y), float(z)),) * times)


def acts_of(acting):
    """One of each kind."""
    move, grasp, pull = acting.taking
    pour = Pour("pour", LEFT, JAR, BOWL, 0.0, 0.0, (0.3, 2.0), 1.0, 0.2)
    home = rc.Home("home", LEFT)
    acts = (move, grasp, pull, pour, acting.put_down(JAR, LEFT), home, acting.look())
    return {type(act).__name__: act for act in acts}


def refused(here, act):
    """Why it is not begun."""
    return senses.refused(here, act, SKILLS[type(act)])


def test_the_faults_of_a_sense_are_those_that_are_told():
    """What wrist and eyes find wrong has a name in RC."""
    assert {str(one) for one in (*grip.Wrong, *health.Wrong)} <= {str(one) for one in rc.Fault}


# --- what is not begun ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ill", "not_begun"),
    [
        ((), ()),
        ((CAMERA,), ()),
        ((WRIST,), ()),
        ((CAMERA, rc.Ill(rc.Sensor.RIGHT_WRIST, rc.Fault.ZERO)), ()),
        ((CAMERA, WRIST), ("Grasp", "Pour", "Release")),
        ((rc.Ill(rc.Sensor.NECK, rc.Fault.OFF, 0.01),), ()),
        (
            (rc.Ill(rc.Sensor.NECK, rc.Fault.OFF, 0.05),),
            ("MoveJoint", "MoveCartesian", "Grasp", "Release", "Pour", "Home"),
        ),
    ],
    ids=str,  # the same in each process: of no set
)
def test_an_act_that_no_sense_checks_is_not_begun(before_the_jar, ill, not_begun):
    """It is refused before anything moves, with the senses as data; a look is begun with any."""
    here = before_the_jar.here
    here.ill = ill
    for name, act in acts_of(before_the_jar).items():
        assert bool(refused(here, act)) is (name in not_begun), name
        if name in not_begun:
            with pytest.raises(StopIteration) as stop:
                next(perform(here, act))
            told = stop.value.value
            assert (told.kind, told.ill) == (rc.NotDoneKind.REFUSED, ill)


def test_a_hand_without_a_sensor_does_not_check(before_the_jar):
    """So a grasp is not begun with a camera alone that does not see."""
    here = before_the_jar.here
    here.ill, here.numb = (CAMERA,), {LEFT}
    why = fact(Kind.NOT_BEGUN, fact(Kind.UNCHECKABLE, LEFT))
    assert refused(here, before_the_jar.taking[1]) == (why,)


def test_what_a_sense_was_is_remembered(jar_out):
    """By the next act, and where the thing was seen in the hand."""
    jar_out.done(at(jar_out, JAR))
    jar_out.here.ill = (CAMERA,)
    kept = remembered(jar_out.here, "")
    assert kept.ill == (CAMERA,)
    assert kept.held[LEFT].steady is not None


# --- the camera -----------------------------------------------------------------------------------


@pytest.mark.parametrize("wrong", ["frozen", ""])
def test_with_a_camera_that_does_not_see_nothing_is_missing(before_the_jar, wrong):
    """What it is looked for is where it was; the look is not done, since the eyes do not see. Also
    where no picture tells, and only the furniture is not in it.
    """
    before_the_jar.eye = Unwell(wrong)
    known = set(before_the_jar.here.seen)
    told = before_the_jar.act(at(before_the_jar, "cabinet_2", BLIND_LOOKS))
    assert (told.kind, told.missing) == (rc.NotDoneKind.FAILED, ())
    assert told.ill == (rc.Ill(rc.Sensor.CAMERA, rc.Fault(wrong or "blind")),)
    assert set(before_the_jar.here.seen) == known


def test_a_grasp_without_the_camera_is_checked_by_the_wrist(before_the_jar):
    """It goes on, and says that the camera does not see; so does putting down."""
    before_the_jar.eye = Unwell("frozen")
    for act in (*before_the_jar.taking[1:], before_the_jar.put_down(JAR, LEFT)):
        done = before_the_jar.done(act)
        assert done.ill == (CAMERA,)
        assert not done.missing
    assert before_the_jar.truth.tilt_deg[JAR] < 2.0


def test_a_grasp_that_nothing_checks_ends_before_the_hand_closes(before_the_jar, monkeypatch):
    """Where both become unwell on the way; the hand has not touched the jar."""
    before_the_jar.eye = Unwell("frozen")
    spoilt(before_the_jar, numb, monkeypatch)
    told = before_the_jar.act(before_the_jar.taking[1])
    assert told.kind == rc.NotDoneKind.FAILED
    assert {one.sense for one in told.ill} == {*WRISTS, rc.Sensor.CAMERA}
    assert not before_the_jar.here.held
    assert not any(before_the_jar.core.report.left.touched)


WRISTS = (rc.Sensor.RIGHT_WRIST, rc.Sensor.LEFT_WRIST)

# --- encoders -------------------------------------------------------------------------------------


@pytest.mark.process
@pytest.mark.needs_opengl
def test_a_torso_that_is_measured_wrong_is_told_and_no_arm_moves(before_the_jar, monkeypatch):
    """By 0.05 rad, from one look to the next: nothing has moved, nothing is missing."""
    eye = OwnPixelReceptor(vary(load(), 7))
    try:
        before_the_jar.eye = eye
        assert not before_the_jar.done(before_the_jar.look()).ill
        known = {name: pose.copy() for name, pose in before_the_jar.here.seen.items()}
        spoilt(before_the_jar, measured_off(names.TORSO), monkeypatch)
        told = before_the_jar.act(before_the_jar.look())
        (ill,) = told.ill
        assert (told.kind, told.missing, ill.sense) == (rc.NotDoneKind.FAILED, (), rc.Sensor.NECK)
        assert ill.off == pytest.approx(OFF, rel=0.1)
        assert all(known[name] == pose for name, pose in before_the_jar.here.seen.items())
        for act in before_the_jar.taking:
            assert before_the_jar.act(act).kind == rc.NotDoneKind.REFUSED
        monkeypatch.undo()
        assert not before_the_jar.done(before_the_jar.look()).ill
    finally:
        eye.close()


@pytest.mark.parametrize("joint", [8, 11], ids=["shoulder", "elbow"])
def test_an_arm_that_is_measured_wrong_is_told(jar_out, joint, monkeypatch):
    """By two looks that agree: the jar has turned in the hand, which feels that it holds it. Only
    putting it down, by where it is seen, is begun.
    """
    assert not jar_out.done(at(jar_out, JAR, 2)).ill
    spoilt(jar_out, drifting(joint), monkeypatch)
    jar_out.core.hold(3.5)
    told = jar_out.done(at(jar_out, JAR, 2))
    (ill,) = told.ill
    assert ill.sense == rc.Sensor.LEFT_ARM
    assert ill.off == pytest.approx(OFF, abs=0.015)
    begun = {name for name, act in acts_of(jar_out).items() if not refused(jar_out.here, act)}
    assert begun == {"Release", "Look"}
    assert not jar_out.act(jar_out.put_down(JAR, LEFT)).missing


@pytest.mark.parametrize("joint", [8, 11], ids=["shoulder", "elbow"])
def test_an_arm_that_is_wrong_at_once_feels_like_a_slip(jar_out, joint, monkeypatch):
    """It is one or the other, which is told; by sight the arm goes on."""
    assert not jar_out.done(at(jar_out, JAR, 2)).ill
    spoilt(jar_out, measured_off(joint), monkeypatch)
    assert jar_out.act(at(jar_out, JAR)).kind == rc.NotDoneKind.SLIPPED
    (ill,) = jar_out.done(at(jar_out, JAR, 2)).ill
    assert (ill.sense, ill.off) == (rc.Sensor.LEFT_ARM, pytest.approx(OFF, abs=0.015))
    assert not any(refused(jar_out.here, act) for act in acts_of(jar_out).values())


def test_the_look_around_shows_no_fault(before_the_jar):
    """With good senses."""
    for _ in range(2):
        assert not before_the_jar.done(rc.Look(before_the_jar._key(), POINTS)).ill


# --- Evidence of acts in the true loop: a hand is felt, touched and seen to hold its thing, each by
# its own sense


def evidence(here, command, sensed):
    """The evidence for an act that is done."""
    return evidence_of(here, command, sensed, SKILLS[type(command)].tells)


def test_each_sense_of_the_table_can_tell():
    """What ex judges is what the language says, no more and no less; a task adds only what its own
    acts claim.
    """
    told = set()
    for act, row in SKILLS.items():
        claims = {(check.claim, sense) for check in ACTS[act].checks for sense in check.by}
        assert set(row.tells) <= claims <= {*TELLS, *row.tells}
        told |= claims
    assert set(TELLS) <= told
    assert set(SKILLS) == set(ACTS)


def sensed_by(acting):
    """Return what the robot senses where it stands, its head on the jar."""
    body = InProcess(acting.core, acting.eye)
    at = acting.here.robot.grip(acting.here.q, LEFT).translation
    return body.do(motions.still(acting.here, "look", watch=at, settle_s=0.3))


def told(acting, sensed):
    """Return which senses tell that the left hand holds the jar."""
    acting.here.begin()
    acting.here.see(sensed.sights)
    move = rc.MoveJoint("act", LEFT, (), 0.1)
    (held,) = [one for one in evidence(acting.here, move, sensed) if one.claim is Claim.HELD]
    assert held.of == JAR
    assert held.at == (acting.here.time if held.by else 0.0)
    return set(held.by)


def test_each_sense_is_missed_alone(jar_out):
    """Without one of them the others still tell; without any the claim is there, and not
    checked.
    """
    sensed = sensed_by(jar_out)
    blind = dataclasses.replace(sensed, sights=[])
    deaf = dataclasses.replace(blind, grips={})
    numb = dataclasses.replace(deaf, touched={})
    assert told(jar_out, sensed) == {Sense.WRIST, Sense.FINGERS, Sense.EYES}
    assert told(jar_out, blind) == {Sense.WRIST, Sense.FINGERS}
    assert told(jar_out, deaf) == {Sense.FINGERS}
    assert told(jar_out, numb) == set()
    unsure = {"left": replace(sensed.grips["left"], felt=Grip.UNSURE)}
    assert told(jar_out, dataclasses.replace(numb, grips=unsure)) == set()


def test_an_empty_hand_claims_nothing(jar_out):
    """A motion of the other hand says only that the arm is there."""
    sensed = sensed_by(jar_out)
    move = rc.MoveJoint("act", Side.RIGHT, (), 0.1)
    assert [one.claim for one in evidence(jar_out.here, move, sensed)] == [Claim.THERE]

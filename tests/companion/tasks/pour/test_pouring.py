"""Weights of a pour: felt before and after, over interruptions. No physics: the test says what the hand feels."""

import dataclasses
import math

import msgspec
import numpy as np
import pytest
from robot import Acting
from tilts import BOWL, JAR, LEFT, in_view

from companion import models
from companion.languages import rc
from companion.languages.facts import fact
from companion.skills.loop_messages import GripReport, Motion
from companion.skills.motions import aim, turned
from companion.skills.performing import perform
from companion.skills.senses import MORE_LOOKS
from companion.skills.situation import Sight, Situation, Unfinished
from companion.skills.skill import Sensed
from companion.tasks.pour.done import Pour, PourKind
from companion.tasks.pour.perform import _away
from velma import names
from velma.control.grip import Grip
from velma.kinematics.frames import standing
from velma.kinematics.tasks.pouring import FIRST_TILT, LAST_TILT

FULL, HALF, EMPTY = 0.26, 0.23, 0.20  # [kg] the jar of the canonical scene with all, half, none of its content
BEFORE, TILTED, LOOK = 0, 1, 4  # motions of a pour; the number of the one with the look into the bowl
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


@pytest.fixture
def over_the_bowl(jar_out: Acting) -> tuple[Situation, Pour]:
    """The jar is in the left hand, the bowl on the nearest table, and this is a pour that is possible there."""
    pour = in_view(jar_out)
    return jar_out.here, pour


def poured(here: Situation, command: Pour, before: float, *after: float, cancelled: int = -1) -> rc.Done | rc.NotDone:
    """Perform a pour with these masses [kg] felt (nan: none): before, after each tilt; its n-th motion is cancelled."""
    return performed(here, command, before, *after, cancelled=cancelled)[0]


def performed(
    here: Situation,
    command: Pour,
    before: float,
    *after: float,
    cancelled: int = -1,
    content: tuple[float | None, float | None] = (None, None),
) -> tuple[rc.Done | rc.NotDone, list[Motion]]:
    """Perform it, and return its motions, too; a tilt has two, the look into the bowl one."""
    work, motions = perform(here, command), []
    felt = [before, *(mass for mass in after for _ in range(2))]
    try:
        motion = next(work)
        while True:
            motions.append(motion)
            mass = felt[min(len(motions), len(felt)) - 1]
            seen = content[0] if len(motions) < LOOK else content[1]
            motion = work.send(_sensed(here, motion, mass, len(motions) - 1 == cancelled, seen))
    except StopIteration as stop:
        return stop.value, motions


def _sensed(here: Situation, motion: Motion, mass: float, cancelled: bool, content: float | None) -> Sensed:
    q = motion.path()[-1]
    felt = Grip.HELD if mass else Grip.UNSURE
    grips = {} if math.isnan(mass) else {str(LEFT): GripReport(felt=felt, mass=mass)}
    standing = [(name, pose) for name, pose in here.seen.items() if here.holder(name) is None]
    sights = [Sight(name, pose, content if name == BOWL else None) for name, pose in standing]
    ended = "cancelled" if cancelled else "done"
    head = here.head if motion.head is None else (motion.head.pan, motion.head.tilt)
    return Sensed(ended, (), q, q, {}, {}, grips, head, sights, here.time + 1.0)


def test_what_left_the_jar_was_felt(over_the_bowl: tuple[Situation, Pour]) -> None:
    """The outcome has the mass before and after."""
    outcome = poured(*over_the_bowl, FULL, EMPTY)
    assert isinstance(outcome, rc.Done)
    assert outcome.weighed == (FULL, EMPTY)


def test_a_pour_with_nothing_in_the_hand_at_its_end_is_not_done(over_the_bowl: tuple[Situation, Pour]) -> None:
    """The jar was felt after the tilt, and is no more when the bowl is looked into."""
    outcome = poured(*over_the_bowl, FULL, EMPTY, 0.0)
    assert isinstance(outcome, rc.NotDone)
    assert outcome.kind in (rc.NotDoneKind.EMPTY, rc.NotDoneKind.REPLAN)


@pytest.mark.parametrize("left", [EMPTY, HALF])
def test_a_pour_that_goes_on_counts_from_its_beginning(left: float, over_the_bowl: tuple[Situation, Pour]) -> None:
    """Cancelled in the middle, when all or half has left the jar, the next one is done, and all of it was felt."""
    here, command = over_the_bowl
    assert isinstance(poured(here, command, FULL, left, cancelled=TILTED), rc.NotDone)
    outcome = poured(here, command, left, EMPTY)
    assert isinstance(outcome, rc.Done)
    assert outcome.weighed == (FULL, EMPTY)
    assert isinstance(poured(here, command, EMPTY, EMPTY), rc.NotDone), "a third one pours nothing"


def tilt_of(here: Situation, motion: Motion) -> float:
    """The angle [rad] between the jar's axis and the vertical at the end of a motion."""
    grip = here.robot.grip(motion.path()[-1], LEFT)
    return float(np.arccos((grip * here.held[LEFT].T_grip_object).rotation[2, 2]))


def test_a_jar_with_much_left_is_tilted_once_more_and_farther(over_the_bowl: tuple[Situation, Pour]) -> None:
    """What left it is that of both tilts; a third one is not tried, and what stays in it is told."""
    here, command = over_the_bowl
    outcome, motions = performed(here, command, FULL, HALF, EMPTY)
    assert isinstance(outcome, rc.Done)
    assert outcome.weighed == (FULL, EMPTY)
    before, first, _, second, _, _ = (tilt_of(here, motion) for motion in motions)
    assert (before, first) == pytest.approx((FIRST_TILT, LAST_TILT), abs=0.02)
    assert second > first + 0.2
    outcome, motions = performed(here, command, FULL, HALF, HALF)
    assert isinstance(outcome, rc.Done)
    assert (outcome.weighed, len(motions)) == ((FULL, HALF), 6)


@pytest.mark.parametrize("left", [EMPTY, 0.212])
def test_a_jar_with_little_left_is_tilted_once(left: float, over_the_bowl: tuple[Situation, Pour]) -> None:
    """A fifth of the content is less than a hand tells from nothing."""
    outcome, motions = performed(*over_the_bowl, FULL, left)
    assert isinstance(outcome, rc.Done)
    assert (outcome.weighed, len(motions)) == ((FULL, left), 4)


def test_content_that_does_not_leave_in_two_tilts_is_not_poured(over_the_bowl: tuple[Situation, Pour]) -> None:
    """It is tried twice, the bowl is looked into, then the pour fails."""
    outcome, motions = performed(*over_the_bowl, FULL, FULL, FULL)
    assert isinstance(outcome, rc.NotDone)
    assert (outcome.kind, len(motions)) == ("failed", 6)


def test_a_second_tilt_that_is_cancelled_counts_too(over_the_bowl: tuple[Situation, Pour]) -> None:
    """What had left in the first one, and in the second until then, is not forgotten."""
    here, command = over_the_bowl
    assert isinstance(poured(here, command, FULL, HALF, EMPTY, cancelled=3), rc.NotDone)
    assert here.unfinished[JAR].left == pytest.approx(FULL - EMPTY)


def test_content_taken_out_between_two_tilts_was_not_poured(over_the_bowl: tuple[Situation, Pour]) -> None:
    """Nothing left in the first tilt, somebody empties the jar, nothing leaves in the second: the pour fails."""
    here, command = over_the_bowl
    poured(here, command, FULL, FULL, cancelled=TILTED)
    assert isinstance(poured(here, command, EMPTY, EMPTY), rc.NotDone)


def test_a_tilt_that_was_not_weighed_counts_from_its_beginning(over_the_bowl: tuple[Situation, Pour]) -> None:
    """The skill process dies while the jar is tilted: the next one has the weight before that tilt from the journal."""
    here, command = over_the_bowl
    here.unfinished[JAR] = Unfinished(BOWL, FULL)
    outcome = poured(here, command, EMPTY, EMPTY)
    assert isinstance(outcome, rc.Done)
    assert outcome.weighed == (FULL, EMPTY)


def test_a_pour_into_another_thing_begins_by_itself(over_the_bowl: tuple[Situation, Pour]) -> None:
    """Content that left the jar before did not go there."""
    here, command = over_the_bowl
    here.models = {**here.models, "bowl_2": here.models[BOWL]}  # those of `here` are shared by all tests
    poured(here, command, FULL, EMPTY, cancelled=TILTED)
    here.place("bowl_2", here.seen[BOWL])
    here.forget(BOWL)
    outcome = poured(here, msgspec.structs.replace(command, destination="bowl_2"), EMPTY, EMPTY)
    assert isinstance(outcome, rc.NotDone)
    assert outcome.why == (fact(PourKind.NOTHING_LEFT, JAR, EMPTY, EMPTY),)


# --- the look into the bowl -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("had", "seen", "arrived"),
    [
        (0.0, 0.055, True),
        (0.0, 0.03, False),
        (0.0, 0.0, False),
        (0.03, 0.05, True),
        (0.03, 0.03, False),
        (0.0, 0.036, True),
    ],
)
def test_what_left_the_jar_is_looked_for_in_the_bowl(
    had: float, seen: float, arrived: bool, over_the_bowl: tuple[Situation, Pour]
) -> None:
    """What was in it before does not count; what is seen there is told."""
    here, command = over_the_bowl
    here.contents[BOWL] = had
    outcome, _ = performed(here, command, FULL, EMPTY, content=(None, seen))
    assert isinstance(outcome, rc.Done)
    assert outcome.arrived is arrived
    assert {one.object: one.content for one in outcome.seen}[BOWL] == seen


@pytest.mark.parametrize(("seen", "arrived"), [(0.055, True), (0.018, None), (0.0, None), (None, None)])
def test_a_wrist_that_feels_no_difference_is_not_believed_alone(
    seen: float | None, arrived: bool | None, over_the_bowl: tuple[Situation, Pour]
) -> None:
    """It is stuck, and the bowl is full: the pour is done. The bowl is not: it failed, for two senses say so."""
    outcome, _ = performed(*over_the_bowl, FULL, FULL, FULL, content=(None, seen))
    assert getattr(outcome, "arrived", None) is arrived
    assert isinstance(outcome, rc.Done if arrived else rc.NotDone)


@pytest.mark.parametrize(("seen", "arrived"), [(0.055, True), (0.018, False), (None, None)])
def test_a_wrist_that_feels_nothing_after_the_tilt_leaves_it_to_the_eyes(
    seen: float | None, arrived: bool | None, over_the_bowl: tuple[Situation, Pour]
) -> None:
    """What was in the jar was felt before; as much must be seen in the bowl."""
    outcome, _ = performed(*over_the_bowl, FULL, math.nan, content=(None, seen))
    assert isinstance(outcome, rc.Done)
    assert (outcome.arrived, outcome.weighed) == (arrived, None)


@pytest.mark.parametrize(("seen", "arrived"), [(0.055, True), (0.0, False), (None, None)])
def test_without_sensors_the_eyes_tell(
    seen: float | None, arrived: bool | None, over_the_bowl: tuple[Situation, Pour]
) -> None:
    """Nobody knows how much was in the jar: there must be something in the bowl that was not there."""
    outcome, _ = performed(*over_the_bowl, math.nan, math.nan, content=(None, seen))
    assert isinstance(outcome, rc.Done)
    assert (outcome.arrived, outcome.weighed) == (arrived, None)


def test_only_the_last_look_tells_what_arrived(over_the_bowl: tuple[Situation, Pour]) -> None:
    """What was seen before and during the tilt is old."""
    outcome, motions = performed(*over_the_bowl, FULL, EMPTY, content=(0.03, None))
    assert isinstance(outcome, rc.Done)
    assert (outcome.arrived, len(motions)) == (None, LOOK)


@pytest.mark.parametrize(
    ("had", "seen", "arrived"),
    [
        (0.0, 0.03, True),
        (0.0, 0.006, True),
        (0.0, 0.004, None),
        (0.0, 0.0, None),
        (0.03, 0.046, True),
        (0.03, 0.04, None),
    ],
)
def test_a_look_that_something_hides_tells_the_least(
    had: float, seen: float, arrived: bool | None, over_the_bowl: tuple[Situation, Pour]
) -> None:
    """A box stands between the head and the bowl, wherever the hand is: there is as much as is seen, or more."""
    here, command = over_the_bowl
    bowl, eye = here.seen[BOWL].translation, here.robot.camera(here.q[names.TORSO], 0.0, 0.5).translation
    here.models = {**here.models, "box_1": "box1"}
    here.place("box_1", standing(eye + 0.3 * (bowl - eye)))
    here.contents[BOWL] = had
    outcome, _ = performed(here, command, FULL, EMPTY, content=(None, seen))
    assert isinstance(outcome, rc.Done)
    assert outcome.arrived is arrived
    assert all(one.content is None for one in outcome.seen)
    here.forget("box_1")


def test_the_hand_is_drawn_back_until_the_bowl_is_in_view(over_the_bowl: tuple[Situation, Pour]) -> None:
    """The last motion ends where nothing is before the bowl."""
    here, command = over_the_bowl
    _, motions = performed(here, command, FULL, EMPTY)
    assert here.hidden(BOWL, motions[-1].path()[-1]) == 0


def test_the_hand_is_drawn_aside_where_the_elbow_is_near_the_head(over_the_bowl: tuple[Situation, Pour]) -> None:
    """The posture, the bowl and the azimuth of a pour after a stop: the head could not turn to the bowl."""
    here, command = over_the_bowl
    here.place(BOWL, standing(np.array([0.630, -0.490, 0.775])))
    here.q[[names.TORSO, *names.ARM["left"]]] = [-0.954, -2.557, 2.064, -2.190, 1.663, 1.771, 0.696, 1.003]
    here.head = (0.0, 0.0)
    rim = here.seen[BOWL].act(np.array(models.MODELS[here.models[BOWL]].hole.centre))
    assert turned(here, here.q, rim) is None
    path = _away(here, msgspec.structs.replace(command, azimuth=0.2), rim)
    head = turned(here, path[-1], rim)
    assert head is not None
    assert here.hidden(BOWL, path[-1], (head.pan, head.tilt)) == 0


def test_a_cancel_while_it_looks_changes_nothing(over_the_bowl: tuple[Situation, Pour]) -> None:
    """All has left the jar: the pour is done, and it was not looked into."""
    outcome, _ = performed(*over_the_bowl, FULL, EMPTY, cancelled=LOOK - 1)
    assert isinstance(outcome, rc.Done)
    assert (outcome.weighed, outcome.arrived) == ((FULL, EMPTY), None)


def test_content_of_an_earlier_tilt_counts_as_poured(over_the_bowl: tuple[Situation, Pour]) -> None:
    """Half had left before an interruption: all of it must be there, more than was in the bowl before."""
    here, command = over_the_bowl
    here.contents[BOWL] = 0.0
    poured(here, command, FULL, HALF, cancelled=TILTED)
    here.contents[BOWL] = 0.03  # seen meanwhile
    outcome, _ = performed(here, command, HALF, EMPTY, content=(None, 0.03))
    assert isinstance(outcome, rc.Done)
    assert outcome.arrived is False


def test_nothing_is_tilted_over_a_bowl_that_is_gone(over_the_bowl: tuple[Situation, Pour]) -> None:
    """It is in none of some pictures below the jar, where some of it would be in view: the jar stays upright."""
    here, command = over_the_bowl
    sights: list[Sight] = [Sight("table_1", here.seen["table_1"])]
    work = perform(here, command)
    motion = next(work)
    sensed = _sensed(here, motion, FULL, False, None)
    here.q = motion.path()[-1]
    assert here.surely_seen(BOWL), "the jar hides too much of it here"
    upright, outcome = motion.path()[-1], None
    try:
        for _ in range(MORE_LOOKS + 1):
            motion = work.send(dataclasses.replace(sensed, sights=sights))
            assert np.allclose(motion.path()[-1], upright)
    except StopIteration as end:
        outcome = end.value
    assert outcome is not None
    assert (outcome.kind, outcome.missing) == ("missing", (BOWL,))


@pytest.mark.parametrize("seen", [0.0, 0.03])
def test_content_may_cover_what_is_inside(seen: float, over_the_bowl: tuple[Situation, Pour]) -> None:
    """Markers inside tell where a bowl is until something is in it, poured or seen; those outside always do."""
    here, _ = over_the_bowl
    every = here.markers[BOWL]
    normal = np.cross(every[:, 3] - every[:, 0], every[:, 1] - every[:, 0])
    inwards = np.einsum("nk,nk->n", normal[:, :2], every.mean(axis=1)[:, :2]) < 0.0
    here.q, here.contents[BOWL] = np.array(names.START), seen
    goal = aim(float(here.q[names.TORSO]), here.seen[BOWL].translation)
    here.head = goal.pan, goal.tilt
    seen_by = {}
    for inside in (True, False):
        here.markers = {BOWL: every[inwards == inside]}
        here.filled.clear()
        seen_by[inside] = [here.surely_seen(BOWL)]
        here.filled.add(BOWL)
        seen_by[inside].append(here.surely_seen(BOWL))
    assert seen_by == {True: [seen == 0.0, False], False: [True, True]}


def test_a_bowl_is_filled_by_a_tilt(over_the_bowl: tuple[Situation, Pour]) -> None:
    """Even where it was cancelled."""
    here, command = over_the_bowl
    poured(here, command, FULL, HALF, cancelled=TILTED)
    assert here.filled == {BOWL}


@pytest.mark.parametrize(("aside", "kind"), [(0.005, ""), (0.05, "replan")])
def test_nothing_is_tilted_over_a_bowl_that_was_moved(
    aside: float, kind: str, over_the_bowl: tuple[Situation, Pour]
) -> None:
    """It is seen beside where it was: the stream would miss it. Millimetres are noise."""
    here, command = over_the_bowl
    work = perform(here, command)
    sensed = _sensed(here, next(work), FULL, False, None)
    moved = standing(here.seen[BOWL].translation + np.array([aside, 0.0, 0.0]))
    ended = ""
    try:
        work.send(dataclasses.replace(sensed, sights=[Sight(BOWL, moved)]))
    except StopIteration as end:
        ended = end.value.kind
    assert ended == kind

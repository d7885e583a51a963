"""The bowl is watched while the jar is tilted over it. What the eyes see is made up, the tilt in
physics is not.
"""

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from tilts import BOWL, JAR, LEFT, brought, hidden

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import Cancel, GripReport, LookAgain, Phase
from companion.skills.performing import perform
from companion.skills.situation import Sight, Situation
from companion.skills.skill import Sensed
from companion.tasks.pour.done import Pour, PourKind
from companion.tasks.pour.perform import DOUBT_S, LOOK_EVERY_S
from services.executor.simulation import InProcess
from velma import names
from velma.control.grip import Grip
from velma.eyes import health
from velma.kinematics.frames import standing
from velma.sim.truth import TruthReader

pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar

UNSEEN = fact(PourKind.DURING_THE_TILT, fact(Kind.OUT_OF_VIEW, BOWL))
FULL = 0.26  # [kg] the jar of the canonical scene with all of its content
See = Callable[[Situation, int], list[Sight]]


Tilt = tuple[Situation, Pour]


@pytest.fixture
def over(over_the_bowl):
    """The jar is in the left hand above the bowl, which is in view."""
    return over_the_bowl[0].here, over_the_bowl[1]


def looked(here, pour, see, looks=8, wrong=""):
    """Perform a pour whose tilt is looked at so often, at rest in its first posture; return answers
    and outcome.

    `see`: what the eyes see at the n-th look; after the tilt, what they saw last. `wrong`: with the
    camera in the tilt.
    """
    work, answers, last = perform(here, pour), list[object](), list[Sight]()
    try:
        motion = next(work)
        upright = motion.path()[-1]
        while True:
            ended = "done"
            for n in range(looks if motion.look_every_s else 0):
                last = see(here, n)
                running = _sensed(here, upright, str(Phase.RUNNING), last)
                answers.append(work.send(replace(running, wrong=wrong)))
                if isinstance(answers[-1], Cancel):
                    ended = "cancelled"
                    break
            q = upright if ended == "cancelled" else motion.path()[-1]
            motion = work.send(_sensed(here, q, ended, last or standing_ones(here)))
    except StopIteration as stop:
        return answers, stop.value


def _sensed(here, q, ended, sights):
    grips = {str(LEFT): GripReport(felt=Grip.HELD, mass=FULL)}
    return Sensed(ended, (), q, q, {}, {}, grips, here.head, sights, here.time + 0.1)


def standing_ones(here, *without):
    """All things in their places."""
    there = [name for name in here.seen if here.holder(name) is None and name not in without]
    return [Sight(name, here.seen[name]) for name in there]


def aside(here, by):
    """The bowl so far from its place [m]."""
    beside = pin.SE3(np.eye(3), np.array([by, 0.0, 0.0])) * here.seen[BOWL]
    return [*standing_ones(here, BOWL), Sight(BOWL, beside)]


def fallen(here):
    """The bowl on its side."""
    pose = here.seen[BOWL]
    turned = pin.SE3(pin.exp3(np.array([1.2, 0.0, 0.0])) @ pose.rotation, pose.translation)
    return [*standing_ones(here, BOWL), Sight(BOWL, turned)]


def boxed(here, across, azimuth=0.0):
    """A box in the air, so far from the middle above the bowl [m], in this direction [rad]."""
    x, y = across * np.cos(azimuth), across * np.sin(azimuth)
    at = here.seen[BOWL].translation + np.array([x, y, 0.35])
    return [*standing_ones(here, "box_1"), Sight("box_1", standing(at))]


def is_tilted_on(answers):
    return bool(answers) and all(isinstance(one, LookAgain) for one in answers)


def test_an_undisturbed_bowl_is_looked_at_and_nothing_else_happens(over):
    """At least twice a simulated second; a few millimetres are noise."""
    assert LOOK_EVERY_S <= 0.5
    answers, _ = looked(*over, lambda here, n: aside(here, 0.005 * (-1) ** n))
    assert answers == [LookAgain("pour", LOOK_EVERY_S)] * len(answers)


def test_a_camera_that_is_not_well_tells_nothing_of_the_bowl(over):
    """A picture that went dark is no bowl that went."""
    answers, _ = looked(*over, lambda here, n: [], wrong=health.Wrong.DARK)
    assert is_tilted_on(answers)


@pytest.mark.parametrize(
    ("see", "kind", "why"),
    [
        (
            lambda here, n: aside(here, 0.12),
            "replan",
            fact(PourKind.DURING_THE_TILT, fact(Kind.MOVED, BOWL, 0.12)),
        ),
        (
            lambda here, n: fallen(here),
            "replan",
            fact(PourKind.DURING_THE_TILT, fact(Kind.FELL_OVER, BOWL)),
        ),
        (
            lambda here, n: boxed(here, 0.0),
            "replan",
            fact(PourKind.DURING_THE_TILT, fact(Kind.ABOVE, "box_1", BOWL)),
        ),
        (
            lambda here, n: standing_ones(here, BOWL),
            "missing",
            fact(Kind.NOT_WHERE_IT_WAS, BOWL, UNSEEN),
        ),
    ],
)
def test_what_happens_to_the_bowl_ends_the_tilt(over, see, kind, why):
    """Within some looks, which come soon after each other; the content is what was weighed, and the
    reason is true.
    """
    answers, outcome = looked(*over, see)
    *doubts, last = answers
    assert last == Cancel("pour")
    assert doubts == [LookAgain("pour", DOUBT_S)] * (len(answers) - 1)
    assert len(answers) in ((2, 3) if kind == "missing" else (2,))
    assert (outcome.kind, outcome.missing) == (kind, (BOWL,) if kind == "missing" else ())
    assert outcome.why == (why,)
    assert over[0].unfinished[JAR].left == pytest.approx(0.0)


@pytest.mark.parametrize("late", [False, True])
def test_a_bowl_that_is_seen_again_is_not_missing(over, late):
    """Somebody's hand was before it during the tilt, and for a look longer."""

    def see(here, n):
        return standing_ones(here, BOWL)

    here, pour = over
    work = perform(here, pour)
    upright = next(work).path()[-1]
    work.send(_sensed(here, upright, "done", standing_ones(here)))
    answer = None
    while not isinstance(answer, Cancel):
        answer = work.send(_sensed(here, upright, str(Phase.RUNNING), see(here, 0)))
    work.send(_sensed(here, upright, "cancelled", see(here, 0)))
    if late:
        work.send(_sensed(here, upright, "done", see(here, 0)))
    with pytest.raises(StopIteration) as end:
        work.send(_sensed(here, upright, "done", standing_ones(here)))
    assert (end.value.value.kind, end.value.value.missing) == ("replan", ())
    assert end.value.value.why == (UNSEEN,)


@pytest.mark.parametrize("gone", [True, False])
def test_a_bowl_that_the_jar_hides_is_looked_for_with_the_hand_drawn_back(jar_out, gone):
    """During the tilt it would surely be seen and was not; upright, the jar hides it: that it is
    not seen then proves nothing.
    """
    here, pour = jar_out.here, hidden(jar_out)
    work = perform(here, pour)
    upright = next(work).path()[-1]
    work.send(_sensed(here, upright, "done", standing_ones(here)))
    assert not here.surely_seen(BOWL)
    unseen, answer = standing_ones(here, BOWL), object()
    while not isinstance(answer, Cancel):
        # no arm is before the bowl
        answer = work.send(_sensed(here, names.START, str(Phase.RUNNING), unseen))
    work.send(_sensed(here, upright, "cancelled", unseen))
    work.send(_sensed(here, upright, "done", unseen))
    back = work.send(_sensed(here, upright, "done", unseen))
    assert here.hidden(BOWL, back.path()[-1]) < here.hidden(BOWL, upright)
    with pytest.raises(StopIteration) as end:
        work.send(_sensed(here, back.path()[-1], "done", unseen if gone else standing_ones(here)))
    assert end.value.value.kind == ("missing" if gone else "replan")
    assert (BOWL in here.seen) is not gone


@pytest.mark.parametrize(
    "see",
    [
        lambda here, n: aside(here, 0.03),
        lambda here, n: aside(here, 0.12) if n % 2 else standing_ones(here),
        lambda here, n: fallen(here) if n % 2 else standing_ones(here),
        lambda here, n: standing_ones(here, BOWL) if n % 2 else standing_ones(here),
        lambda here, n: [] if n % 3 else standing_ones(here),
        lambda here, n: boxed(here, 0.4),
    ],
)
def test_what_proves_nothing_ends_no_tilt(over, see):
    """Less than half of the rim's radius, single wrong sights, dark pictures, a thing beside."""
    answers, _ = looked(*over, see, looks=12)
    assert is_tilted_on(answers)


def test_a_bowl_that_is_hidden_is_not_missing(over):
    """A box stands between the head and the bowl: nobody could see it there."""
    here, _ = over
    eye = here._eye(here.q)
    here.place("box_1", standing(eye + 0.3 * (here.seen[BOWL].translation - eye)))
    assert not here.in_view(BOWL)
    answers, _ = looked(*over, lambda here, n: standing_ones(here, *[BOWL] * bool(n)), looks=12)
    assert is_tilted_on(answers)


def test_what_stood_there_before_is_not_above(over):
    """The tilt was planned with it."""
    here, pour = over
    here.see(boxed(here, 0.12, pour.azimuth))  # where the jar does not come from
    assert here.above(BOWL) == {"box_1"}
    answers, _ = looked(here, pour, lambda here, n: boxed(here, 0.12, pour.azimuth))
    assert is_tilted_on(answers)


@pytest.mark.parametrize(("degrees", "gone"), [(30, True), (60, False)])
def test_nothing_falls_beside_a_bowl_that_is_taken_away(jar_out, degrees, gone):
    """It is removed or pushed by 12 cm while the jar is tilted: the jar is upright in 3 s, all of
    its content in it.
    """
    pour = brought(jar_out, seen=True)
    core, truth, happened = jar_out.core, TruthReader(jar_out.core.backend), list[float]()
    body = InProcess(core, jar_out.eye)
    cycle, upright = core.cycle, list[float]()

    def disturbed():
        cycle()
        leans = np.degrees(np.arccos(truth.pose(JAR)[0][2, 2]))
        if not happened and leans > degrees:
            happened.append(core.state.time)
            pushed = truth.pose(BOWL)[1] + np.array([0.0, 0.12, 0.0])
            place(core, BOWL, np.array([-2.0, 2.0, 0.001]) if gone else pushed)
        elif happened and not upright and core.state.time > happened[0] + 0.5 and leans < 25.0:
            upright.append(core.state.time)

    core.cycle = disturbed  # type: ignore[method-assign]
    outcome = body.perform(perform(jar_out.here, pour))
    assert outcome.kind == ("missing" if gone else "replan")
    assert upright[0] - happened[0] < 3.0
    assert truth.read().grains_in[JAR] == truth.read().grains


def place(core, name, xyz):
    """Put a thing at rest at `xyz` (3,) [m, world]."""
    model, data = core.backend.model, core.backend.data
    joint = model.body(name).jntadr[0]
    data.qpos[model.jnt_qposadr[joint] + np.arange(3)] = xyz
    data.qvel[model.jnt_dofadr[joint] + np.arange(6)] = 0.0
    mujoco.mj_forward(model, data)

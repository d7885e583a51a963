"""Looking for a thing that should be there: the torso is turned while it is hidden, and no
longer.
"""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from companion.languages import rc
from companion.skills.motions import aim
from companion.skills.performing import perform
from companion.skills.senses import MORE_LOOKS, missed
from companion.skills.situation import Sight
from companion.skills.skill import Sensed
from companion.tasks.look_around.perform import look
from velma import names
from velma.kinematics.frames import standing

BOWL = "bowl_1"
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


@pytest.fixture
def cabinet_gone(jar_out):
    """The bowl stands where nothing but an arm can hide it, and near enough."""
    here = jar_out.here
    here.forget("cabinet_2")
    here.place(BOWL, standing((0.6, 0.0, 0.9)))
    goal = aim(float(here.q[names.TORSO]), (0.6, 0.0, 0.9))
    here.head = goal.pan, goal.tilt
    return here


@pytest.mark.parametrize("turned", [0.0, 1.2, -1.2])
def test_what_is_out_of_the_picture_is_not_surely_seen(cabinet_gone, turned):
    """The head does not turn everywhere: what is in a raised hand beside it may be there, but in no
    picture.
    """
    here = cabinet_gone
    here.head = here.head[0] + turned, here.head[1]
    for at in (None, here.seen[BOWL]):
        assert here.surely_seen(BOWL, at) == (turned == 0.0)


def looked(here, at, seen_from):
    """Return the motions of a look; a table is seen in each, the bowl from the n-th one on."""
    work, motions = look(here, rc.Look("look", tuple(at))), []
    bowl, table = Sight(BOWL, here.seen[BOWL]), table_of(here)
    try:
        motion = next(work)
        while True:
            motions.append(motion)
            here.q = motion.path()[-1]
            sights = [table, bowl] if len(motions) >= seen_from else [table]
            here.see(sights)
            motion = work.send(sensed(here, sights))
    except StopIteration:
        return motions


def table_of(here):
    """A table, as it is known."""
    return Sight("table_1", here.seen["table_1"])


def sensed(here, sights):
    """What a motion ends with."""
    return Sensed("done", (), here.q, here.q, {}, {}, {}, here.head, sights, here.time)


def test_a_thing_that_is_seen_is_looked_at_once(jar_out):
    """The torso rests."""
    at = tuple(float(x) for x in jar_out.here.seen[BOWL].translation)
    assert len(looked(jar_out.here, [at], 1)) == 1


@pytest.mark.parametrize(("seen_from", "motions"), [(2, 2), (3, 3), (99, 3)])
def test_the_torso_turns_until_a_hidden_thing_is_seen(seen_from, motions, jar_out):
    """To one side, then to the other; where it is seen from neither, the look ends."""
    here = jar_out.here
    before = float(here.q[names.TORSO])
    done = looked(here, [tuple(float(x) for x in here.seen[BOWL].translation)], seen_from)
    assert len(done) == motions
    angles = [float(motion.path()[-1][names.TORSO]) - before for motion in done]
    assert angles[0] == pytest.approx(0.0, abs=1e-9)
    assert all(abs(a - b) > 0.1 for a, b in pairwise(angles))
    arms = [np.delete(motion.path()[-1], names.TORSO) for motion in done]
    assert all(np.allclose(arm, arms[0]) for arm in arms)


def test_a_place_where_nothing_should_be_is_looked_at_once(jar_out):
    """A look around turns the head alone."""
    assert len(looked(jar_out.here, [(1.0, 0.0, 2.0), (0.6, -0.9, 1.6)], 99)) == 2


def test_a_thing_that_is_not_where_nothing_hides_it_is_missing(cabinet_gone):
    """After the torso has turned, too; one that is seen at last is not."""
    here = cabinet_gone
    at = tuple(float(x) for x in here.seen[BOWL].translation)
    here.begin()
    looked(here, [at], 2)
    assert here.missing == set()
    looked(here, [at], 99)
    assert here.missing == {BOWL}


def test_eyes_that_see_nothing_at_all_miss_nothing(cabinet_gone):
    """The picture is black: no furniture is in it either."""
    here = cabinet_gone
    here.begin()
    assert not here.miss(BOWL, [])
    assert here.miss(BOWL, [table_of(here)])


def test_a_thing_that_may_be_hidden_is_not_missing(cabinet_gone):
    """A box stands before it."""
    here = cabinet_gone
    bowl = here.seen[BOWL].translation
    eye = here.robot.camera(here.q[names.TORSO], 0.0, 0.5).translation
    here.models = {**here.models, "box_1": "box3"}
    here.place("box_1", pin.SE3(np.eye(3), eye + 0.5 * (bowl - eye)))
    here.begin()
    looked(here, [tuple(float(x) for x in bowl)], 99)
    assert here.missing == set()


def test_what_is_missing_is_told_and_forgotten(cabinet_gone):
    """The outcome names it; the next act does not know of it."""
    here = cabinet_gone
    at = tuple(float(x) for x in here.seen[BOWL].translation)
    outcome = performed(here, rc.Look("look", (at,)))
    assert isinstance(outcome, rc.Done)
    assert outcome.missing == (BOWL,)
    assert BOWL not in here.seen
    again = performed(here, rc.Look("look again", (at,)))
    assert isinstance(again, rc.Done)
    assert again.missing == ()


def performed(here, command):
    """Perform it; a table is seen, and nothing else."""
    work = perform(here, command)
    try:
        motion = next(work)
        while True:
            q = motion.path()[-1]
            motion = work.send(
                Sensed("done", (), q, q, {}, {}, {}, here.head, [table_of(here)], here.time)
            )
    except StopIteration as stop:
        return stop.value


@pytest.mark.parametrize("seen_at", [0, 1, MORE_LOOKS, MORE_LOOKS + 1])
def test_a_picture_that_shows_nothing_is_followed_by_others(cabinet_gone, seen_at):
    """Only a thing that is in none of them is missing."""
    here = cabinet_gone
    here.begin()
    table, bowl = table_of(here), Sight(BOWL, here.seen[BOWL])
    pictures = [[table, bowl] if number == seen_at else [table] for number in range(MORE_LOOKS + 1)]
    work = missed(here, "act", BOWL, sensed(here, pictures[0]))
    looks, missing = 0, None
    try:
        next(work)
        while True:
            looks += 1
            work.send(sensed(here, pictures[looks]))
    except StopIteration as end:
        missing = end.value
    assert missing is (seen_at > MORE_LOOKS)
    assert looks == min(seen_at, MORE_LOOKS)

"""Looking for a thing that should be there: the torso is turned while it is hidden, and no longer."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from robot import Acting

from companion.languages import rc
from services.executor.loop.program import Motion
from services.executor.sight import Sight
from services.executor.skills.looking import look
from services.executor.skills.situation import Situation
from services.executor.skills.skill import Sensed
from velma import names

BOWL = "bowl_1"
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


def looked(here: Situation, at: Sequence[tuple[float, float, float]], seen_from: int) -> list[Motion]:
    """Return the motions of a look; the bowl is seen from the n-th one on."""
    work, motions = look(here, rc.Look("look", tuple(at))), []
    bowl = Sight(BOWL, here.seen[BOWL])
    try:
        motion = next(work)
        while True:
            motions.append(motion)
            here.q = motion.path()[-1]
            sights = [bowl] if len(motions) >= seen_from else []
            motion = work.send(Sensed("done", "", here.q, here.q, {}, {}, {}, here.head, sights, here.time))
    except StopIteration:
        return motions


def test_a_thing_that_is_seen_is_looked_at_once(jar_out: Acting) -> None:
    """The torso rests."""
    at = tuple(float(x) for x in jar_out.here.seen[BOWL].translation)
    assert len(looked(jar_out.here, [at], 1)) == 1


@pytest.mark.parametrize(("seen_from", "motions"), [(2, 2), (3, 3), (99, 3)])
def test_the_torso_turns_until_a_hidden_thing_is_seen(seen_from: int, motions: int, jar_out: Acting) -> None:
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


def test_a_place_where_nothing_should_be_is_looked_at_once(jar_out: Acting) -> None:
    """A look around turns the head alone."""
    assert len(looked(jar_out.here, [(1.0, 0.0, 2.0), (0.6, -0.9, 1.6)], 99)) == 2

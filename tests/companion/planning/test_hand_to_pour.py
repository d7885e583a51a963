"""A pour begins with the hand that is likely to have a way there; a wrong guess costs time, not the
plan.
"""

import pytest
from msgspec.structs import replace
from planned import Km, acts, surveyed

from companion.languages.values import Side
from companion.planning.methods import OTHER, Asking
from companion.planning.steps import Geometry
from companion.tasks.pour import plan as pouring
from companion.tasks.pour.done import Pour
from velma.kinematics.robot import Robot
from velma.model import scene as model

pytestmark = pytest.mark.timeout(240)


def mirrored(scene):
    """Return the scene with left and right exchanged."""
    things = (
        replace(one, xyz=(one.xyz[0], -one.xyz[1], one.xyz[2]), yaw=-one.yaw)
        for one in scene.things
    )
    return replace(scene, things=tuple(things))


def hands(plan):
    """The hands that pour in a plan."""
    return [act.side for act in acts(plan, Pour)]


@pytest.mark.parametrize("seed", [4, 12])
def test_the_hand_beside_the_bowl_is_likely(seed):
    """In env2 the right one, in its mirror image the left one; the question is asked once for a
    place of the bowl.
    """
    scene = model.vary(model.load(model.CANONICAL.with_stem("env2")), seed)
    for likely, one in ((Side.RIGHT, scene), (Side.LEFT, mirrored(scene))):
        asking = Asking(Km(surveyed(one)).ask, "p")
        geometry, state = Geometry(asking, Robot(), seed), asking.suppose("", ())
        for hand in Side:
            assert pouring.likely(geometry, state, "jar_1", "bowl_1", hand) is (hand is likely)
            likely_to = pouring.not_likely(geometry, state, "jar_1", "bowl_1", hand)
            assert likely_to is (hand is not likely)
        assert len(geometry.pouring) == 1


def test_the_other_hand_pours_where_the_likely_one_cannot(env2, monkeypatch):
    """With the wrong hand taken for the likely one, the same hand pours in the end."""
    (right,) = hands(Km(env2).plan("pour", "jar", "bowl"))
    monkeypatch.setattr(pouring, "_likely", lambda *arguments: OTHER[right])
    assert hands(Km(env2).plan("pour", "jar", "bowl")) == [right]

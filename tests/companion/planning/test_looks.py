"""How long a plan says that a look around lasts."""

import pytest
from planned import Km

from companion.look_around import POINTS
from companion.world.scene import Scene
from velma.kinematics.tasks import looking


@pytest.mark.parametrize("head", [(0.0, 0.0), (0.6, 0.67), (-1.4, 0.3)])
@pytest.mark.parametrize("torso", [0.0, 0.5])
def test_it_begins_where_the_head_looks(head, torso):
    """As km knows it."""
    plan = Km(Scene(joints={"head": head, "torso": (torso,)})).plan("look_around")
    assert plan.duration == pytest.approx(looking.duration(torso, head, POINTS))


@pytest.mark.parametrize("joints", [{}, {"torso": (0.0,)}, {"head": (0.6, 0.67)}], ids=str)
def test_where_km_does_not_know_how_it_stands_there_is_a_plan_all_the_same(joints):
    """The head is taken to look straight ahead."""
    plan = Km(Scene(joints=joints)).plan("look_around")
    assert plan.duration == pytest.approx(looking.duration(0.0, (0.0, 0.0), POINTS))

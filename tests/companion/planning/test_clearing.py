"""Things in the way are put aside first."""

import pytest

from companion.languages import rc, wm
from companion.languages.hfsm import HierarchicalPlan
from companion.languages.values import Pose, Side
from services.knowledge.observe import observed
from services.knowledge.scene import Scene

pytestmark = pytest.mark.timeout(240)  # a search takes 16 s of processor
ASIDE = Pose((0.75, -0.5, 0.81))  # on table_2, an arm's length from the jar


def without(scene: Scene, name: str) -> Scene:
    """The scene with a thing that was seen far from all others."""
    thing = scene.things[name]
    return observed(scene, wm.SeenObject(name, thing.model, ASIDE, 9.0), (9, 1), 9.0)


def grasped(plan: HierarchicalPlan) -> list[str]:
    """Return the things that the hands grasp in a plan, in this order."""
    assert isinstance(plan, HierarchicalPlan), plan
    acts = [leaf.command for state in plan.root.states for leaf in getattr(state, "states", ())]
    return [act.object for act in acts if isinstance(act, rc.Grasp)]


@pytest.mark.parametrize("task", [("pour", "jar", "bowl"), ("take", "jar", ""), ("take", "jar", Side.RIGHT)])
def test_a_box_beside_the_jar_is_put_aside_first(task, km, named, env2: Scene) -> None:
    """No hand has room beside the jar; then the task goes on as if the box had never stood there."""
    plan = km(env2).plan(*task)
    assert grasped(plan) == ["box_1", "jar_1"]
    assert named(plan)[:2] == ["take box_1", "place box_1"]


def test_nothing_is_put_aside_where_the_jar_can_be_reached(km, env2: Scene) -> None:
    """Although another box stands near."""
    assert grasped(km(without(env2, "box_1")).plan("take", "jar", "")) == ["jar_1"]


def test_the_box_in_the_way_can_be_wished_for(km, env2: Scene) -> None:
    """It is taken itself, and nothing is put aside for it."""
    assert grasped(km(env2).plan("take", "box_1", "")) == ["box_1"]

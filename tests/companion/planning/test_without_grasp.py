"""A known thing without a grasp, as a lid is, is left alone; who wants it hears why."""

import pytest

from companion.languages import wm
from companion.languages.facts import Kind, fact
from companion.languages.hfsm import HierarchicalPlan, NoPlan
from companion.languages.values import Pose
from companion.models import MODELS
from companion.planning import search
from services.knowledge.observe import observed
from services.knowledge.scene import Scene

pytestmark = pytest.mark.timeout(240)  # a search takes 16 s of processor
NO_GRASP = fact(Kind.NO_KNOWN_GRASP, "lid_1")


@pytest.fixture
def with_lid(beginning: Scene, bowl_placed: Scene) -> Scene:
    """A lid lies beside the bowl on the table."""
    x, y, z = bowl_placed.things["bowl_1"].pose.xyz
    above = MODELS["jar_lid"].base.z - MODELS["bowl_high"].base.z
    lid = wm.SeenObject("lid_1", "jar_lid", Pose((x, y - 0.2, z - above)), 3.0)
    return observed(bowl_placed, lid, (3, 1), 3.0)


@pytest.mark.parametrize("task", [("take", "lid", ""), ("bring", "lid", ""), ("put_at", "lid", "cabinet")])
def test_it_is_not_taken_and_the_reason_is_told(task, km, with_lid: Scene) -> None:
    """Nor is anything put aside for it."""
    found = km(with_lid).plan(*task)
    assert isinstance(found, NoPlan), found
    assert NO_GRASP in found.why


def test_it_stays_where_the_table_is_cleared(km, with_lid: Scene) -> None:
    """What else is there is put away, and the reason is told."""
    found = km(with_lid).plan("clear_table")
    assert isinstance(found, HierarchicalPlan), found
    assert found.root.states[-1].why == (fact(Kind.STAYS, "lid_1", NO_GRASP),)


@pytest.mark.parametrize("task", [("pour", "jar", "bowl"), ("take", "bowl", "")])
def test_other_things_are_taken_beside_it(task, km, with_lid: Scene) -> None:
    """It is an obstacle like any other."""
    assert isinstance(km(with_lid).plan(*task), HierarchicalPlan)


def test_a_search_ends_after_a_number_of_tried_steps(km, with_lid: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a reason; one that needs no more of them finds its plan."""
    monkeypatch.setattr(search, "MOST_STEPS", 1)
    found = km(with_lid).plan("clear_table")
    assert isinstance(found, NoPlan), found
    assert fact(Kind.SEARCH_TOO_LONG, 1) in found.why
    monkeypatch.setattr(search, "MOST_STEPS", 45)
    assert isinstance(km(with_lid).plan("clear_table"), HierarchicalPlan)

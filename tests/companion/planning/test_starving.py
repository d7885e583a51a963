"""Every fact is really asked: starved of any one of them, km makes the plan fail, and says why."""

import gc
import weakref

import pytest

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from services.knowledge.scene import Scene

SOON = (
    wm.ListObjects, wm.HypotheticalState, wm.CurrentGrasp, wm.ObjectPose, wm.Holds, wm.GraspAtSide, wm.StaticObjects,
    wm.EnvironmentShapes, wm.GripperConfiguration, wm.TorsoConfiguration, wm.ArmConfiguration, wm.ObjectModel,
    wm.GraspSet, wm.ObjectHole, wm.GraspDefinition,
)  # fmt: skip
LATE = (wm.RobotReach, wm.FlatSurfaces, wm.CollisionsInVolume)


def test_these_are_all_that_is_asked(first, second) -> None:
    """The kinds starved below are those of both plans."""
    asked = {type(query) for km, _ in (first, second) for query in km.asked}
    assert asked == {*SOON, *LATE}


@pytest.mark.parametrize("kind", SOON)
def test_starved_of_a_kind_there_is_no_plan(km, beginning: Scene, kind: type) -> None:
    """From the beginning: km's reason is told, and nothing is planned without the fact."""
    plan = km(beginning, lambda query: isinstance(query, kind)).plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert fact(Kind.UNKNOWN_TO_KM, kind.__name__) in plan.why


@pytest.mark.parametrize("kind", LATE)
def test_starved_of_where_to_put_down_there_is_no_plan(km, bowl_out: Scene, kind: type) -> None:
    """With the bowl in the hand: what is asked of tables and reach."""
    plan = km(bowl_out, lambda query: isinstance(query, kind)).plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert fact(Kind.UNKNOWN_TO_KM, kind.__name__) in plan.why


def test_starved_of_where_to_put_down_the_whole_plan_fails(km, beginning: Scene) -> None:
    """The last question ends it as well, though both hands are tried first."""
    plan = km(beginning, lambda query: isinstance(query, wm.FlatSurfaces)).plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert fact(Kind.UNKNOWN_TO_KM, "FlatSurfaces") in plan.why


@pytest.mark.parametrize("kind", [wm.ObjectHole, wm.ObjectModel, wm.ObjectPose, wm.EnvironmentShapes])
def test_starved_the_second_plan_fails(km, bowl_placed: Scene, kind: type) -> None:
    """Pouring as well stands on what km says now, not on what it said before."""
    plan = km(bowl_placed, lambda query: isinstance(query, kind)).plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert fact(Kind.UNKNOWN_TO_KM, kind.__name__) in plan.why


@pytest.mark.parametrize("name", ["jar_1", "bowl_1", "cabinet_2"])
def test_starved_of_a_thing_there_is_no_plan(km, beginning: Scene, name: str) -> None:
    """Source, destination and what they stand in: each is asked about by name."""
    plan = km(beginning, lambda query: getattr(query, "object", "") == name).plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert Kind.UNKNOWN_TO_KM in {one.kind for one in plan.why}


def test_an_answer_of_another_kind_is_no_answer(km, beginning: Scene) -> None:
    """The search takes only an answer to its question, whatever km says."""
    mad = km(beginning)
    truthful = mad.ask
    mad.ask = lambda query: wm.Truth(True) if isinstance(query, wm.GraspSet) else truthful(query)
    plan = mad.plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.NoPlan)
    assert fact(Kind.UNKNOWN_TO_KM, "GraspSet") in plan.why


@pytest.mark.parametrize(
    ("seen", "arguments", "word"), [(True, ("jar", "bucket"), "bucket"), (False, ("jar", "bowl"), "jar")]
)
def test_what_was_never_seen_is_looked_for_once(
    seen: bool, arguments: tuple[str, str], word: str, km, beginning: Scene
) -> None:
    """A look wherever the head turns; then km is asked for it, and if it does not know it, the task fails."""
    plan = km(beginning if seen else Scene()).plan("pour", *arguments)
    assert isinstance(plan, hfsm.HierarchicalPlan)
    machine, asked, end = plan.root.states
    assert isinstance(machine, hfsm.Machine)
    (look,) = machine.states
    assert isinstance(look, hfsm.ActState)
    assert isinstance(look.command, rc.Look)
    assert isinstance(asked, hfsm.AskState)
    assert (asked.query.subject, asked.otherwise) == (word, hfsm.Outcome.FAILED)
    assert isinstance(end, hfsm.EndState)
    assert end.outcome is hfsm.Outcome.REPLAN


def test_a_search_leaves_nothing_behind(km, beginning: Scene) -> None:
    """Neither one that fails nor one that is broken off: the process that searches lives as long as the robot."""
    starved = km(beginning, lambda query: isinstance(query, wm.GraspSet))
    starved.plan("pour", "jar", "bowl")
    with pytest.raises(RuntimeError, match="division"):
        km(beginning, lambda query: isinstance(query, wm.GraspSet) and 1 / 0 == 0).plan("pour", "jar", "bowl")
    gone = weakref.ref(starved)
    del starved
    gc.collect()
    assert gone() is None

"""The search as one function: a task network and a way to ask km in, a plan or the reason why there is none out."""

from collections.abc import Callable

from companion.languages import hfsm, wm
from services.planner.search import assembling
from services.planner.search.asking import Asking, Unanswered
from services.planner.search.domain import Search
from services.planner.search.holding import held_at
from services.planner.search.steps import Geometry
from velma.kinematics.robot import Robot


def search(
    network: hfsm.GroundTaskNetwork, ask: Callable[[wm.AnyQuery], wm.AnyAnswer], seed: int
) -> hfsm.HierarchicalPlan | hfsm.NoPlan:
    """Plan the network's tasks; every fact comes through `ask`. Chance is seeded; limits count iterations."""
    asking = Asking(ask, network.id)
    geometry = Geometry(Robot(), asking, seed)
    try:
        todo = [_ground(asking, task) for task in network.tasks]
        start = asking.suppose("", ())
        found = Search(geometry).run(todo, start)
    except Unanswered as unanswered:
        return hfsm.NoPlan(network.id, unanswered.reason)
    if found is None:
        return hfsm.NoPlan(network.id, _reason(geometry.why))
    steps, outcome = found
    name = " ".join((todo[0][0], *todo[0][1:]))
    held = held_at(asking, start)
    return assembling.plan(network.id, name, steps, outcome, asking.queries, held)


def _ground(asking: Asking, task: hfsm.Task) -> tuple[str, ...]:
    """The task with words for things replaced by the things km knows: "jar" -> "jar_1"."""
    things = asking(wm.ListObjects(), wm.Objects).objects
    arguments = []
    for word in task.arguments:
        named = [o.id for o in things if word in (o.id, o.kind.lower())]
        if word in ("", "left", "right"):
            named = [word]
        if not named:
            seen = ", ".join(sorted(o.id for o in things)) or "nothing"
            raise Unanswered(wm.ListObjects(kind=word), f"no {word} has been seen (seen so far: {seen})")
        arguments.append(named[0])
    return (task.name, *arguments)


def _reason(why: list[str]) -> str:
    """The different reasons of the failed attempts, last first, in one sentence."""
    different = list(dict.fromkeys(reversed(why)))
    return "; ".join(different[:3]) or "the task cannot be taken apart in the present state of the world"

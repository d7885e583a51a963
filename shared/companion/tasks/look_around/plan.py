"""Planning to look around."""

from companion.languages import hfsm
from companion.look_around import POINTS
from companion.planning.methods import Known, Subtasks
from companion.planning.registry import Plan
from companion.planning.steps import Geometry, Step, look_at


def look_around(known: Known, state: str) -> Subtasks | None:
    """Look around; always applicable."""
    return [("a_look_around",)]


def points_around(geometry: Geometry, state: str) -> Step:
    """The step that looks at points all around the front. It needs no fact."""
    return look_at(geometry, state, hfsm.Step("look-around"), POINTS)


PLAN = Plan(
    tasks={"look_around": ()},
    methods={"look_around": (look_around,)},
    actions={"a_look_around": points_around},
)

"""Primitive steps that turn the head: at one thing, and for one."""

from companion.languages import hfsm, rc
from companion.languages.values import Vector
from companion.look_around import EVERYWHERE
from companion.planning.steps import Geometry, Step

# [s] of one point of a look around, and of a single look (estimates); only for the expected duration
POINT_S, LOOK_S = 1.2, 2.0


def look_at(step: hfsm.Step, points: tuple[Vector, ...]) -> Step:
    """Return the step that looks at points (in the world, [m]) in turn. It needs no fact."""
    return Step(step, (rc.Look(key="", at=points),), (), POINT_S * len(points))


def look_for(word: str) -> Step:
    """Return the step that looks wherever the head can be turned to, for a thing that has not been seen."""
    return look_at(hfsm.Step("look-for", (word,)), EVERYWHERE)


def look(geometry: Geometry, state: str, name: str) -> Step:
    """Return the step that looks where the object should be."""
    return _look(geometry, state, name, "")


def confirm(geometry: Geometry, state: str, name: str) -> Step:
    """Return the step that looks whether the object stands where it was put; what is not seen is not checked."""
    return _look(geometry, state, name, name)


def _look(geometry: Geometry, state: str, name: str, put: str) -> Step:
    x, y, z = (float(v) for v in geometry.pose(state, name).translation)
    return Step(hfsm.Step("look-at", (name,)), (rc.Look(key="", at=((x, y, z),), put=put),), (), LOOK_S)

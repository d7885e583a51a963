"""Primitive tasks that turn the head: to look around, at one thing, and for one."""

from companion.languages import rc
from companion.look_around import EVERYWHERE, POINTS
from services.planner.search.steps import Geometry, Step

POINT_S, LOOK_S = (
    1.2,
    2.0,
)  # [s] of one point of a look around, and of a single look (estimates); only for the expected duration


def look_around() -> Step:
    """Return the step that looks at points all around the front. It needs no fact."""
    return Step("look around", (rc.Look(key="", at=POINTS),), (), POINT_S * len(POINTS))


def look_for(word: str) -> Step:
    """Return the step that looks wherever the head can be turned to, for a thing that has not been seen."""
    return Step(f"look for {word}", (rc.Look(key="", at=EVERYWHERE),), (), POINT_S * len(EVERYWHERE))


def look(geometry: Geometry, state: str, name: str) -> Step:
    """Return the step that looks where the object should be."""
    x, y, z = (float(v) for v in geometry.pose(state, name).translation)
    return Step(f"look at {name}", (rc.Look(key="", at=((x, y, z),)),), (), LOOK_S)

"""Primitive tasks that turn the head: over all that stands in front of the robot, and to one thing."""

from companion.around import POINTS
from companion.languages import rc
from services.planner.search.steps import Geometry, Step

POINT_S, LOOK_S = 1.2, 2.0  # [s] of one turn among others, and of one alone (estimates); only for the expected duration


def look_around() -> Step:
    """Points all around the front. It needs no fact."""
    return Step("look around", (rc.Look(key="", at=POINTS),), (), POINT_S * len(POINTS))


def look(geometry: Geometry, state: str, name: str) -> Step:
    """Turn the head to where the object should be."""
    x, y, z = (float(v) for v in geometry.pose(state, name).translation)
    return Step(f"look at {name}", (rc.Look(key="", at=((x, y, z),)),), (), LOOK_S)

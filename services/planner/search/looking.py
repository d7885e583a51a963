"""The step that looks around: the head turns over what stands in front of the robot. It needs no fact."""

import math

from companion.languages import rc
from services.planner.search.steps import Step

DISTANCE_M, HEIGHT_M = 1.0, 1.30  # tables and open shelves in front (estimate, as for the look at the beginning)
DIRECTIONS = (-0.85, 0.0, 0.75)  # [rad]; with a field of view of 60 degrees they overlap (estimate)
POINT_S = 1.2  # [s] of a turn of the head with its rest; only for the expected duration


def look_around() -> Step:
    """Points all around the front."""
    at = tuple((DISTANCE_M * math.cos(a), DISTANCE_M * math.sin(a), HEIGHT_M) for a in DIRECTIONS)
    return Step("look around", (rc.Look(key="", at=at),), (), POINT_S * len(at))

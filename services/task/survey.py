"""The look around that ta asks for when somebody begins to observe the world."""

import math

from companion.languages import rc

DISTANCE_M, HEIGHT_M = 1.0, 1.30  # the camera then looks at tables and open shelves in front (estimate)
DIRECTIONS = (-0.85, 0.0, 0.75)  # [rad]; with a field of view of 60 degrees they overlap (estimate)

SURVEY = rc.Look(
    key="survey",
    at=tuple((DISTANCE_M * math.cos(a), DISTANCE_M * math.sin(a), HEIGHT_M) for a in DIRECTIONS),
)

"""Points at which the head looks when it looks around: they show the things in front of the robot."""

import math

from companion.languages.values import Vector

DISTANCE_M, HEIGHT_M = 1.0, 1.30  # the camera then looks at tables and open shelves in front (estimate)
DIRECTIONS = (-0.85, 0.0, 0.75)  # [rad]; with a field of view of 60 degrees they overlap (estimate)

POINTS: tuple[Vector, ...] = tuple((DISTANCE_M * math.cos(a), DISTANCE_M * math.sin(a), HEIGHT_M) for a in DIRECTIONS)

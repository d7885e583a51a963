"""Points at which the head looks when it looks around: they show the things in front of the
robot.
"""

import math

from companion.languages.values import Vector

DISTANCE_M = 1.0
GAZES = ((-0.6, 1.0), (0.0, 1.0), (0.6, 0.8))
"""Direction [rad] and height [m] of the points. Measured with both recorded scenes, eyes by pixels,
seeds 1 to 4: these three show all things with two or more of their markers. At a height of 1.3 the
cabinet was hardly seen.
"""

SEARCH = (
    (-1.3, 0.7),
    (-0.4, 0.7),
    (0.4, 0.7),
    (1.3, 0.7),
    (1.3, 1.3),
    (0.4, 1.3),
    (-0.4, 1.3),
    (-1.3, 1.3),
)
"""The same for a search: as far as the head turns (1.57 rad), low and high; a picture is 1.05 rad
wide.
"""


def _points(gazes: tuple[tuple[float, float], ...]) -> tuple[Vector, ...]:
    return tuple((DISTANCE_M * math.cos(a), DISTANCE_M * math.sin(a), z) for a, z in gazes)


POINTS, EVERYWHERE = _points(GAZES), _points(SEARCH)

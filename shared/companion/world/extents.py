"""Where objects may touch: cells of the floor plan that an object or a volume reaches.

Two that touch share a cell, or the cells of one are not known. So only objects of the same cells
are compared, however many there are. An object reaches as far as relations look: its shapes, and
what stands on its surfaces. Must not know: scenes.
"""

import math
from functools import cache, lru_cache
from itertools import product

from companion.languages.values import Box, Pose
from companion.models import MODELS
from companion.world import geometry

# An object whose base is this close to a surface stands on it: poses are seen with some 4 mm error,
# and an object tilted by a degree or two stands a few mm higher; estimate.
TOUCH_M = 0.03

# Edge of a cell; estimate: some objects of a hand's size stand in it, and a table reaches over some
# twenty.
CELL_M = 0.25
# What is wider is compared with everything; estimate: the widest model is a table of 1.3 m by its
# diagonal.
WIDE_M = 4.0
# What is farther away is compared with everything; estimate: no room is so large, and rounding is
# far below ROUNDING_M.
FAR_M = 1e6
# Largest error of a quaternion's length; beyond it a pose is not rigid. Estimate: four digits are
# within.
UNIT = 1e-3
# Added to each side of a box: more than a quaternion within UNIT moves any point of a model
# (estimate).
ROUNDING_M = 0.01

Cells = frozenset[tuple[int, int]]


def cells(box: geometry.Bounds) -> Cells | None:
    """Return the cells that a box reaches, None where all objects are to be compared with it."""
    (x0, y0, _), (x1, y1, _) = box
    if not (x1 - x0 <= WIDE_M and y1 - y0 <= WIDE_M and abs(x0) + abs(y0) <= FAR_M):
        return None
    return frozenset(product(_steps(x0, x1), _steps(y0, y1)))


@lru_cache(maxsize=4096)  # estimate: the objects of some scenes
def cells_of(model: str, pose: Pose) -> Cells | None:
    """Return the cells that an object reaches: none if its model is not known, for nothing is known
    of it then.
    """
    box = extent(model, pose)
    return frozenset() if model not in MODELS else cells(box) if box is not None else None


def extent(model: str, pose: Pose) -> geometry.Bounds | None:
    """Return a box around all that an object reaches; None where its model is not known, or its
    pose is not rigid.
    """
    if model not in MODELS or not abs(math.hypot(*pose.quat_wxyz) - 1.0) <= UNIT:
        return None
    return geometry.bounds(_around(model), pose)


def _steps(low: float, high: float) -> range:
    return range(math.floor(low / CELL_M), math.floor(high / CELL_M) + 1)


@cache
def _around(model: str) -> Box:
    """Return a box around all that a model reaches, its base too, in its own frame."""
    known = MODELS[model]
    above = (
        Box((flat.along_x, flat.along_y, 2 * TOUCH_M), Pose(flat.centre)) for flat in known.surfaces
    )
    low, high = geometry.bounds_of((*known.shapes, *above), Pose((0.0, 0.0, 0.0)))
    x, y, z = (b - a + 2 * ROUNDING_M for a, b in zip(low, high, strict=True))
    a, b, c = ((a + b) / 2 for a, b in zip(low, high, strict=True))
    return Box((x, y, z), Pose((a, b, c)))

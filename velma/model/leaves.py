"""Leaves of cabinets: where they hang, and how far they open. Angles in rad, 0 closed; a cabinet stands upright."""

import math

from velma.model.numbers import objects

Vector = tuple[float, float, float]


def hanging(model: str, cabinet: Vector, yaw: float, angle: float) -> tuple[Vector, float]:
    """Return place [m] and yaw of a leaf that is open by `angle`, at a cabinet at this place with this yaw."""
    x, y, z = objects()[model]["hinge"]["xyz"]
    c, s = math.cos(yaw), math.sin(yaw)
    at = cabinet[0] + c * x - s * y, cabinet[1] + s * x + c * y, cabinet[2] + z
    return at, yaw + objects()[model]["opens"] * angle


def limits(model: str) -> tuple[float, float]:
    """Return the least and the most that a leaf opens."""
    least, most = objects()[model]["hinge"]["range"]
    return least, most

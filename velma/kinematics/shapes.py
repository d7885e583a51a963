"""Solid shapes for the collision world: anything with the fields of a box, a cylinder or a sphere.

The content languages have such classes of their own, which this package does not import; the three
classes here are for all others. A place is a `pin.SE3` or a pose with `xyz` and `quat_wxyz`.
"""

from dataclasses import dataclass, field
from typing import Any

import coal
import pinocchio as pin

from velma.errors import VelmaError


@dataclass(frozen=True)
class Box:
    """A box by its full edge lengths [m]; `at` is its centre in the frame of its thing."""

    size: tuple[float, float, float]
    at: Any = field(default_factory=pin.SE3.Identity)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along its own z axis, radius and length [m]; `at` is its centre in the frame of
    its thing.
    """

    radius: float
    length: float
    at: Any = field(default_factory=pin.SE3.Identity)


@dataclass(frozen=True)
class Sphere:
    """A sphere by its radius [m]; `at` is its centre in the frame of its thing."""

    radius: float
    at: Any = field(default_factory=pin.SE3.Identity)


class NoShape(VelmaError):
    """A shape of a thing is not a box, cylinder or sphere."""

    def __init__(self, found: object) -> None:
        self.found = found
        super().__init__(
            f"{found!r} is not a shape, expected size (box), radius and length (cylinder) or radius"
            " (sphere)"
        )


def solid(shape: Any) -> Any:
    """Return the shape as coal computes with it. Raises `NoShape`."""
    if hasattr(shape, "size"):
        return coal.Box(*shape.size)
    if hasattr(shape, "length"):
        return coal.Cylinder(shape.radius, shape.length)
    if hasattr(shape, "radius"):
        return coal.Sphere(shape.radius)
    raise NoShape(shape)


def nearer(one: Any, there: Any, other: Any, elsewhere: Any, margin: float) -> bool:
    """Whether two of coal's shapes at their transforms are at most the margin [m] apart."""
    request = coal.CollisionRequest()
    request.security_margin = request.distance_upper_bound = margin
    return bool(coal.collide(one, there, other, elsewhere, request, coal.CollisionResult()))


def distance(one: Any, there: Any, other: Any, elsewhere: Any) -> float:
    """Return the distance [m] of two of coal's shapes at their transforms, negative where they
    overlap.
    """
    found = coal.DistanceResult()
    coal.distance(one, there, other, elsewhere, coal.DistanceRequest(), found)
    return float(found.min_distance)

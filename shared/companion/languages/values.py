"""Values that several content languages share: sides, poses, shapes.

Units m and rad. A pose `T_A_B` is the frame B seen in the frame A; the world is `torso_base` (x
forward, y left, z up), as in the robot's own description. Nothing here knows a protocol or an
agent.
"""

import math
from enum import StrEnum
from typing import Annotated, NamedTuple

import msgspec

Vector = tuple[float, float, float]
Name = Annotated[str, msgspec.Meta(pattern=r"\A[!-~]{1,64}\Z")]
"""Name of an object: printable ASCII without blanks, short, since it becomes a part of the id of an
observation.
"""


class Within(NamedTuple):
    """The range of a number, as a note in its type. It is not checked where a message is read, but
    where it is acted on: a refusal can say more than that a message is not understood.
    """

    least: float
    most: float


class Side(StrEnum):
    """A hand with its arm."""

    LEFT = "left"
    RIGHT = "right"


class Pose(msgspec.Struct, frozen=True, array_like=True):
    """A rigid transform: translation [m] and unit quaternion, w first."""

    xyz: Vector
    quat_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


class Uncertainty(msgspec.Struct, frozen=True, array_like=True):
    """How far a seen pose may be off: the covariance of x, y, z in the world [m^2], its upper
    triangle row by row, and the variance of the rotation about the vertical [rad^2].
    """

    xyz: tuple[float, float, float, float, float, float]
    turn: float

    @property
    def deviation(self) -> float:
        """Root mean square of how far the place may be off [m]."""
        return math.sqrt(self.xyz[0] + self.xyz[3] + self.xyz[5])


class Box(msgspec.Struct, frozen=True, tag=True):
    """A box by its full edge lengths [m]; `at` is its centre in the object's frame."""

    size: Vector
    at: Pose = Pose((0.0, 0.0, 0.0))


class Cylinder(msgspec.Struct, frozen=True, tag=True):
    """A cylinder along its own z axis, radius and length [m]; `at` is its centre in the object's
    frame.
    """

    radius: float
    length: float
    at: Pose = Pose((0.0, 0.0, 0.0))


class Sphere(msgspec.Struct, frozen=True, tag=True):
    """A sphere by its radius [m]; `at` is its centre in the object's frame."""

    radius: float
    at: Pose = Pose((0.0, 0.0, 0.0))


Shape = Box | Cylinder | Sphere


class BodyPosture(msgspec.Struct, frozen=True):
    """Joint positions [rad] of the body: torso, right and left arm (7), head pan and tilt, fingers
    (3 and spread).
    """

    torso: float
    right_arm: tuple[float, ...]
    left_arm: tuple[float, ...]
    head: tuple[float, float]
    right_hand: tuple[float, ...]
    left_hand: tuple[float, ...]

"""Messages to and from the child process that renders. Light to import: the child needs nothing
else of ex.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray

from companion.languages.values import Uncertainty

SHRINK = 2
"""The robot's picture is smaller by this for people; estimate: 15 kB, and grains in the jar can be
told apart.
"""


class Show(msgspec.Struct, frozen=True, tag=True):
    """To the child: make pictures of this state, all coordinates of the world model as float64
    bytes -> Picture.
    """

    sim_time_s: float
    world: bytes


class See(msgspec.Struct, frozen=True, tag=True):
    """To the child: look at this state (float64 bytes), as look `number`, with the camera thought
    to be there.
    """

    number: int
    world: bytes
    rotation: tuple[float, ...]
    position: tuple[float, ...]


class SightedObject(msgspec.Struct, frozen=True):
    """A thing that was seen: rotation (9 numbers, row by row) and position in the world [m].

    `content`: mass of what is seen in it [kg]; None for a thing that cannot be looked into from
    there. `whole`: of all that is in it, else there may be more. `uncertainty`: of the pose.
    """

    name: str
    rotation: tuple[float, ...]
    position: tuple[float, ...]
    content: float | None = None
    whole: bool = True
    uncertainty: Uncertainty | None = None


class Saw(msgspec.Struct, frozen=True, tag=True):
    """From the child: the things that look `number` showed; none if the camera or the neck's
    encoders are faulty.

    `wrong`: fault of the picture (velma.eyes.health.Wrong), "" for none. `off`: error of torso and
    head [rad], or 0.
    """

    number: int
    things: tuple[SightedObject, ...]
    wrong: str = ""
    off: float = 0.0


class Blind(msgspec.Struct, frozen=True, tag=True):
    """To who asked for a look: no child sees, and why."""

    reason: str


def uncertainty(covariance: NDArray[np.float64]) -> Uncertainty:
    """Return the uncertainty of a pose by its covariance [m, rad].

    It is (4, 4), of x, y, z and the rotation about the vertical, or (6, 6), of x, y, z and the
    rotations about x, y, z.
    """
    xyz = covariance[:3, :3][np.triu_indices(3)]
    turn = covariance[3, 3] if len(covariance) == 4 else covariance[5, 5]
    return Uncertainty(tuple(_short(value) for value in xyz), _short(turn))  # type: ignore[arg-type]


def _short(value: float) -> float:
    return float(f"{value:.4g}")

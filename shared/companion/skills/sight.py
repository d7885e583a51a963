"""What ex sees, and by what: the interface of its eyes."""

from dataclasses import dataclass
from typing import Protocol

import pinocchio as pin

from companion.languages.values import Uncertainty
from velma.names import Array

Neck = tuple[float, float, float]
"""Measured torso, pan and tilt [rad]: the joints between the world and the camera."""


@dataclass(frozen=True)
class Sight:
    """A detected thing: its name, and its pose in the world with the error that eyes have.

    `content`: mass of what is seen in it [kg]; None where these eyes, or from there, do not tell. An arm before the
    opening hides some of it, and from low down its own wall does (not `whole`). `uncertainty`: of the pose; None where
    these eyes do not tell.
    """

    name: str
    T_world_object: pin.SE3
    content: float | None = None
    uncertainty: Uncertainty | None = None
    whole: bool = True


class Eye(Protocol):
    """Eyes in the robot's head. The simulator gives them its state in place of light.

    `wrong`: fault of the camera at the last look (velma.eyes.health.Wrong), "" for none; `off`: error of the measured
    torso or head by that look [rad], 0 for none. With a faulty camera or a large error, nothing is seen.
    """

    wrong: str
    off: float

    def look(self, world: Array, neck: Neck, /) -> list[Sight]:
        """Return what is seen in the state `world` (nq,). The robot is at rest."""
        ...

    def close(self) -> None:
        """End what the eyes started."""
        ...

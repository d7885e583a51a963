"""Small constructions with rigid transforms that the tasks share."""

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import pinocchio as pin

from velma.kinematics.robot import Robot


class PoseLike(Protocol):
    """A pose as it travels: translation [m] and quaternion, w first."""

    @property
    def xyz(self) -> Sequence[float]: ...

    @property
    def quat_wxyz(self) -> Sequence[float]: ...


def transform(pose: PoseLike) -> pin.SE3:
    """The transform of a pose; the quaternion is normalised."""
    w, x, y, z = pose.quat_wxyz
    quaternion = pin.Quaternion(w, x, y, z)
    quaternion.normalize()
    return pin.SE3(quaternion.matrix(), np.array(pose.xyz, dtype=float))


def xyz_quat(pose: pin.SE3) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Translation (3,) [m] and quaternion (4,), w first, of a transform."""
    x, y, z, i, j, k, w = (float(part) for part in pin.SE3ToXYZQUAT(pose))
    return (x, y, z), (w, i, j, k)


def standing(xyz: np.ndarray, yaw: float = 0.0) -> pin.SE3:
    """A frame that stands upright at `xyz` (3,) [m], turned by `yaw` [rad] about the vertical."""
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, yaw])), np.asarray(xyz, dtype=float))


def shifted(pose: pin.SE3, offset: np.ndarray) -> pin.SE3:
    """The same orientation, moved by `offset` (3,) [m] in the world frame."""
    return pin.SE3(pose.rotation, pose.translation + np.asarray(offset, dtype=float))


def heading(direction: np.ndarray) -> float:
    """Angle [rad] of the horizontal part of a direction (3,) from the x axis."""
    return math.atan2(direction[1], direction[0])


def tilt(pose: pin.SE3) -> float:
    """Angle [rad] between the frame's z axis and the vertical."""
    return math.acos(min(1.0, max(-1.0, pose.rotation[2, 2])))


def level(pose: pin.SE3) -> pin.SE3:
    """The upright frame at the same place with the nearest heading."""
    return standing(pose.translation, heading(pose.rotation[:, 0]))


def upright(robot: Robot, side: str, T_grip_object: pin.SE3, largest_tilt: float) -> Callable[[np.ndarray], bool]:
    """A condition on q (15,): the held object's axis stays within `largest_tilt` [rad] of the vertical."""
    least = math.cos(largest_tilt)
    axis = np.ascontiguousarray(T_grip_object.rotation[:, 2])

    def keep(q: np.ndarray) -> bool:
        return bool(robot.grip(q, side).rotation[2] @ axis > least)

    return keep

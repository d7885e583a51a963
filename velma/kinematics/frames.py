"""Small functions of rigid transforms. Knows no robot, scene or task.

`T_a_b` is the pose of frame b in frame a (pinocchio SE3); lengths in m, angles in rad. A pose
without a frame is in the world, whose z axis points up.
"""

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

_STANDS = math.cos(math.radians(15.0))
"""Of the axis of a thing to the vertical: farther tilted, grasps of one that stands do not fit
(trial: 90 deg off).
"""


class PoseLike(Protocol):
    """A pose as in communicates: translation [m] and quaternion, w first."""

    @property
    def xyz(self) -> Sequence[float]: ...

    @property
    def quat_wxyz(self) -> Sequence[float]: ...


def transform(pose: PoseLike | pin.SE3) -> pin.SE3:
    """Return the transform of a pose, its quaternion normalised; a transform is returned as it
    is.
    """
    if isinstance(pose, pin.SE3):
        return pose
    w, x, y, z = pose.quat_wxyz
    quaternion = pin.Quaternion(w, x, y, z)
    quaternion.normalize()
    return pin.SE3(quaternion.matrix(), np.array(pose.xyz, dtype=float))


def xyz_quat(pose: pin.SE3) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Return translation [m] and quaternion, w first, of a transform: the parts of a pose in
    communicates.
    """
    px, py, pz, x, y, z, w = (float(v) for v in pin.SE3ToXYZQUAT(pose))
    return (px, py, pz), (w, x, y, z)


def pose_of(rotation: Sequence[float], position: Sequence[float]) -> pin.SE3:
    """Return the transform of a rotation, nine numbers row by row, and a position [m]."""
    return pin.SE3(np.array(rotation, dtype=float).reshape(3, 3), np.array(position, dtype=float))


def standing(xyz: Any, yaw: float = 0.0) -> pin.SE3:
    """Return a frame that stands upright at `xyz` (3,) [m], turned by `yaw` [rad] about the
    vertical.
    """
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, yaw])), np.array(xyz, dtype=float))


def shifted(pose: pin.SE3, offset: Any) -> pin.SE3:
    """Return the same orientation, moved by `offset` (3,) [m] in the world frame."""
    return pin.SE3(pose.rotation, pose.translation + np.asarray(offset, dtype=float))


def heading(direction: Any) -> float:
    """Return angle [rad] of the horizontal part of a direction (3,) from the x axis."""
    return math.atan2(direction[1], direction[0])


def tilt(pose: pin.SE3) -> float:
    """Return angle [rad] between the frame's z axis and the vertical."""
    return math.acos(min(1.0, max(-1.0, pose.rotation[2, 2])))


def lies(pose: pin.SE3) -> bool:
    """Whether a thing is tilted so far that grasps of one that stands do not fit."""
    return bool(pose.rotation[2, 2] < _STANDS)


def upside_down(pose: pin.SE3) -> bool:
    """Whether a thing stands upside down."""
    return bool(pose.rotation[2, 2] < -_STANDS)


def level(pose: pin.SE3) -> pin.SE3:
    """Return the upright frame at the same place with the nearest heading."""
    return standing(pose.translation, heading(pose.rotation[:, 0]))

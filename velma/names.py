"""Velma's joints by name, in the one order that every array of this project uses.

The body is the torso, the right arm and the left arm (15 joints); head and hands are commanded
beside it. The numbers repeat velma/model/robot.yaml (sources there), so that limits are known
without reading a model; a test compares them, and `check_joints` compares the names whenever a
model is loaded. Knows neither Pinocchio nor MuJoCo.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = NDArray[np.intp]

SIDES = ("right", "left")
ARM_JOINTS = 7

BODY = (
    "torso_0_joint",
    *(f"right_arm_{k}_joint" for k in range(ARM_JOINTS)),
    *(f"left_arm_{k}_joint" for k in range(ARM_JOINTS)),
)
HEAD = ("head_pan_joint", "head_tilt_joint")

# Fingers as the maker numbers them: one and two oppose three; spread turns one and two about the
# palm.
FINGERS = ("One", "Two", "Three")
PROXIMAL = {side: tuple(f"{side}_HandFinger{f}KnuckleTwoJoint" for f in FINGERS) for side in SIDES}
DISTAL = {side: tuple(f"{side}_HandFinger{f}KnuckleThreeJoint" for f in FINGERS) for side in SIDES}
SPREAD = {
    side: tuple(f"{side}_HandFinger{f}KnuckleOneJoint" for f in ("One", "Two")) for side in SIDES
}

# 0.12 m in front of the palm, z is the approach axis
GRIP_BODY = {side: f"{side}_HandGripLink" for side in SIDES}
# wrist sensor; z is the approach axis of the grip
FT_BODY = {side: f"{side}_FtSensorLink" for side in SIDES}
CAMERA_BODY = "head_kinect_rgb_optical_frame"  # z forward, x right

TORSO = 0
ARM: dict[str, Columns] = {
    "right": np.arange(1, 8, dtype=np.intp),
    "left": np.arange(8, 15, dtype=np.intp),
}
COLUMNS: dict[str, Columns] = {
    side: np.concatenate((np.array([TORSO], dtype=np.intp), ARM[side])) for side in SIDES
}  # torso + one arm


def _frozen(*values: float) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


_RIGHT_START = (-0.3, -1.8, 1.25, 0.85, 0.0, -0.5, 0.0)
# Arms hang down; the left arm mirrors the right one with every sign changed.
START = _frozen(0.0, *_RIGHT_START, *(-x for x in _RIGHT_START))

_ARM_RANGE = (2.96706, 2.094395, 2.96706, 2.094395, 2.96706, 2.094395, 2.96706)
UPPER = _frozen(1.57, *_ARM_RANGE, *_ARM_RANGE)  # rad
LOWER = _frozen(*-UPPER)
_ARM_SPEED = (1.919862, 1.919862, 2.268928, 2.268928, 2.268928, 3.141593, 3.141593)
SPEED = _frozen(0.523599, *_ARM_SPEED, *_ARM_SPEED)  # rad/s
_ARM_TORQUE = (50.0, 50.0, 30.0, 20.0, 20.0, 10.0, 10.0)
# Nm: a larger command is refused by the lower level
TORQUE = _frozen(100.0, *_ARM_TORQUE, *_ARM_TORQUE)

HEAD_LOWER = _frozen(-1.57, -1.0)
HEAD_UPPER = _frozen(1.57, 1.3)
HEAD_SPEED = 1.04  # rad/s

FINGER_SPEED = 3.27  # rad/s, BHR
FINGER_UPPER = 2.443389  # rad, 140 deg
DISTAL_UPPER = 0.837733  # rad, 48 deg
SPREAD_UPPER = 3.141593  # rad

# Corners of the region of (wrist joint 5, wrist joint 6) without collision of hand and forearm,
# rad, shape (16, 2).
_RIGHT_POLYGON = np.array([
    (0.65, -2.9), (1.79, -2.91), (1.78, -1.43), (0.77, -1.39), (0.36, -1.0), (-0.15, -0.26),
    (0.35, 0.41), (0.8, 0.94), (1.8, 1.01), (1.81, 2.88), (-0.4, 2.89), (-0.81, 2.27),
    (-1.82, 2.29), (-1.83, -1.66), (-0.84, -1.73), (-0.42, -2.09),
])  # fmt: skip
WRIST_POLYGON: dict[str, Array] = {"right": _RIGHT_POLYGON, "left": -_RIGHT_POLYGON}


class JointsDiffer(ValueError):
    """A model does not have the joints, or not in the order, that the arrays of this project
    assume.
    """

    def __init__(self, model: str, found: Sequence[str], expected: Sequence[str]) -> None:
        self.model, self.found, self.expected = model, tuple(found), tuple(expected)
        first = next(
            (k for k, (a, b) in enumerate(zip(found, expected, strict=False)) if a != b),
            len(expected),
        )
        super().__init__(
            f"{model} has the joints {list(found)[first : first + 3]}... at index {first}"
            f" ({len(found)} in all), expected {list(expected)[first : first + 3]}..."
            f" ({len(expected)} in all); rebuild velma/model/robot.xml"
        )


def check_joints(model: str, found: Sequence[str], expected: Sequence[str] = BODY) -> None:
    """Raise `JointsDiffer` unless `found` are exactly the joints `expected`, in that order."""
    if tuple(found) != tuple(expected):
        raise JointsDiffer(model, found, expected)

"""Inverse kinematics of Velma's arm in closed form: all postures of a grip pose, for many elbows and torsos at once.

The arm (KUKA LWR) has a spherical shoulder, a hinge at the elbow and a spherical wrist. The elbow may turn about the
line from shoulder to wrist (the swivel angle), and each of the three parts has two solutions: 8 postures per swivel.
Lengths and placement are read from the model; NotSuchAnArm for another kind of arm.

    shoulder R(q0, q1, q2) = Rz Ry Rz,  elbow Ry(-q3),  wrist R(q4, q5, q6) = Rz Ry Rz
"""

import ctypes
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from velma import names
from velma.compiled import library
from velma.kinematics.robot import Robot
from velma.names import Array, Columns

# Signs of elbow, shoulder and wrist: one row for each branch.
BRANCHES = np.array(list(product((1.0, -1.0), repeat=3)))


class NotSuchAnArm(ValueError):
    """The arm of the model is not spherical, hinge, spherical along one line, so the closed form does not hold."""

    def __init__(self, side: str, joint: str, found: Any) -> None:
        self.side, self.joint, self.found = side, joint, found
        super().__init__(f"the {side} arm has {joint} at {found}, expected on the z axis of the link before, unturned")


def _zyz(rotation: Array, sign: Array) -> tuple[Array, Array, Array]:
    """Return angles with Rz(a) Ry(b) Rz(c) = rotation (n, 3, 3), b of the given sign (n,)."""
    b = sign * np.arccos(np.clip(rotation[:, 2, 2], -1.0, 1.0))
    a = np.arctan2(sign * rotation[:, 1, 2], sign * rotation[:, 0, 2])
    c = np.arctan2(sign * rotation[:, 2, 1], -sign * rotation[:, 2, 0])
    return a, b, c


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (n, 3); numpy's own takes twice as long for some dozens of them (measured)."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=1)


class _Arm(ctypes.Structure):
    """As in arm.c."""

    _fields_ = (("upper", ctypes.c_double), ("fore", ctypes.c_double), ("shoulder", ctypes.c_double * 12))


class _Wanted(ctypes.Structure):
    """As in arm.c."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("lower", "upper")),
        *((name, ctypes.c_double) for name in ("margin", "torso")),
        *((name, ctypes.c_int) for name in ("corners", "column")),
        ("polygon", ctypes.c_void_p),
    )


class Wanted:
    """In which postures a motion may end: `margin` [rad] inside the limits (7,), the last two joints in `polygon`
    (corners, 2), the torso within `torso` [rad] of ahead; `column`: the first of the arm in a posture (15,).
    """

    def __init__(self, lower: Array, upper: Array, margin: float, torso: float, polygon: Array, column: int) -> None:
        self._arrays = [np.array(one, dtype=np.float64) for one in (lower, upper, polygon)]
        pointers = [array.ctypes.data for array in self._arrays]
        self.itself = _Wanted(pointers[0], pointers[1], margin, torso, len(polygon), column, pointers[2])


def _numbers(pose: Any) -> Any:
    """A pose as arm.c takes it."""
    return (ctypes.c_double * 12)(*pose.rotation.ravel(), *pose.translation)


class ArmGeometry:
    """Lengths and frames of one arm, and the postures that bring its grip to a pose."""

    def __init__(self, robot: Robot, side: str) -> None:
        model = robot.model
        first = int(names.ARM[side][0]) + 1
        for k in range(first + 1, first + 7):
            placed = model.jointPlacements[k]
            off_axis = np.abs(placed.translation[:2]).max() + np.abs(placed.rotation - np.eye(3)).max()
            if off_axis > 1e-6:
                raise NotSuchAnArm(side, model.names[k], placed)
        z = [model.jointPlacements[k].translation[2] for k in range(first, first + 7)]
        self.upper, self.fore = z[2] + z[3], z[4] + z[5]  # shoulder to elbow, elbow to wrist [m]
        self.T_torso_shoulder = model.jointPlacements[first] * pin.SE3(np.eye(3), np.array([0.0, 0.0, z[1]]))
        self.T_world_torso = model.jointPlacements[1]
        hand = model.frames[robot.frame[side]].placement  # last joint to grip
        self.T_grip_wrist = hand.inverse() * pin.SE3(np.eye(3), np.array([0.0, 0.0, -z[6]]))
        built = library()
        self._compiled: Any = built.arm_postures if built is not None else None
        self._comfortable: Any = built.arm_comfortable if built is not None else None
        self._arm = _Arm(self.upper, self.fore, _numbers(self.T_torso_shoulder))

    def postures(self, target: Any, torso: Array, swivel: Array) -> tuple[Array, Columns]:
        """Return the 8 postures of each pair (torso, swivel), (n,) [rad] each, the grip at `target` (T_world_grip).

        Returns torso + arm angles (m, 8) and the index (m,) of the pair of each; pairs out of reach have none.
        Limits are not checked.
        """
        wrist = self.T_world_torso.inverse() * target * self.T_grip_wrist
        if self._compiled is not None:
            return self._by_library(wrist, torso, swivel)
        cos, sin = np.cos(torso), np.sin(torso)
        unturn = np.zeros((len(torso), 3, 3))
        unturn[:, 0, 0], unturn[:, 0, 1], unturn[:, 1, 0], unturn[:, 1, 1], unturn[:, 2, 2] = cos, sin, -sin, cos, 1.0
        to_shoulder = self.T_torso_shoulder.rotation.T
        way = (unturn @ wrist.translation - self.T_torso_shoulder.translation) @ to_shoulder.T
        goal = to_shoulder @ unturn @ wrist.rotation
        reach = np.linalg.norm(way, axis=1)
        ok = np.flatnonzero((reach < self.upper + self.fore - 1e-6) & (reach > abs(self.upper - self.fore) + 1e-6))
        index = np.repeat(ok, len(BRANCHES))
        elbow, shoulder_sign, wrist_sign = np.tile(BRANCHES, (len(ok), 1)).T
        upper_axis, fore_axis, q3 = self._elbow(way[ok], reach[ok], swivel[ok])
        upper_axis, fore_axis, q3 = (np.repeat(x, len(BRANCHES), axis=0) for x in (upper_axis, fore_axis, q3))
        q3 = q3 * elbow
        x_axis = (np.cos(q3)[:, None] * upper_axis - fore_axis) / np.sin(q3)[:, None]
        upper_frame = np.stack((x_axis, _cross(upper_axis, x_axis), upper_axis), axis=2)
        y_axis = upper_frame[:, :, 1]
        fore_frame = np.stack((_cross(y_axis, fore_axis), y_axis, fore_axis), axis=2)
        q0, q1, q2 = _zyz(upper_frame, shoulder_sign)
        q4, q5, q6 = _zyz(fore_frame.transpose(0, 2, 1) @ goal[index], wrist_sign)
        return np.stack((torso[index], q0, q1, q2, q3, q4, q5, q6), axis=1), index

    def _by_library(self, wrist: Any, torso: Array, swivel: Array) -> tuple[Array, Columns]:
        pairs = np.array((torso, swivel), dtype=np.float64)
        most = len(BRANCHES) * pairs.shape[1]
        found, index = np.empty((most, len(names.ARM[names.SIDES[0]]) + 1)), np.empty(most, dtype=np.int32)
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*pairs, found, index)]
        count = self._compiled(ctypes.byref(self._arm), _numbers(wrist), ctypes.c_int(pairs.shape[1]), *pointers)
        return found[:count], index[:count]

    def comfortable(self, target: Any, torso: Array, swivel: Array, wanted: Wanted, q: Array) -> Array | None:
        """Return the postures (m, 15) of `postures` in which a motion may end, else as q; None without a library."""
        if self._comfortable is None:
            return None
        wrist = self.T_world_torso.inverse() * target * self.T_grip_wrist
        given = np.array((torso, swivel), dtype=np.float64), np.array(q, dtype=np.float64)
        found = np.empty((len(BRANCHES) * len(torso), len(q)))
        (torsos, swivels), other = given
        arrays = [ctypes.c_void_p(array.ctypes.data) for array in (torsos, swivels, other, found)]
        which = ctypes.byref(self._arm), ctypes.byref(wanted.itself)
        return found[: self._comfortable(*which, _numbers(wrist), ctypes.c_int(len(torso)), *arrays)]

    def _elbow(self, way: Array, reach: Array, swivel: Array) -> tuple[Array, Array, Array]:
        """Return directions of upper arm and forearm (n, 3) in the shoulder frame, and elbow angle (n,), positive."""
        a, b = self.upper, self.fore
        along = way / reach[:, None]
        side = _cross(along, np.array([[0.0, 0.0, 1.0]]))
        thin = np.linalg.norm(side, axis=1) < 1e-6  # wrist straight above the shoulder: any reference will do
        side[thin] = np.array([1.0, 0.0, 0.0])
        side /= np.linalg.norm(side, axis=1)[:, None]
        outwards = np.cos(swivel)[:, None] * side + np.sin(swivel)[:, None] * _cross(along, side)
        cos = (a * a + reach * reach - b * b) / (2.0 * a * reach)
        upper_axis = cos[:, None] * along + np.sqrt(1.0 - cos * cos)[:, None] * outwards
        fore_axis = (way - a * upper_axis) / b
        return upper_axis, fore_axis, np.arccos((reach * reach - a * a - b * b) / (2.0 * a * b))

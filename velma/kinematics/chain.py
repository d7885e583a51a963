"""Torso and one arm as chain.c of velma.compiled computes with them. Must not know: scenes, sampling, comfort."""

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from velma.compiled import library
from velma.names import Array

_MOST = 16  # joints; as in chain.c


class _Chain(ctypes.Structure):
    """As in chain.c."""

    _fields_ = (("joints", ctypes.c_int), *((name, ctypes.c_void_p) for name in ("placed", "axis", "column")))


class _Limits(ctypes.Structure):
    """As in chain.c."""

    _fields_ = (
        ("iterations", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("near", "turned", "damping", "largest_turn", "largest_error")),
        *((name, ctypes.c_void_p) for name in ("lower", "upper", "moves")),
    )


class Limits:
    """Of `Chain.solve`: iterations, tolerances [m], [rad], damping, steps [rad] and errors at most, joints' limits.

    `lower`, `upper`: (15,) [rad]; `columns`: those of a posture that may move.
    """

    def __init__(self, numbers: Sequence[float], lower: Array, upper: Array, columns: Any) -> None:
        moves = np.zeros(len(lower), dtype=np.uint8)
        moves[columns] = 1
        self._arrays = np.array(lower), np.array(upper), moves
        self.itself = _Limits(*numbers, *(array.ctypes.data for array in self._arrays))


class Chain:
    """The hinges from the world to a frame; postures are (15,) [rad]."""

    def __init__(self, built: ctypes.CDLL, model: Any, frame: int) -> None:
        joints: list[int] = []
        joint = model.frames[frame].parentJoint
        while joint:
            joints.insert(0, joint)
            joint = model.parents[joint]
        placed = [*(model.jointPlacements[k] for k in joints), model.frames[frame].placement]
        self._arrays = (
            np.array([[*pose.rotation.ravel(), *pose.translation] for pose in placed]),
            np.array([_axis(model.joints[k]) for k in joints]),
            np.array([model.joints[k].idx_q for k in joints], dtype=np.int32),
        )
        if len(joints) > _MOST:
            raise ValueError(f"a chain of {len(joints)} joints, expected at most {_MOST} (velma/compiled/chain.c)")
        self._chain = _Chain(len(joints), *(array.ctypes.data for array in self._arrays))
        self._itself = ctypes.byref(self._chain)
        self._track, self._solve = built.chain_track, built.chain_solve
        self._track.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p]
        self._solve.argtypes = [ctypes.c_void_p] * 4
        self._track.restype, self._solve.restype = None, ctypes.c_int

    def track(self, postures: Array) -> Array:
        """Return the positions (n, 3) [m] of the frame in postures (n, 15)."""
        given, places = np.ascontiguousarray(postures, dtype=np.float64), np.empty((len(postures), 3))
        self._track(self._itself, given.ctypes.data, len(given), places.ctypes.data)
        return places

    def solve(self, target: Any, q: Array, limits: Limits) -> Array | None:
        """Return a posture near q with the frame at `target`; None if the iterations do not get there."""
        found = np.array(q, dtype=np.float64)
        goal = (ctypes.c_double * 12)(*target.rotation.ravel(), *target.translation)
        return found if self._solve(self._itself, ctypes.byref(limits.itself), goal, found.ctypes.data) else None


def chain(model: Any, frame: int) -> Chain | None:
    """Return the chain to a frame of a model whose joints are hinges, or None without a library."""
    built = library()
    return Chain(built, model, frame) if built is not None else None


def _axis(joint: Any) -> Array:
    """The axis (3,) of a hinge in its own frame."""
    data = joint.createData()
    joint.calc(data, np.zeros(joint.idx_q + joint.nq))
    return np.asarray(data.S).ravel()[3:]

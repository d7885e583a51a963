"""Checks of the collision world by the library of velma.compiled: where the shapes are, and which pairs are too near.

Pairs of spheres, of a sphere and a box, and most of boxes are decided in C, the others by coal. Must not know: things,
hands.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np

from velma.kinematics.chain import axis
from velma.kinematics.shapes import nearer
from velma.names import Array, Columns

_KINDS = {coal.Sphere: 1, coal.Box: 2}
_MOST = 64  # joints; as in near.c


class _Near(ctypes.Structure):
    """As in near.c."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("joints", "shapes", "bodies")),
        *((name, ctypes.c_void_p) for name in ("parent", "placed", "axis", "column", "angle", "used", "joint")),
        *((name, ctypes.c_void_p) for name in ("on", "mounted", "moved", "at", "half", "kind", "body")),
        *((name, ctypes.c_void_p) for name in ("box", "body_box")),
    )


class _Among(ctypes.Structure):
    """As in near.c."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("pairs", "body_pairs")),
        *((name, ctypes.c_void_p) for name in ("first_body", "second_body", "start", "first", "second", "number")),
        ("found", ctypes.c_void_p),
    )


@dataclass(frozen=True)
class Tree:
    """The robot's hinges as C takes them: `parent` (n,), `placed` (n, 12), `axis` (n, 3), and `column` (15,), the joint
    of each column of a posture. Joints are those of Pinocchio but the universe, numbered from 0.
    """

    parent: Array
    placed: Array
    axis: Array
    column: Array


def tree(model: Any, column: Columns) -> Tree:
    """Return the tree of a model whose joints are hinges."""
    joints = range(1, model.njoints)
    if len(joints) > _MOST:
        raise ValueError(f"a robot of {len(joints)} joints, expected at most {_MOST} (velma/compiled/near.c)")
    return Tree(
        np.array([model.parents[k] - 1 for k in joints], dtype=np.int32),
        np.array([numbers(model.jointPlacements[k]) for k in joints]),
        np.array([axis(model.joints[k]) for k in joints]),
        column.astype(np.int32),
    )


def numbers(pose: Any) -> Array:
    """Return a pose as C takes it (12,): rotation by rows, then position [m]."""
    return np.concatenate((pose.rotation.ravel(), pose.translation))


@dataclass(frozen=True)
class Among:
    """Some of the pairs, as near.c wants them. It reads the arrays, so they are kept as long as this."""

    itself: Any
    found: Any
    arrays: tuple[Any, ...]


class Near:
    """Which of some shapes may be nearer than a margin in a posture (15,); `angle` (n,) [rad]: of all joints."""

    def __init__(
        self, built: ctypes.CDLL, tree: Tree, angle: Array, solids: Sequence[Any], bodies: Columns, pairs: Columns
    ) -> None:
        """Of coal's shapes, of bodies numbered from 0 (n,), the pairs (2, m)."""
        count, most = len(solids), int(bodies.max()) + 1
        self.solids, self.pairs = solids, pairs
        self._on, self._mounted = np.full(count, -1, dtype=np.int32), np.zeros((count, 12))
        self._moved, self._at = np.ones(count, dtype=np.uint8), np.empty((count, 12))
        half = np.array([_half(shape) for shape in solids])
        kind = np.array([_KINDS.get(type(shape), 0) for shape in solids], dtype=np.uint8)
        joints = len(tree.parent)
        self._kept = (
            *(tree.parent, tree.placed, tree.axis, tree.column, angle, np.full(joints, np.nan), np.empty((joints, 12))),
            *(self._on, self._mounted, self._moved, self._at, half, kind, bodies.astype(np.int32)),
            *(np.empty((count, 6)), np.empty((most, 6))),
        )
        near = _Near(joints, count, most, *(array.ctypes.data for array in self._kept))
        self._itself, self._left = ctypes.byref(near), ctypes.c_int()
        self._given = np.empty(15)
        self._one = self._given.ctypes.data, 1, 1, ctypes.byref(self._left)  # to ask numpy for an address takes a while
        self._first, self._pairs = built.near_first, built.near_pairs
        address, number = ctypes.c_void_p, ctypes.c_double
        self._first.argtypes = [address, address, number, address, ctypes.c_int, ctypes.c_int, address]
        self._pairs.argtypes = [address, address, number, address]
        of = np.sort(bodies[pairs], axis=0)
        order = np.lexsort(of)
        self._sorted = np.concatenate((of, pairs, [np.arange(len(order))])).astype(np.int32)[:, order]

    def among(self, wanted: Array) -> Among:
        """Return those of the pairs that are `wanted` (m,)."""
        one_body, other_body, *pairs = self._sorted[:, wanted[self._sorted[-1]]]
        begins = np.ones(len(one_body), dtype=bool)
        begins[1:] = (one_body[1:] != one_body[:-1]) | (other_body[1:] != other_body[:-1])
        start = np.append(np.flatnonzero(begins), len(begins)).astype(np.int32)
        found = np.empty(len(begins) + len(start), dtype=np.int32)
        arrays = (one_body[begins], other_body[begins], start, *map(np.ascontiguousarray, pairs), found)
        among = _Among(len(begins), len(start) - 1, *(array.ctypes.data for array in arrays))
        return Among(ctypes.byref(among), found, arrays)

    def mount(self, shape: int, joint: int, pose: Any) -> None:
        """Fix a shape to a joint of Pinocchio's, 0 the world, at T_joint_shape."""
        self._on[shape], self._mounted[shape], self._moved[shape] = joint - 1, numbers(pose), 1

    def at(self, shape: int) -> Any:
        """Return T_world_shape, as coal has it, in the posture looked at last."""
        pose = self._at[shape]
        return coal.Transform3s(pose[:9].reshape(3, 3), pose[9:])

    # -- checks ----------------------------------------------------------------------------------------------------
    def free(self, among: Among, margin: float, q: Array) -> bool:
        """Whether no pair is nearer than the margin [m]; False where an angle is not finite."""
        self._given[:] = q
        self._first(self._itself, among.itself, margin, *self._one)
        left = self._left.value
        return left == 0 or (left > 0 and not self._meets(among, margin))

    def first(self, among: Among, margin: float, postures: Array, free: bool) -> int:
        """Return the number of the first posture (n, 15) that is free, or is not; n if there is none."""
        given, left = np.ascontiguousarray(postures, dtype=np.float64), self._left
        k = 0
        step, at = given.strides[0], given.ctypes.data
        while k < len(given):
            rest = at + k * step, len(given) - k, not free, ctypes.byref(left)
            k += int(self._first(self._itself, among.itself, margin, *rest))
            if k == len(given):
                return k
            if (left.value == 0 or (left.value > 0 and not self._meets(among, margin))) is free:
                return k
            k += 1
        return k

    def close(self, among: Among, margin: float, q: Array) -> list[int]:
        """Return the numbers of pairs that may be nearer than the margin, in order."""
        self._given[:] = q
        count = self._pairs(self._itself, among.itself, margin, self._given.ctypes.data)
        return sorted(among.found[:count].tolist())

    def _meets(self, among: Among, margin: float) -> bool:
        """Whether one of the pairs that C left meets."""
        for k in among.found[: self._left.value].tolist():
            a, b = (int(shape) for shape in self.pairs[:, k])
            if nearer(self.solids[a], self.at(a), self.solids[b], self.at(b), margin):
                return True
        return False


def _half(shape: Any) -> Array:
    """Half edges [m] of the box around a shape of coal in its own frame."""
    match shape:
        case coal.Sphere():
            return np.full(3, shape.radius)
        case coal.Box():
            return np.asarray(shape.halfSide)
        case _:
            shape.computeLocalAABB()
            return np.asarray(np.maximum(np.abs(shape.aabb_local.max_), np.abs(shape.aabb_local.min_)))

"""The cull before exact checks of a collision world, by the library of velma.compiled: which pairs may be too near.

It reads the shapes' placements where Pinocchio keeps them, and decides pairs of spheres and of a sphere and a box
itself. Must not know: things, hands, the robot.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np

from velma.compiled import library
from velma.names import Array

_KINDS = {coal.Sphere: 1, coal.Box: 2}
_FIXED = ("at", "half", "kind", "body", "box", "body_box")
_CHOSEN = ("first_body", "second_body", "start", "first", "second", "number", "found")


class _Near(ctypes.Structure):
    """As in near.c."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("shapes", "bodies", "pairs", "body_pairs")),
        *((name, ctypes.c_void_p) for name in (*_FIXED, *_CHOSEN)),
    )


@dataclass(frozen=True)
class Among:
    """Some of the pairs, as near.c wants them. It reads the arrays, so they are kept as long as this."""

    call: Any
    itself: Any
    found: Any
    arrays: tuple[Any, ...]

    def left(self, margin: float) -> list[int] | None:
        """Return the numbers of pairs that only an exact check can decide; None if two shapes are too near anyway."""
        count = self.call(self.itself, margin)
        return None if count < 0 else list(self.found[:count].tolist())


class Near:
    """Which of some shapes may be nearer than a margin, as they are placed at the moment."""

    def __init__(self, call: Any, at: Array, shapes: Sequence[Any], bodies: Array, pairs: Array) -> None:
        """Of geometry objects at `at` (n, 12), of bodies numbered from 0 (n,), the pairs (2, m)."""
        self._call, count = call, int(bodies.max()) + 1
        half = np.array([_half(shape.geometry) for shape in shapes])
        kind = np.array([_KINDS.get(type(shape.geometry), 0) for shape in shapes], dtype=np.uint8)
        self._fixed = (at, half, kind, bodies.astype(np.int32), np.empty((len(shapes), 6)), np.empty((count, 6)))
        self._counts = len(shapes), count
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
        chosen = (one_body[begins], other_body[begins], start, *map(np.ascontiguousarray, pairs), found)
        arrays = (*self._fixed, *chosen)
        near = _Near(*self._counts, len(begins), len(start) - 1, *(array.ctypes.data for array in arrays))
        return Among(self._call, ctypes.byref(near), found, arrays)


def near(shapes: Any, placed: Any, groups: Sequence[str], pairs: Array) -> Near | None:
    """Return the cull of a geometry model and its data, its shapes grouped, with pairs (2, m); None without a library.

    None, too, where Pinocchio keeps placements otherwise than as rotation by columns and position, one after the other.
    """
    built = library()
    if built is None:
        return None
    objects, first, last = shapes.geometryObjects, placed.oMg[0], placed.oMg[len(groups) - 1]
    memory = (ctypes.c_double * (12 * len(groups))).from_address(_address(first.rotation))
    at = np.ctypeslib.as_array(memory).reshape(len(groups), 12)
    if (_address(last.rotation), _address(last.translation)) != (at[-1].ctypes.data, at[-1, 9:].ctypes.data):
        return None
    numbers: dict[tuple[int, str], int] = {}
    keys = [(shape.parentJoint, group) for shape, group in zip(objects, groups, strict=True)]
    bodies = np.array([numbers.setdefault(key, len(numbers)) for key in keys])
    call = built.near_pairs
    call.argtypes, call.restype = [ctypes.c_void_p, ctypes.c_double], ctypes.c_int
    return Near(call, at, objects, bodies, pairs)


def _address(array: Array) -> int:
    return int(array.__array_interface__["data"][0])


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

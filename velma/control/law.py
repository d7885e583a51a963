"""Parts of `velma.control.cartesian` as torque.c and error.c of velma.compiled compute them."""

import ctypes
from typing import Any

import numpy as np

from velma.compiled import library
from velma.control.dynamics import Array, Terms
from velma.control.record import Record

_LAW = {
    "mass": (15, 15), "jacobian": (12, 15), "error": (12,), "slip": (15,), "stray": (15,), "wrench": (12,),
    "stiffness": (12,), "posture_stiffness": (15,), "posture_damping": (15,), "regularisation": (1,),
    "twice_ratio": (1,), "damping": (12, 12), "inertia": (12, 12), "through": (12, 15), "torque": (15,),
}  # fmt: skip
"""As in torque.c."""
_ERROR = {
    "rotation": (2, 3, 3), "position": (2, 3), "goal_rotation": (2, 3, 3), "goal_position": (2, 3), "error": (12,),
}  # fmt: skip
"""As in error.c."""
_NO_INVERSE = "the mass matrix of the body or of its hands is not positive definite"


class Law:
    """The torque law of both hands: what it acts on, its three calls."""

    def __init__(self, built: ctypes.CDLL, record: Record) -> None:
        self._record, self._part, self._at = record, record.part, record.at
        self._inertia, self._design, self._torque = built.law_inertia, built.law_damping, built.law_torque
        self._inertia.restype, self._design.restype, self._torque.restype = ctypes.c_int, ctypes.c_int, None

    def __reduce__(self) -> tuple[Any, ...]:
        return law, (self._record,)

    def set(self, **parts: Array | float) -> None:
        """Write parts that stay: stiffness, posture_stiffness, posture_damping, regularisation, twice_ratio."""
        for name, value in parts.items():
            self._part[name][:] = value

    def inertia(self, terms: Terms, error: Array, slip: Array, stray: Array, wrench: Array) -> None:
        """Take what the law acts on; compute Lam (12, 12). Raise LinAlgError, as numpy's inv does."""
        part = self._part
        part["mass"][:], part["jacobian"][:] = terms.mass, terms.jacobian
        part["error"][:], part["slip"][:], part["stray"][:], part["wrench"][:] = error, slip, stray, wrench
        if not self._inertia(self._at):
            raise np.linalg.LinAlgError(_NO_INVERSE)

    def damping(self) -> Array:
        """Return D (12, 12) for Lam as it is now. Raise LinAlgError, as numpy's cholesky does."""
        if not self._design(self._at):
            raise np.linalg.LinAlgError(_NO_INVERSE)
        return self._part["damping"].copy()

    def torque(self, damping: Array) -> Array:
        """Return tau (15,) for the damping D (12, 12)."""
        self._part["damping"][:] = damping
        self._torque(self._at)
        return self._part["torque"].copy()


class Error:
    """The error of both hands: call it with terms and goals."""

    def __init__(self, built: ctypes.CDLL, record: Record) -> None:
        self._record, self._part, self._at = record, record.part, record.at
        self._error = built.task_error
        self._error.restype = None

    def __reduce__(self) -> tuple[Any, ...]:
        return error, (self._record,)

    def __call__(self, terms: Terms, goal_rotation: Array, goal_position: Array) -> Array:
        """Return e (12,) [m, rad], for goals (2, 3, 3) and (2, 3) [m]."""
        part = self._part
        part["rotation"][:], part["position"][:] = terms.rotation, terms.position
        part["goal_rotation"][:], part["goal_position"][:] = goal_rotation, goal_position
        self._error(self._at)
        return part["error"].copy()


def law(record: Record | None = None) -> Law | None:
    """Return a law with this record or an empty one, or None without a library."""
    built = library()
    return Law(built, record or Record(_LAW)) if built is not None else None


def error(record: Record | None = None) -> Error | None:
    """Return an error with this record or an empty one, or None without a library."""
    built = library()
    return Error(built, record or Record(_ERROR)) if built is not None else None

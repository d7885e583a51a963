"""The torque law of both hands as torque.c of velma.compiled computes it; `velma.control.cartesian` says what it is."""

import ctypes
from typing import Any

import numpy as np

from velma.compiled import library
from velma.control.dynamics import Array, Terms

_SHAPES = {
    "mass": (15, 15), "jacobian": (12, 15), "error": (12,), "slip": (15,), "stray": (15,), "wrench": (12,),
    "stiffness": (12,), "damping": (12, 12), "posture_stiffness": (15,), "posture_damping": (15,),
    "regularisation": (1,), "inertia": (12, 12), "through": (12, 15), "torque": (15,),
}  # fmt: skip
_LAW = np.dtype([(name, np.float64, shape) for name, shape in _SHAPES.items()])
"""As in torque.c."""


class Law:
    """The memory that the C code reads and writes, its parts by name, and its two calls."""

    def __init__(self, built: ctypes.CDLL, memory: Any) -> None:
        self._memory = memory
        self._part: dict[str, Array] = {name: memory[name] for name in _SHAPES}
        self._at = ctypes.c_void_p(memory.ctypes.data)
        self._inertia, self._torque = built.law_inertia, built.law_torque
        self._inertia.restype, self._torque.restype = ctypes.c_int, None

    def __reduce__(self) -> tuple[Any, ...]:
        return law, (self._memory.copy(),)

    def set(self, **parts: Array | float) -> None:
        """Write parts that stay: stiffness, posture_stiffness, posture_damping, regularisation."""
        for name, value in parts.items():
            self._part[name][:] = value

    def inertia(self, terms: Terms, error: Array, slip: Array, stray: Array, wrench: Array) -> Array:
        """Take what the law acts on; return Lam (12, 12). Raise LinAlgError, as numpy's inv does."""
        part = self._part
        part["mass"][:], part["jacobian"][:] = terms.mass, terms.jacobian
        part["error"][:], part["slip"][:], part["stray"][:], part["wrench"][:] = error, slip, stray, wrench
        if not self._inertia(self._at):
            raise np.linalg.LinAlgError("the mass matrix of the body or of its hands is not positive definite")
        return part["inertia"]

    def torque(self, damping: Array) -> Array:
        """Return tau (15,) for the damping D (12, 12)."""
        self._part["damping"][:] = damping
        self._torque(self._at)
        return self._part["torque"].copy()


def law(memory: Any = None) -> Law | None:
    """Return a law with this memory or an empty one, or None without a library."""
    built = library()
    return Law(built, np.zeros((), _LAW) if memory is None else memory) if built is not None else None

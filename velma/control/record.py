"""Memory that C code of velma.compiled and numpy read and write: a struct of doubles, its parts by
name.
"""

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from velma.names import Array

Shapes = Mapping[str, tuple[int, ...]]


class Record:
    """`values`: all of it; `part`: arrays of these shapes, in the order of the C struct; `at`: its
    address.
    """

    def __init__(self, shapes: Shapes, values: Any = None) -> None:
        """`values`: of another record of these shapes, which are taken over; None: zeros."""
        kind = np.dtype([(name, np.float64, shape) for name, shape in shapes.items()])
        self._shapes = shapes
        self.values: Any = np.zeros((), kind) if values is None else values
        self.part: dict[str, Array] = {name: self.values[name] for name in shapes}
        self.at = ctypes.c_void_p(self.values.ctypes.data)

    def take(self, saved: bytes) -> None:
        """Take the bytes of another record of these shapes."""
        self.values[...] = np.frombuffer(saved, dtype=self.values.dtype).reshape(())

    def __reduce__(self) -> tuple[Any, ...]:
        return Record, (self._shapes, self.values.copy())

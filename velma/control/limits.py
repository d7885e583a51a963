"""Limits of Velma's lower level: a larger command makes it fall into damping (velma_system,
common_predicates).
"""

import numpy as np
from numpy.typing import NDArray

from velma.names import TORQUE

Array = NDArray[np.float64]

_MOST = tuple(TORQUE.tolist())


def within(x: Array, low: Array | float, high: Array | float) -> Array:
    """Return x cut to the range, element by element: np.clip takes three times as long on six
    numbers (measured).
    """
    return np.asarray(np.minimum(np.maximum(x, low), high))


def accepted(tau: Array) -> Array:
    """Return tau (15,) Nm cut to the accepted range, joint by joint."""
    return within(tau, -TORQUE, TORQUE)


def is_accepted(tau: Array) -> bool:
    """Whether a torque is finite and within what the lower level takes."""
    return all(-most <= one <= most for one, most in zip(tau.tolist(), _MOST, strict=True))

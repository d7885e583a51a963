"""Limits of Velma's lower level: a larger command makes it fall into damping (velma_system, common_predicates)."""

import numpy as np
from numpy.typing import NDArray

from velma.names import LOWER, TORQUE, UPPER

Array = NDArray[np.float64]


def accepted(tau: Array) -> Array:
    """Return tau (15,) Nm cut to the accepted range, joint by joint."""
    return np.asarray(np.clip(tau, -TORQUE, TORQUE))


def is_accepted(tau: Array) -> bool:
    """Whether a torque is finite and within what the lower level takes."""
    return bool((np.abs(tau) <= TORQUE).all())


def within(q: Array, margin: float = 0.0) -> bool:
    """Whether every row of q (..., 15) rad is at least `margin` inside the joint limits."""
    return bool(((q >= LOWER + margin) & (q <= UPPER - margin)).all())

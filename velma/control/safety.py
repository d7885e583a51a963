"""The limits of Velma's lower level, and the command that is safe within them.

A larger torque makes the lower level fall into damping (velma_system, common_predicates). The safe
command is viscous friction in every joint and nothing else (velma_core_ve_body, safe state):

    tau = -d v

It needs no model and no set-point, so it works when everything else has failed; it only removes
energy.
"""

import numpy as np
from numpy.typing import NDArray

from velma.names import TORQUE

Array = NDArray[np.float64]

_MOST = tuple(TORQUE.tolist())
_ARM = (10.0, 10.0, 5.0, 5.0, 2.0, 1.0, 1.0)
VISCOSITY = np.array([20.0, *_ARM, *_ARM])  # Nms/rad, VS
# VS: the least number of cycles in the safe state before a command may end it.
DWELL_CYCLES = 500
FASTEST = 100.0  # rad/s; estimate: 50 times the fastest joint; a larger speed is a sensor fault


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


def damping_torque(v: Array) -> Array:
    """Return tau (15,) for speeds v (15,) rad/s, inside the accepted torques.

    A speed that is not a number, or beyond FASTEST, gets no torque: the joint may be at rest.
    """
    known = np.where(np.abs(v) <= FASTEST, v, 0.0)
    return within(-VISCOSITY * known, -TORQUE, TORQUE)

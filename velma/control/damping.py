"""The safe command: viscous friction in every joint, nothing else (velma_core_ve_body, safe state).

    tau = -d v

It takes no model and no set-point, so it is there when everything else failed; it takes energy out and puts none in.
"""

import numpy as np
from numpy.typing import NDArray

from velma.names import TORQUE

Array = NDArray[np.float64]

_ARM = (10.0, 10.0, 5.0, 5.0, 2.0, 1.0, 1.0)
VISCOSITY = np.array([20.0, *_ARM, *_ARM])  # Nms/rad, VS
# VS: at least so many cycles are spent in the safe state before a command may leave it.
DWELL_CYCLES = 500
# Beyond this a speed is a fault of its sensor, and the torque is at its limit anyway. rad/s
FASTEST = 100.0


def torque(v: Array) -> Array:
    """tau (15,) for speeds v (15,) rad/s, inside the accepted torques. A speed that is no number gets no torque."""
    known = np.clip(np.nan_to_num(v, posinf=0.0, neginf=0.0), -FASTEST, FASTEST)
    return np.asarray(np.clip(-VISCOSITY * known, -TORQUE, TORQUE))

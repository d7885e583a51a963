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
FASTEST = 100.0  # rad/s; estimate: beyond it, 50 times what the joints can do, a speed is a fault of its sensor


def torque(v: Array) -> Array:
    """tau (15,) for speeds v (15,) rad/s, inside the accepted torques.

    A speed that is no number, or beyond FASTEST, gets no torque: what it would push may stand still.
    """
    known = np.where(np.abs(v) <= FASTEST, v, 0.0)
    return np.asarray(np.clip(-VISCOSITY * known, -TORQUE, TORQUE))

"""Errors of the simulated wrist sensors: the same in the same cycle of a scene, also in a restored world."""

import numpy as np

from velma.model.scene import Noise
from velma.sim.backend import Array

CYCLES = 4001  # 8 s, then the noise repeats: longer than every average over it (estimate)


def table(noise: Noise) -> Array:
    """Return errors (CYCLES, 2, 6) [N, Nm] by cycle and side: a constant one and white noise, drawn from the seed."""
    rng = np.random.default_rng([noise.seed, *b"wrist"])
    bias = np.array([noise.force_bias] * 3 + [noise.torque_bias] * 3)
    spread = np.array([noise.force] * 3 + [noise.torque] * 3)
    constant = rng.uniform(-bias, bias, (2, 6))
    return np.asarray(constant + spread * rng.standard_normal((CYCLES, 2, 6)))

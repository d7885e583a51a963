"""Errors of the simulated robot and of what is known of it: the same in the same cycle of a scene, also restored."""

import numpy as np

from velma.model.scene import Noise
from velma.names import BODY
from velma.sim.backend import PERIOD_S, Array

CYCLES = 4001  # 8 s, then the noise repeats: longer than every average over it (estimate)


def wrists(noise: Noise) -> Array:
    """Return errors (CYCLES, 2, 6) [N, Nm] by cycle and side: a constant one and white noise, drawn from the seed."""
    rng = np.random.default_rng([noise.seed, *b"wrist"])
    bias = np.array([noise.force_bias] * 3 + [noise.torque_bias] * 3)
    spread = np.array([noise.force] * 3 + [noise.torque] * 3)
    constant = rng.uniform(-bias, bias, (2, 6))
    return np.asarray(constant + spread * rng.standard_normal((CYCLES, 2, 6)))


def joints(noise: Noise) -> Array:
    """Return errors (CYCLES, 2, 15) of body joints by cycle: of positions [rad], and of speeds [rad/s], which a drive
    computes from two positions."""
    rng = np.random.default_rng([noise.seed, *b"joint"])
    positions = noise.joint * rng.standard_normal((CYCLES, len(BODY)))
    return np.stack((positions, (positions - np.roll(positions, 1, axis=0)) / PERIOD_S), axis=1)


def weights(noise: Noise) -> Array:
    """Return by which factor (15,) each drive holds the weight of the arms."""
    rng = np.random.default_rng([noise.seed, *b"weight"])
    return np.asarray(1.0 + noise.weight * rng.uniform(-1.0, 1.0, len(BODY)))


def masses(noise: Noise, count: int) -> Array:
    """Return by which factor (count,) each thing is heavier than its model says."""
    rng = np.random.default_rng([noise.seed, *b"mass"])
    return np.asarray(1.0 + noise.mass * rng.uniform(-1.0, 1.0, count))

"""Head position control: the target of the two servos moves to the goal at a limited speed."""

import math

import numpy as np
from numpy.typing import NDArray

from velma.control.limits import within
from velma.names import HEAD_LOWER, HEAD_SPEED, HEAD_UPPER

Array = NDArray[np.float64]


def reachable(goal: Array) -> Array:
    """Return the nearest pan and tilt (2,) rad that the head can take."""
    return within(goal, HEAD_LOWER, HEAD_UPPER)


def advance(target: Array, goal: Array, speed: float, dt: float) -> Array:
    """Return the next servo target (2,) [rad]: from `target` towards `goal`, within limits, by at most speed * dt."""
    end = reachable(goal)
    step = end - target
    reach = min(speed, HEAD_SPEED) * dt
    length = math.sqrt(step @ step)
    return np.asarray(target + step * (reach / length)) if length > reach else end

"""Where the head looks, and how long it takes: ex turns the head so, pl tells the time by it."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from velma import names
from velma.kinematics.tasks import LOOK_SPEED

# lookAt of Velma: tilt = -atan2(z - 1.75, r), pan = atan2(y, x) - torso (velma_system@19132ed); the
# camera itself looks 5 degrees below the horizon at zero tilt.
EYE_HEIGHT_M, CAMERA_DIP = 1.75, math.radians(5.0)
REST_S = 0.1  # of a look; estimate: a frame of the simulated camera takes 67 ms
Point = Sequence[float] | np.ndarray  # (3,) [m, world]


def aim(torso: float, point: Point) -> np.ndarray:
    """Pan and tilt (2,) [rad] that centre a point in the picture, within the limits of the head."""
    x, y, z = (float(v) for v in point)
    pan = math.remainder(math.atan2(y, x) - torso, math.tau)
    tilt = -math.atan2(z - EYE_HEIGHT_M, math.hypot(x, y)) - CAMERA_DIP
    low, high = names.HEAD_LOWER, names.HEAD_UPPER
    return np.clip((pan, tilt), low + 0.01, (high[0] - 0.01, high[1]))


def duration(torso: float, head: Sequence[float], points: Iterable[Point]) -> float:
    """The time [s] in which the head looks at points one after the other, from `head` (2,) [rad].

    14 looks around in a fleet, from different begins, took 1.7 to 2.8 s, 2 to 5 % less than this.
    """
    goals = [np.array(head), *(aim(torso, point) for point in points)]
    return math.fsum(float(np.linalg.norm(b - a)) / LOOK_SPEED + REST_S for a, b in pairwise(goals))

"""The under-actuated fingers of the BarrettHand: one motor for two joints, a stop at touch, a
squeeze, a lock.

While nothing touches, distal = proximal / 3; when the proximal link is held, the motor's further
travel goes to the distal one at 4/3 of the rate (RCPRG barrett_hand, hand.cpp). Two servos do both
by themselves:

    proximal target = m        distal target = 4/3 m - proximal        m = motor travel

A finger touches when a joint needs more than `effort` to follow its target: servo error times gain
less friction. Arrays are (2, 3): rows right and left, fingers one, two, three.
"""

import numpy as np
from numpy.typing import NDArray

from velma.control.limits import within
from velma.names import DISTAL_UPPER, FINGER_UPPER

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Gains of the servos and their friction beside it (robot.yaml: actuators kv + joint damping):
# Nm/rad, Nms/rad.
PROXIMAL_KP, DISTAL_KP = 20.0, 10.0
PROXIMAL_LAG, DISTAL_LAG = 0.35, 0.15
# A motor stalls when both joints pull at their limit; a margin on the distal one, so that a held
# hand is at rest.
STALL_SLACK = 0.02  # rad, estimate
TOUCH_CYCLES = 5  # in a row, so that the jerk at the start is not a touch; estimate


def distal_target(motor: Array, proximal: Array) -> Array:
    """Return targets of the distal servos, rad."""
    return within(motor * (4.0 / 3.0) - proximal, 0.0, DISTAL_UPPER)


def effort(motor: Array, proximal: Array, distal: Array, speed: float) -> tuple[Array, Array]:
    """Return contact torques of proximal and distal joints [Nm], their motors moving at `speed`
    [rad/s].
    """
    against = PROXIMAL_KP * (motor - proximal) - PROXIMAL_LAG * speed
    beyond = DISTAL_KP * (motor * (4.0 / 3.0) - proximal - distal) - DISTAL_LAG * speed / 3.0
    return against, beyond


def touching(motor: Array, proximal: Array, distal: Array, speed: float, threshold: float) -> Mask:
    """Return which fingers push with more than `threshold` [Nm] (half of it at the distal
    joint).
    """
    against, beyond = effort(motor, proximal, distal, speed)
    return np.asarray((against > threshold) | (beyond > threshold / 2.0))


def stalled(motor: Array, proximal: Array, distal: Array, limit: Array) -> Mask:
    """Return which motors stall: both joints pull at their limits (`limit` [Nm] proximal, a third
    of it distal).
    """
    near = motor - proximal > limit / PROXIMAL_KP
    far = motor * (4.0 / 3.0) - proximal - distal > limit / (3.0 * DISTAL_KP) + STALL_SLACK
    return np.asarray(near & far)


def advance(motor: Array, goal: Array, speed: Array, stall: Mask, dt: float) -> Array:
    """Return motor travels after dt: towards `goal` at `speed`; a stalled motor closes no further
    but may open.
    """
    step = within(goal - motor, -speed * dt, speed * dt)
    step = np.where(stall & (step > 0.0), 0.0, step)
    return within(motor + step, 0.0, FINGER_UPPER)

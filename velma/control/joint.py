"""Laws of joints without a task: the body's impedance, the servos of the head, the fingers' motors.

Joint impedance (RCPRG common_controllers, joint_impedance.h) holds a posture:

    tau = K (q_des - q) - D (v - v_des) + J^T h,   D damps every mode of (M, K) by zeta

Closed loop: M e'' + D e' + K e = external torque. Torques are beyond gravity; h is the weight of
held things.

The fingers of the BarrettHand are under-actuated: one motor for two joints, a stop at touch, a
squeeze, a lock. While nothing touches, distal = proximal / 3; when the proximal link is held, the
motor's further travel goes to the distal one at 4/3 of the rate (RCPRG barrett_hand, hand.cpp). Two
servos do both by themselves:

    proximal target = m        distal target = 4/3 m - proximal        m = motor travel

A finger touches when a joint needs more than `effort` to follow its target: servo error times gain
less friction. Arrays of fingers are (2, 3): rows right and left, fingers one, two, three.
"""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma.control.cartesian import damping
from velma.control.dynamics import Terms
from velma.control.safety import within
from velma.names import DISTAL_UPPER, FINGER_UPPER, HEAD_LOWER, HEAD_SPEED, HEAD_UPPER
from velma.ranges import DampingRatio, Stiffness

Array = NDArray[np.float64]


class JointGains(msgspec.Struct, frozen=True):
    """Stiffness as Velma's interface sends it (velma_system); its damping ratio of 0.5 is the
    minimum allowed; this is the textbook value.
    """

    stiffness: tuple[Stiffness, Stiffness] = (1000.0, 200.0)  # torso, arm joints, Nm/rad
    damping_ratio: DampingRatio = 0.7

    def diagonal(self) -> Array:
        """Return diagonal of K, (15,)."""
        torso, arm = self.stiffness
        return np.array([torso] + [arm] * 14)


def torque(gains: JointGains, terms: Terms, stray: Array, slip: Array, wrench: Array) -> Array:
    """Return tau (15,) for stray q_des - q (15,), slip v - v_des (15,) and wrenches h (12,) of the
    hands.
    """
    stiffness = gains.diagonal()
    spread = damping(terms.mass, stiffness, gains.damping_ratio)
    return np.asarray(stiffness * stray - spread @ slip + terms.jacobian.T @ wrench)


# --- Head position control: the target of the two servos moves to the goal at a limited speed -----


def reachable(goal: Array) -> Array:
    """Return the nearest pan and tilt (2,) rad that the head can take."""
    return within(goal, HEAD_LOWER, HEAD_UPPER)


def advance_head(target: Array, goal: Array, speed: float, dt: float) -> Array:
    """Return the next servo target (2,) [rad]: from `target` towards `goal`, within limits, by at
    most speed * dt.
    """
    end = reachable(goal)
    step = end - target
    reach = min(speed, HEAD_SPEED) * dt
    length = math.sqrt(step @ step)
    return np.asarray(target + step * (reach / length)) if length > reach else end


# --- Fingers --------------------------------------------------------------------------------------

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


def advance_fingers(motor: Array, goal: Array, speed: Array, stall: Mask, dt: float) -> Array:
    """Return motor travels after dt: towards `goal` at `speed`; a stalled motor closes no further
    but may open.
    """
    step = within(goal - motor, -speed * dt, speed * dt)
    step = np.where(stall & (step > 0.0), 0.0, step)
    return within(motor + step, 0.0, FINGER_UPPER)

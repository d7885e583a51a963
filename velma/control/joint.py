"""Joint impedance of the body (RCPRG common_controllers, joint_impedance.h): holds a posture
without a task.

    tau = K (q_des - q) - D (v - v_des) + J^T h,   D damps every mode of (M, K) by zeta

Closed loop: M e'' + D e' + K e = external torque. Torques are beyond gravity; h is the weight of
held things.
"""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma.control.cartesian import damping
from velma.control.dynamics import Terms
from velma.control.limits import within
from velma.names import HEAD_LOWER, HEAD_SPEED, HEAD_UPPER
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


def advance(target: Array, goal: Array, speed: float, dt: float) -> Array:
    """Return the next servo target (2,) [rad]: from `target` towards `goal`, within limits, by at
    most speed * dt.
    """
    end = reachable(goal)
    step = end - target
    reach = min(speed, HEAD_SPEED) * dt
    length = math.sqrt(step @ step)
    return np.asarray(target + step * (reach / length)) if length > reach else end

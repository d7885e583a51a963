"""Postures in which an arm holds an object upright and leaves room for the other arm and the
torso.
"""

import math
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from velma import names
from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.frames import heading, standing
from velma.kinematics.motion import Keep
from velma.kinematics.robot import Robot

# Where the grip goes, in the torso frame [m], for the left hand (mirrored for the right); task runs
# with the true robot model carried near (0.38, 0.63, 1.0). The hand points forwards and outwards.
REGION_LOW = np.array([0.20, 0.35, 0.95])
REGION_HIGH = np.array([0.45, 0.70, 1.35])
HEADING = (-0.6, 1.2)  # [rad], same runs
CARRY_TILT = math.radians(35.0)  # largest of a filled jar on its way; same runs
# [rad], angles to which the torso must be able to turn with the object held
TORSO_SWEEP = (-1.0, -0.5, 0.3, 0.6)


def carries(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    T_grip_object: pin.SE3,
    rng: np.random.Generator,
    *,
    tries: int = 300,
) -> Iterator[np.ndarray]:
    """Yield free carry postures (15,); the object is attached to the hand in `world`."""
    mirror = 1.0 if side == "left" else -1.0
    object_yaw = heading(T_grip_object.inverse().rotation[:, 2])
    for _ in range(tries):
        at = rng.uniform(REGION_LOW, REGION_HIGH) * np.array([1.0, mirror, 1.0])
        turn = mirror * rng.uniform(*HEADING)
        grip = standing(np.zeros(3), turn - object_yaw) * T_grip_object.inverse()
        target = pin.SE3(grip.rotation, at)
        posture = ik.sample(
            robot, side, target, q, rng, torso=0.0, first=world.first_free, best=True
        )
        if posture is not None and all(world.free(_turned(posture, t)) for t in TORSO_SWEEP):
            yield posture


def upright(robot: Robot, side: str, T_grip_object: pin.SE3, largest_tilt: float) -> Keep:
    """Return the condition that the axis of the object stays within `largest_tilt` [rad] of the
    vertical.
    """
    least = math.cos(largest_tilt)
    parts = robot.chain[side].upward(np.ascontiguousarray(T_grip_object.rotation[:, 2]))
    return lambda postures: np.asarray(parts(postures) > least)


def _turned(q: np.ndarray, torso: float) -> np.ndarray:
    turned = q.copy()
    turned[0] = torso
    return turned


# --- Where an empty arm goes when it is not needed: its start posture, with the torso turned where
# it has room


# [rad], tried in this order; task runs with the true robot model
TORSO = (0.0, -0.3, 0.3, -0.6, 0.6, -0.9, 0.9)
FINGERS = 1.0  # [rad], same runs


def homes(q: np.ndarray, side: str) -> Iterator[np.ndarray]:
    """Yield postures (15,) with the arm as at the start, the torso as in q (15,) or turned."""
    for torso in (float(q[names.TORSO]), *TORSO):
        goal = q.copy()
        goal[names.ARM[side]] = names.START[names.ARM[side]]
        goal[names.TORSO] = torso
        yield goal

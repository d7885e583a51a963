"""Opening a leaf by its handle: the postures of an arm while the leaf turns about its hinge, the hand fast at the bar.

A leaf's frame is on its hinge, z along it. No scene, no physics.
"""

import numpy as np
import pinocchio as pin

from velma import names
from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.frames import standing
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import attaching

STEP = 0.04  # [rad] of the leaf between two postures: 1 cm of the hand


def turned(leaf: pin.SE3, angle: float) -> pin.SE3:
    """Return the pose of a leaf after a turn about its hinge [rad]."""
    return leaf * standing(np.zeros(3), angle)


def arc(
    robot: Robot, world: World, side: str, q: np.ndarray, name: str, leaf: pin.SE3, turn: float
) -> list[np.ndarray]:
    """Return postures from q on, with the leaf `name` in the hand as at q, while it turns by `turn` [rad] from `leaf`.

    Torso and arm move. Raises ik.PathBlocked where the arm does not follow or something is in its way.
    """
    T_grip_leaf = robot.grip(q, side).inverse() * leaf
    count = max(2, int(np.ceil(abs(turn) / STEP)))
    path = [q]
    with attaching.held(world, name, side, T_grip_leaf):
        for k in range(1, count + 1):
            target = turned(leaf, turn * k / count) * T_grip_leaf.inverse()
            part = ik.line(robot, side, path[-1], target, accept=world.free, columns=names.COLUMNS[side])
            path += part[1:]
    return path[1:]

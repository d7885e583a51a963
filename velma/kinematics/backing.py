"""A hand drawn straight back along its own axis: the way out of a cabinet, and backwards the way into it.

A tree that has to find such a passage by chance needs thousands of states; one that begins at its mouth a hundred.
"""

from collections.abc import Callable

import pinocchio as pin

from velma.kinematics import ik
from velma.kinematics.robot import Robot
from velma.names import Array

BACK_M = (0.25, 0.15, 0.08)  # m a hand is drawn back, the farthest that is possible (estimate)


def drawn_back(robot: Robot, side: str, q: Array, accept: Callable[[Array], bool]) -> list[Array]:
    """Postures (15,) from q with the hand straight back along its axis; only [q] where that is blocked."""
    grip = robot.grip(q, side)
    for distance in BACK_M:
        target = pin.SE3(grip.rotation, grip.translation - distance * grip.rotation[:, 2])
        try:
            return ik.line(robot, side, q, target, step=0.03, accept=accept)
        except ik.PathBlocked as blocked:
            if blocked.fraction * distance < BACK_M[-1]:
                break
    return [q]

"""Paths that draw a hand straight back along its axis: out of a cabinet, and in reverse into it.

A tree that has to find such a narrow passage needs thousands of states; one that starts outside needs a hundred. Also
paths out of contact: with an object in the hand that still stands on its shelf, or open fingers around one, every
motion would start in a collision.
"""

from collections.abc import Callable, Iterator

import numpy as np
import pinocchio as pin

from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.names import Array

OUT_M = (0.05, 0.10, 0.16, 0.03, 0.07, 0.13)
"""How far a hand moves to get out of contact [m]: a finger is 0.1 long (estimates). The last three are for where it is out
by less, and meets something farther on."""
_STEP = 0.02  # m between checked states on that path
_TOUCH, _SLACK = 0.002, 0.001  # m: closer than this is contact; noise of contact distances (estimates)
BACK_M = (0.25, 0.15, 0.08)  # m a hand is drawn back, the farthest that is possible (estimate)


def drawn_back(robot: Robot, side: str, q: Array, accept: Callable[[Array], bool]) -> list[Array]:
    """Return postures (15,) from q with the hand straight back along its axis; only [q] if that is blocked."""
    grip = robot.grip(q, side)
    for distance in BACK_M:
        target = pin.SE3(grip.rotation, grip.translation - distance * grip.rotation[:, 2])
        try:
            return ik.line(robot, side, q, target, step=0.03, accept=accept)
        except ik.PathBlocked as blocked:
            if blocked.fraction * distance < BACK_M[-1]:
                break
    return [q]


def out_of_touch(robot: Robot, world: World, side: str, q: Array) -> list[Array]:
    """Return postures (15,) from q to where nothing is nearer than the margin; [q] if q is so, or none is found.

    A short straight line, first upwards with an object in the hand, back with an empty one. It comes near to nothing
    that is not near at q.
    """
    if world.free(q):
        return [q]
    accept, grip = no_nearer(world, q), robot.grip(q, side)
    for distance in OUT_M:
        for direction in _directions(grip, world.carried(side)):
            target = pin.SE3(grip.rotation, grip.translation + distance * direction)
            try:
                path = ik.line(robot, side, q, target, step=_STEP, accept=accept)
            except ik.PathBlocked:
                continue
            if world.free(path[-1]):
                return path
    return [q]


def no_nearer(world: World, q: Array) -> Callable[[Array], bool]:
    """Return the condition that a posture comes near to nothing that is not near at q (15,), and touches nothing that
    does not touch at q.
    """
    least = {(a, b): min(distance - _SLACK, _TOUCH) for a, b, distance in world.touching(q)}

    def accept(x: Array) -> bool:
        return world.free(x) or all(d >= least.get((a, b), np.inf) for a, b, d in world.touching(x))

    return accept


def _directions(grip: pin.SE3, loaded: bool) -> Iterator[Array]:
    up, back = np.array([0.0, 0.0, 1.0]), -grip.rotation[:, 2]
    for direction in (up, back + up) if loaded else (back, back + up, back + 0.5 * up, up):
        yield direction / np.linalg.norm(direction)

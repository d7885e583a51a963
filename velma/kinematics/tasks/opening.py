"""Opening a leaf by its handle: the postures of an arm while the leaf turns about its hinge, the
hand at the bar.

A leaf's frame is on its hinge, z along it. The bar is round and upright: the hand may go about it
meanwhile. No scene, no physics.
"""

from collections.abc import Iterator

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
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    name: str,
    leaf: pin.SE3,
    turn: float,
    end: pin.SE3,
) -> list[np.ndarray]:
    """Return postures from q on, with the leaf `name` in the hand, while it turns by `turn` [rad]
    from `leaf`.

    Meanwhile the hand goes about the bar, from where it is at q to `end` (T_leaf_grip). Torso and
    arm move. Raises ik.PathBlocked where the arm does not follow or something is in its way.
    """
    begin, path = leaf.inverse() * robot.grip(q, side), [q]
    with attaching.held(world, name, side, begin.inverse()):
        for stands, hand in _steps(leaf, turn, begin, end):
            world.attach(name, side, hand.inverse())
            part = ik.line(
                robot, side, path[-1], stands * hand, accept=world.free, columns=names.COLUMNS[side]
            )
            path += part[1:]
    return path[1:]


def led(leaf: pin.SE3, turn: float, begin: pin.SE3, end: pin.SE3, grip: pin.SE3) -> pin.SE3:
    """Return where a leaf is whose handle a hand has led to `grip`, somewhere on the way that `arc`
    plans.
    """
    steps = [(leaf, begin), *_steps(leaf, turn, begin, end)]
    off = [np.linalg.norm((at * hand).translation - grip.translation) for at, hand in steps]
    return steps[int(np.argmin(off))][0]


def _steps(
    leaf: pin.SE3, turn: float, begin: pin.SE3, end: pin.SE3
) -> Iterator[tuple[pin.SE3, pin.SE3]]:
    """Yield the leaf's pose and the hand's in its frame, from `begin` to `end`, about each STEP of
    the turn.
    """
    count = max(2, int(np.ceil(abs(turn) / STEP)))
    for share in (k / count for k in range(1, count + 1)):
        yield turned(leaf, turn * share), pin.SE3.Interpolate(begin, end, share)

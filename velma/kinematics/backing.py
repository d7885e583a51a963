"""Paths that draw a hand straight back along its axis: out of a cabinet, and in reverse into it.

A tree that has to find such a narrow passage needs thousands of states; one that starts outside
needs a hundred. Also paths out of contact: with an object in the hand that still stands on its
shelf, or open fingers around one, every motion would start in a collision.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

import numpy as np
import pinocchio as pin

from velma import names
from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.names import Array

OUT_M = (0.05, 0.10, 0.16, 0.03, 0.07, 0.13)
"""How far a hand moves to get out of contact [m]: a finger is 0.1 long (estimates). The last three
are for where it is out by less, and meets something farther on.
"""
_STEP = 0.02  # m between checked states on that path
_TURN = 0.05  # [rad] of a joint between checked states (estimate)
# m: closer than this is contact; noise of contact distances (estimates)
_TOUCH, _SLACK = 0.002, 0.001
BACK_M = (0.25, 0.15, 0.08)  # m a hand is drawn back, the farthest that is possible (estimate)


def drawn_back(robot: Robot, side: str, q: Array, accept: Callable[[Array], bool]) -> list[Array]:
    """Return postures (15,) from q with the hand straight back along its axis; only [q] if that is
    blocked.
    """
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
    """Return postures (15,) from q to where nothing is nearer than the margin; [q] if q is so, or
    none is found.

    A short straight line, first upwards with an object in the hand, back with an empty one; else an
    empty arm goes towards its start posture, as where a hand is folded against its own arm. It
    comes near to nothing that is not near at q. Nothing is tried where something touches that this
    arm does not move.
    """
    if world.free(q) or any(
        not (world.moves(a, side) or world.moves(b, side)) for a, b, _ in world.touching(q)
    ):
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
    return [q] if world.carried(side) else _unfolded(world, side, q, accept)


def way_out(
    robot: Robot, world: World, side: str, q: Array, poses: Sequence[pin.SE3]
) -> list[Array]:
    """Return postures (15,) after q through the poses of the grip as far as they can be reached,
    and out of contact.
    """
    path = [q]
    for pose in poses:
        leg, whole = furthest(robot, world, side, path[-1], pose)
        path += leg
        if not whole:
            break
    return [*path[1:], *out_of_touch(robot, world, side, path[-1])[1:]]


def _unfolded(world: World, side: str, q: Array, accept: Callable[[Array], bool]) -> list[Array]:
    """Return postures (15,) from q towards the start posture of the arm, the last one free; [q] if
    none is reached.
    """
    turn = np.zeros_like(q)
    turn[names.ARM[side]] = names.START[names.ARM[side]] - q[names.ARM[side]]
    path = [q]
    for share in np.linspace(0.0, 1.0, 2 + int(np.abs(turn).max() / _TURN))[1:]:
        path.append(q + share * turn)
        if not accept(path[-1]):
            break
        if world.free(path[-1]):
            return path
    return [q]


def furthest(
    robot: Robot, world: World, side: str, q: Array, target: pin.SE3
) -> tuple[list[Array], bool]:
    """Return postures on the straight line of the grip from q to `target` as far as possible, and
    whether it got there.

    It comes no nearer to anything than it is at q. The torso moves only if the arm alone does not
    reach.
    """
    accept = no_nearer(world, q)
    fraction = 0.0
    for columns in (names.ARM[side], names.COLUMNS[side]):
        try:
            return ik.line(robot, side, q, target, accept=accept, columns=columns)[1:], True
        except ik.PathBlocked as blocked:
            fraction = blocked.fraction
    start = robot.grip(q, side)
    for part in (fraction - 0.05, fraction / 2):
        with suppress(ik.PathBlocked):
            if part > 0.0:
                short = pin.SE3.Interpolate(start, target, part)
                return ik.line(robot, side, q, short, accept=accept, columns=names.COLUMNS[side])[
                    1:
                ], False
    return [], False


def no_nearer(world: World, q: Array) -> Callable[[Array], bool]:
    """Return the condition that a posture comes near to nothing that is not near at q (15,), and
    touches nothing that does not touch at q.
    """
    least = {(a, b): min(distance - _SLACK, _TOUCH) for a, b, distance in world.touching(q)}

    def accept(x: Array) -> bool:
        return world.free(x) or all(d >= least.get((a, b), np.inf) for a, b, d in world.touching(x))

    return accept


def _directions(grip: pin.SE3, loaded: bool) -> Iterator[Array]:
    up, back = np.array([0.0, 0.0, 1.0]), -grip.rotation[:, 2]
    for direction in (up, back + up) if loaded else (back, back + up, back + 0.5 * up, up):
        yield direction / np.linalg.norm(direction)

"""Ways over postures that often help where the straight one is blocked, cheaper to try than to grow a tree.

A hand gets out of a cabinet, and into one, along its own axis; a torso turns best with the arm down; torso and arm may
move one after the other. All combinations are tried, the quickest allowed ones are offered.
"""

from collections.abc import Callable, Iterator

import numpy as np
import pinocchio as pin

from velma import names
from velma.kinematics import ik
from velma.kinematics.robot import Robot
from velma.kinematics.shortening import STEP, clear
from velma.kinematics.timing import dense
from velma.names import Array

BACK_M = (0.25, 0.15, 0.08)  # m a hand is drawn back along its axis, the farthest that is possible (estimate)
OFFERED = 3


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


def _middles(start: Array, goal: Array, rest: Array) -> Iterator[list[Array]]:
    """Postures (8,) to go over between start and goal: none, torso or arm first, the arm at rest meanwhile."""
    yield []
    yield [np.concatenate((goal[:1], start[1:]))]
    yield [np.concatenate((start[:1], goal[1:]))]
    for torso in (goal[0], start[0], (start[0] + goal[0]) / 2):
        yield [np.array([torso, *rest])]
    yield [np.array([start[0], *rest]), np.array([goal[0], *rest])]


def detours(
    side: str,
    out: Array,
    into: Array,
    allowed: Callable[[Array], bool],
    cost: Callable[[Array], Array],
) -> list[Array]:
    """Allowed ways (n, 8), quickest first: `out` (k, 8) away from the start, over something, `into` (m, 8) the goal.

    `out` begins with the start and `into` ends with the goal; of each, all or only that end is used.
    """
    rest = names.START[names.ARM[side]]
    found = []
    for begin in {len(out): out, 1: out[:1]}.values():
        for end in {len(into): into, 1: into[-1:]}.values():
            for middle in _middles(begin[-1], end[0], rest):
                between = dense([begin[-1], *middle, end[0]], STEP)
                if clear(allowed, between):
                    found.append(dense([*begin[:-1], *between, *end[1:]], STEP))
    return sorted(found, key=lambda way: float(cost(way).sum()))[:OFFERED]

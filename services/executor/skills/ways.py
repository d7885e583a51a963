"""Ways ex finds itself, with room to spare: a hand does not follow its path to the millimetre, nor is sight exact.

Used where no plan says the way: put down aside, go home, get free of what the hand stands among.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress

import numpy as np
import pinocchio as pin

from services.executor.skills.situation import MARGIN_M, Situation
from velma import names
from velma.kinematics import backing, ik, motion

# [m] tried in turn. In task runs hands were up to 24 mm beside their path, mostly 10; sight is wrong by 4 mm.
ROOM_M = (0.02, 0.01, MARGIN_M)
ATTEMPTS = 2  # trees for each goal: any way will do, and somebody waits (estimate)


@contextmanager
def room(here: Situation, margin: float) -> Iterator[None]:
    """Everything keeps this distance [m] inside the block."""
    before = here.world.margin
    here.world.margin = margin
    try:
        yield
    finally:
        here.world.margin = before


def free_way(
    here: Situation,
    side: str,
    goals: Iterable[np.ndarray],
    speed: float,
    keep: Callable[[np.ndarray], bool] | None = None,
) -> list[np.ndarray] | None:
    """A free motion to the first possible of `goals` (15,) with as much room as there is; None: there is no way."""
    wanted = list(goals)
    for margin in ROOM_M:
        with room(here, margin):
            for goal in wanted:
                path = motion.plan(
                    here.robot, here.world, side, here.q, goal, keep=keep, tool_speed=speed, attempts=ATTEMPTS
                )
                if path is not None:
                    return path
    return None


def furthest(here: Situation, side: str, q: np.ndarray, target: pin.SE3) -> tuple[list[np.ndarray], bool]:
    """Postures on the straight line of the grip from q to `target` as far as it goes, and whether it went all the way.

    It comes near to nothing new. Where the arm alone cannot, the torso helps.
    """
    accept = backing.no_nearer(here.world, q)
    fraction = 0.0
    for columns in (names.ARM[side], names.COLUMNS[side]):
        try:
            return ik.line(here.robot, side, q, target, accept=accept, columns=columns)[1:], True
        except ik.PathBlocked as blocked:
            fraction = blocked.fraction
    start = here.robot.grip(q, side)
    for part in (fraction - 0.05, fraction / 2):
        with suppress(ik.PathBlocked):
            if part > 0.0:
                short = pin.SE3.Interpolate(start, target, part)
                return ik.line(here.robot, side, q, short, accept=accept, columns=names.COLUMNS[side])[1:], False
    return [], False

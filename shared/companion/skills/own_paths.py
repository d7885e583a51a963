"""Paths that ex plans itself, with a safety margin: hands follow paths, and sights show poses, with some error.

Used where the plan has no path: to put down in an emergency, to go home, to go on or back after an interruption.
"""

from collections.abc import Iterable

import numpy as np

from companion.skills.situation import MARGIN_M, Situation
from velma.kinematics import motion
from velma.kinematics.tasks import attaching

# [m] tried in turn. In task runs hands were up to 24 mm beside their path, mostly 10; poses seen are wrong by 4 mm.
ROOM_M = (0.02, 0.01, MARGIN_M)
ATTEMPTS = 2  # trees for each goal: any path will do, and ta waits (estimate)


def free_path(
    here: Situation,
    side: str,
    goals: Iterable[np.ndarray],
    speed: float,
    keep: motion.Keep | None = None,
) -> list[np.ndarray] | None:
    """Return a free path to the first possible of `goals` (15,), with the largest margin possible, or None."""
    wanted = list(goals)
    for margin in ROOM_M:
        with attaching.room(here.world, margin):
            for goal in wanted:
                found = motion.plan(
                    here.robot, here.world, side, here.q, goal, keep=keep, tool_speed=speed, attempts=ATTEMPTS
                )
                if found is not None:
                    return found.path
    return None


def rest(here: Situation, path: list[np.ndarray]) -> list[np.ndarray]:
    """Return the rest of a path from the present posture on."""
    return path[_reached(here, path) :] if path else []


def back(here: Situation, path: list[np.ndarray]) -> list[np.ndarray]:
    """Return the way from the present posture back to the begin of a path that was followed as far as here."""
    return path[: _reached(here, path) + 1][::-1]


def _reached(here: Situation, path: list[np.ndarray]) -> int:
    """Return which posture of a path is nearest to the present one."""
    return int(np.argmin([np.abs(q - here.q).max() for q in path]))

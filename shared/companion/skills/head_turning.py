"""Where the head looks during a motion: at what is to be watched, unless an arm would meet it on its way.

Paths are planned with the head straight ahead. Turned, it reaches 0.2 m to a side, where an arm may pass.
"""

from collections.abc import Sequence

import numpy as np

from companion.skills.loop_messages import KNOT_S, HeadGoal
from companion.skills.situation import Situation
from velma.kinematics.tasks import attaching

LOOK_SPEED = 1.0  # [rad/s]; the head may turn at 1.04
AHEAD = HeadGoal(0.0, 0.0, LOOK_SPEED)
EVERY = 5
"""Knots between two states that are checked (estimate): 0.1 s, in which a hand moves by 3.5 cm at most and the head
turns by 6 degrees."""
ROOM_M = 0.02
"""Between arm and head: hands were up to 24 mm beside their path, mostly 10, in task runs."""


def turning(here: Situation, knots: Sequence[np.ndarray], wanted: HeadGoal | None) -> HeadGoal | None:
    """Return the head's goal for a motion through these knots (15,): the wanted one, else straight ahead.

    None: it stays as it is.
    """
    return wanted if _clear(here, knots, wanted) else AHEAD


def _clear(here: Situation, knots: Sequence[np.ndarray], goal: HeadGoal | None) -> bool:
    """Whether no arm comes near the head because that is not straight ahead, at any time of the motion and its end."""
    begin = np.array(here.head)
    way = np.zeros(2) if goal is None else np.array((goal.pan, goal.tilt)) - begin
    turns_s = float(np.linalg.norm(way)) / LOOK_SPEED
    lasts_s = max(turns_s, KNOT_S * (len(knots) - 1))
    with attaching.room(here.world, ROOM_M):
        for at in np.arange(0.0, lasts_s + EVERY * KNOT_S, EVERY * KNOT_S):
            head = begin + way * min(1.0, at / turns_s if turns_s else 1.0)
            q = knots[min(len(knots) - 1, round(at / KNOT_S))]
            if not _free(here, q, head) and _free(here, q, np.zeros(2)):
                return False
    return True


def _free(here: Situation, q: np.ndarray, head: np.ndarray) -> bool:
    """Whether a state is free with this pan and tilt (2,) [rad]."""
    here.world.head(float(head[0]), float(head[1]))
    try:
        return here.world.free(q)
    finally:
        here.world.head(0.0, 0.0)

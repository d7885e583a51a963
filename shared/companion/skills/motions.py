"""Motions of the loop made of joint paths: timed, with goals for head and hands."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from companion.skills.loop_messages import (
    KNOT_S,
    HandCommand,
    HeadGoal,
    Motion,
    Move,
    Payload,
    motion,
)
from companion.skills.situation import Situation
from velma import names
from velma.kinematics.tasks import LOOK_SPEED, attaching, looking
from velma.kinematics.tasks.looking import Point
from velma.kinematics.timing import timed

# --- Where the head looks during a motion: at what is to be watched, unless an arm would meet it on
# its way
# Paths are planned with the head straight ahead. Turned, it reaches 0.2 m to a side, where an arm
# may pass.


AHEAD = HeadGoal(0.0, 0.0, LOOK_SPEED)
EVERY = 5
"""Knots between two states that are checked (estimate): 0.1 s, in which a hand moves by 3.5 cm at
most and the head turns by 6 degrees.
"""
ROOM_M = 0.02
"""Between arm and head: hands were up to 24 mm beside their path, mostly 10, in task runs."""


def turning(
    here: Situation, knots: Sequence[np.ndarray], wanted: HeadGoal | None
) -> HeadGoal | None:
    """The head's goal for a motion through these knots (15,): the wanted one, else straight ahead.

    None: it stays as it is.
    """
    return wanted if _clear(here, knots, wanted) else AHEAD


def _clear(here: Situation, knots: Sequence[np.ndarray], goal: HeadGoal | None) -> bool:
    """Whether no arm comes near the head because that is not straight ahead, at any time of the
    motion and its end.
    """
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


# --- Motions of the loop made of joint paths ------------------------------------------------------


# that may be in a vessel: 60 grains of 2 g, the most of a scene (velma.model.scene)
CONTENT_KG = 0.12


def aim(torso: float, point: Point) -> HeadGoal:
    """The head goal that centres a point (3,) [m, world] in the picture, within the limits of the
    head.
    """
    pan, tilt = looking.aim(torso, point)
    return HeadGoal(float(pan), float(tilt), LOOK_SPEED)


def along(
    here: Situation,
    key: str,
    path: Sequence[np.ndarray],
    speed: float,
    *,
    watch: Point | None = None,
    **options: Any,
) -> Motion:
    """The motion along a joint path, (15,) each, tool at most at `speed` [m/s], head at last on
    `watch`.
    """
    whole = [here.q, *path]
    # NaN is no rest
    different = [whole[0], *(b for a, b in pairwise(whole) if not np.abs(b - a).max() <= 1e-6)]
    if len(different) == 1:
        return still(here, key, watch=watch, **options)
    knots = timed(here.robot, different, tool_speed=speed).q
    head = None if watch is None else aim(float(knots[-1][names.TORSO]), watch)
    return motion(key, knots, head=turning(here, list(knots), head), **options)


def still(here: Situation, key: str, *, watch: Point | None = None, **options: Any) -> Motion:
    """A motion that holds the set-point while head or hands move."""
    head = (
        None if watch is None else turning(here, [here.q], aim(float(here.q[names.TORSO]), watch))
    )
    return motion(key, here.q, head=head, **options)


def turned(here: Situation, q: np.ndarray, point: Point) -> HeadGoal | None:
    """The head goal that centres a point [m, world] at q (15,); None: an arm is too near the
    head.
    """
    goal = aim(float(q[names.TORSO]), point)
    return goal if turning(here, [q], goal) == goal else None


def fingers(angle: float, speed: float = 1.0) -> Move:
    """The command that moves all three fingers to one angle [rad]."""
    return Move((angle, angle, angle), speed)


def hand(side: str, command: HandCommand) -> dict[str, Any]:
    """The option of a motion that commands one hand."""
    return {str(side): command}


def payload(side: str, mass: float = 0.0, T_grip_object: pin.SE3 | None = None) -> dict[str, Any]:
    """The option of a motion for a hand that carries `mass` [kg] at the object's origin; no pose:
    empty.
    """
    if T_grip_object is None:
        return {f"payload_{side}": Payload()}
    x, y, z = (float(v) for v in T_grip_object.translation)
    return {f"payload_{side}": Payload(mass, (x, y, z), CONTENT_KG)}

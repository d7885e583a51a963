"""The head turns to what is to be watched, unless an arm would meet it."""

from functools import cache

import numpy as np

from companion.skills import motions
from companion.skills.loop_messages import KNOT_S, HeadGoal
from companion.skills.motions import AHEAD, ROOM_M, turning
from companion.skills.situation import beginning
from velma import names
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import LOOK_SPEED

MANY = 16
ASIDE = HeadGoal(1.2, 0.5, LOOK_SPEED)


@cache
def situation():
    return beginning(Robot(), {}, {})


@cache
def raised():
    """Postures (15,) that are free with the head ahead, and in which an arm is beside the head."""
    here, rng, found = situation(), np.random.default_rng(3), []
    low, high = here.robot.lower, here.robot.upper
    while len(found) < MANY:
        q = np.array(names.START)
        side = ("left", "right")[len(found) % 2]
        q[names.ARM[side]] = rng.uniform(low[names.ARM[side]] + 0.1, high[names.ARM[side]] - 0.1)
        elbow = here.robot.grip(q, side).translation
        if elbow[2] > 1.4 and np.hypot(*elbow[:2]) < 0.6 and here.world.free(q):
            found.append(q)
    return found


def meets(q, heads):
    """Whether an arm is near the head in one of these directions (n, 2) [rad], and not when it
    looks ahead.
    """
    world = situation().world
    before, world.margin = world.margin, ROOM_M
    try:
        for pan, tilt in heads:
            world.head(pan, tilt)
            turned = any("head" in a + b for a, b, _ in world.touching(q))
            world.head(0.0, 0.0)
            if turned and not any("head" in a + b for a, b, _ in world.touching(q)):
                return True
        return False
    finally:
        world.margin = before


def test_it_turns_where_no_arm_is_in_its_way():
    """At rest: the goal is the wanted one, or else ahead where an arm is beside what it passes."""
    here, way, goals = situation(), np.linspace((0.0, 0.0), (ASIDE.pan, ASIDE.tilt), 200), set()
    here.head = (0.0, 0.0)
    for number, q in enumerate(raised()):
        found = turning(here, [q], ASIDE)
        goals.add(found)
        assert meets(q, way if found == AHEAD else way[::15]) is (found == AHEAD), number
    assert goals == {ASIDE, AHEAD}


def test_it_turns_back_before_an_arm_that_comes():
    """It was turned before the motion; the arm comes where it is: it looks ahead, as the path was
    planned.
    """
    here = situation()
    q = next(q for q in raised() if meets(q, np.array([(ASIDE.pan, ASIDE.tilt)])))
    path = np.linspace(names.START, q, round(4.0 / KNOT_S))
    here.head = (ASIDE.pan, ASIDE.tilt)
    assert turning(here, list(path), None) == AHEAD
    here.head = (0.0, 0.0)
    assert turning(here, list(path), None) is None


def test_a_motion_has_that_goal():
    """Each motion of a skill, with an arm or without."""
    here = situation()
    point = (0.39, 1.0, 1.03)
    goal = motions.aim(0.0, point)
    q = next(q for q in raised() if meets(q, np.array([(goal.pan, goal.tilt)])))
    here.q, here.head = q, (0.0, 0.0)
    assert motions.still(here, "still", watch=point).head == AHEAD
    there = q.copy()
    there[names.TORSO] += 0.05
    assert motions.along(here, "along", [there], 0.2, watch=point).head == AHEAD
    here.q = np.array(names.START)
    assert motions.still(here, "still", watch=point).head == goal

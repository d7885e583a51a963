"""A hand that is folded against its own arm finds its way out, and comes nearer to nothing on
it.
"""

from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from velma import names
from velma.kinematics import backing, ik, motion
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Box

SIDE, BENT = "left", 1.2  # [rad], fingers about a bar
FOUND, OF = 6, 8  # measured: 55 of 60


def test_a_folded_hand_gets_out_of_touch(robot: Robot, rng: np.random.Generator) -> None:
    """Random postures in which nothing is near but parts of one arm: most of them lead to a free
    one.
    """
    world = World(robot)
    world.fingers(SIDE, BENT)
    freed = 0
    for q in islice(folded(world, rng), OF):
        path = backing.out_of_touch(robot, world, SIDE, q)
        least = min(distance for *_, distance in world.touching(q))
        assert all(
            distance >= min(least, 0.002) - 0.001
            for state in path
            for *_, distance in world.touching(state)
        )
        freed += world.free(path[-1])
    assert freed >= FOUND


def folded(world: World, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Yield postures (15,) in which only the arm is near to itself, and touches nothing."""
    while True:
        q = np.array(names.START)
        q[names.ARM[SIDE]] = rng.uniform(names.LOWER, names.UPPER)[names.ARM[SIDE]]
        near = world.touching(q)
        if (
            near
            and not world.free(q)
            and all(a.startswith(SIDE) and b.startswith(SIDE) and d > 0.0 for a, b, d in near)
        ):
            yield q


def test_an_arm_does_not_look_for_a_way_out_of_what_the_other_one_touches(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would be tried for every goal, for a second each. The arm that touches gets out."""
    world, q, tried = World(robot), np.array(names.START), []
    world.fingers("right", 0.5)
    world.put("table_1", [Box((0.15, 0.15, 0.02))], robot.grip(q, "right"))
    monkeypatch.setattr(ik, "line", lambda *_, **__: tried.append(1) or [q])
    assert not world.free(q)
    assert motion.plan(robot, world, "left", q, q) is None
    assert not tried
    monkeypatch.undo()
    assert world.free(backing.out_of_touch(robot, world, "right", q)[-1])

"""A hand that is folded against its own arm finds its way out, and comes nearer to nothing on it."""

from collections.abc import Iterator
from itertools import islice

import numpy as np

from velma import names
from velma.kinematics import backing
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot

SIDE, BENT = "left", 1.2  # [rad], fingers about a bar
FOUND, OF = 6, 8  # measured: 55 of 60


def test_a_folded_hand_gets_out_of_touch(robot: Robot, rng: np.random.Generator) -> None:
    """Random postures in which nothing is near but parts of one arm: most of them lead to a free one."""
    world = World(robot)
    world.fingers(SIDE, BENT)
    freed = 0
    for q in islice(folded(world, rng), OF):
        path = backing.out_of_touch(robot, world, SIDE, q)
        least = min(distance for *_, distance in world.touching(q))
        assert all(distance >= min(least, 0.002) - 0.001 for state in path for *_, distance in world.touching(state))
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

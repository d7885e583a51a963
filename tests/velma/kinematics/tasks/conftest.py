"""The canonical scene with the shapes the agents know, and two things taken out of the cabinet once
for all tests.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest

from companion.models import GRASPS, KNOWN_AS, MODELS
from velma import names
from velma.kinematics.collision import World
from velma.kinematics.frames import standing, transform
from velma.kinematics.robot import Robot
from velma.kinematics.tasks.grasping import Approach, GraspWay, Target, approaches
from velma.model.scene import load

WANTED = 3


@dataclass(frozen=True)
class Taking:
    """A hand that takes a thing: the grasps it knows and the approaches found."""

    side: str
    target: Target
    ways: list[GraspWay]
    found: list[Approach]

    def held(self, approach: Approach) -> pin.SE3:
        """T_grip_object after it."""
        return approach.steps[-1][0].inverse()


def furnish(robot: Robot) -> World:
    """A world with all things of the canonical scene in it."""
    world = World(robot)
    for thing in load().things:
        model = MODELS[KNOWN_AS.get(thing.model, thing.model)]
        kind = "object" if model.moveable else "furniture"
        world.put(thing.id, model.shapes, standing(thing.xyz, thing.yaw), kind)
    return world


def take(robot: Robot, world: World, side: str, name: str, model: str) -> Taking:
    """Grasps of a thing in the cabinet, from the start posture."""
    known = GRASPS[model]
    ways = [
        GraspWay(g.id, tuple((transform(s.pose), s.fingers) for s in g.steps))
        for g in known
        if g.kind == known[0].kind
    ]
    out = world.pose("cabinet_2").rotation[:, 0]
    target = Target(name, world.pose(name), True, out, known[0].out)
    rng = np.random.default_rng(1)
    found = approaches(robot, world, side, np.array(names.START), target, ways, rng, wanted=WANTED)
    return Taking(side, target, ways, found)


@pytest.fixture
def world(robot: Robot) -> World:
    """Everything stands where the canonical scene puts it."""
    return furnish(robot)


@pytest.fixture(scope="session")
def jar(robot: Robot) -> Taking:
    """The left hand takes the jar."""
    return take(robot, furnish(robot), "left", "jar_1", "jar")


@pytest.fixture(scope="session")
def bowl(robot: Robot) -> Taking:
    """The right hand takes the bowl."""
    return take(robot, furnish(robot), "right", "bowl_1", "bowl_high")


@pytest.fixture(params=["jar", "bowl"])
def taking(request: pytest.FixtureRequest) -> Taking:
    """Either of them."""
    found: Taking = request.getfixturevalue(request.param)
    return found


@pytest.fixture
def with_jar(world: World, jar: Taking) -> tuple[World, np.ndarray, pin.SE3]:
    """The world with the jar just taken: world, q, T_grip_jar."""
    approach = jar.found[0]
    world.attach("jar_1", "left", jar.held(approach))
    return world, approach.way_out[-1], jar.held(approach)


@pytest.fixture
def with_bowl(world: World, bowl: Taking) -> tuple[World, np.ndarray, pin.SE3]:
    """The world with the bowl just taken: world, q, T_grip_bowl."""
    approach = bowl.found[0]
    world.attach("bowl_1", "right", bowl.held(approach))
    return world, approach.way_out[-1], bowl.held(approach)

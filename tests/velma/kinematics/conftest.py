"""One robot for all tests, the canonical scene, and a random source that shows its seed when a test
fails.

The things of the scene are read from the MuJoCo model of it, so that a comparison of verdicts
compares checks only, not numbers.
"""

from collections.abc import Callable

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.kinematics.shapes import Box, Cylinder
from velma.model.build import Kind
from velma.model.kinds import Model
from velma.model.scene import load
from velma.model.scene_xml import scene_xml


@pytest.fixture(scope="session")
def robot() -> Robot:
    """Torso and arms from the committed robot file."""
    return Robot()


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Random numbers, the same in every run of one test."""
    seed = sum(map(ord, request.node.name))
    print(f"seed {seed}")
    return np.random.default_rng(seed)


def _place(position: np.ndarray, quat_wxyz: np.ndarray) -> pin.SE3:
    """The transform of a position and a MuJoCo quaternion."""
    w, x, y, z = quat_wxyz
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(position))


@pytest.fixture
def canonical() -> mujoco.MjModel:
    """The canonical scene without grains and without the floor, compiled by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(scene_xml(load()))
    for geom in range(model.ngeom):
        grain = model.geom_contype[geom] in (Kind.GRAIN, Kind.INNER)
        if grain or model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
    return model


def _shapes(model: mujoco.MjModel, body: str) -> tuple[Box | Cylinder, ...]:
    """The shapes of a body that can touch anything."""
    found: list[Box | Cylinder] = []
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] != model.body(body).id or not model.geom_contype[geom]:
            continue
        at, size = _place(model.geom_pos[geom], model.geom_quat[geom]), model.geom_size[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            found.append(Box((2 * size[0], 2 * size[1], 2 * size[2]), at))
        else:
            assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER
            found.append(Cylinder(size[0], 2 * size[1], at))
    return tuple(found)


@pytest.fixture
def furnished(robot: Robot, canonical: mujoco.MjModel) -> Callable[[], World]:
    """Makes a world with all things of the canonical scene in it."""

    def furnish() -> World:
        world = World(robot)
        for thing in load().things:
            kind = "object" if thing.model in (Model.JAR, Model.BOWL) else "furniture"
            body = canonical.body(thing.id)
            world.put(thing.id, _shapes(canonical, thing.id), _place(body.pos, body.quat), kind)
        return world

    return furnish

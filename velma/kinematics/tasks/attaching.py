"""Short-lived changes of the collision world: an object in the hand, or standing, while something is tried."""

from collections.abc import Iterator
from contextlib import contextmanager

import pinocchio as pin

from velma.kinematics.collision import World


@contextmanager
def held(world: World, name: str, side: str, T_grip_object: pin.SE3) -> Iterator[None]:
    """The object is in the hand inside the block and stands where it was afterwards."""
    stood = world.pose(name)
    world.attach(name, side, T_grip_object)
    try:
        yield
    finally:
        world.detach(name, stood)


@contextmanager
def stood(world: World, name: str, pose: pin.SE3, side: str) -> Iterator[None]:
    """The object stands at `pose` inside the block and is in the hand again afterwards."""
    T_grip_object = world.held(name)
    world.detach(name, pose)
    try:
        yield
    finally:
        world.attach(name, side, T_grip_object)


@contextmanager
def allowed(world: World, *pairs: tuple[str, str]) -> Iterator[None]:
    """These groups may touch as well inside the block, and afterwards only those that might before."""
    before = world.allow()
    world.allow(*before, *pairs)
    try:
        yield
    finally:
        world.allow(*before)

"""Temporary changes of the collision world while something is tried: an object in the hand or at
rest, other room.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import pinocchio as pin

from velma.kinematics.collision import World


@contextmanager
def held(world: World, name: str, side: str, T_grip_object: pin.SE3) -> Iterator[None]:
    """Attach an object to the hand inside the block; afterwards it is where it was."""
    stood = world.pose(name)
    world.attach(name, side, T_grip_object)
    try:
        yield
    finally:
        world.detach(name, stood)


@contextmanager
def stood(world: World, name: str, pose: pin.SE3, side: str) -> Iterator[None]:
    """Put an object at rest at `pose` inside the block; afterwards it is in the hand of `side`
    again, or where it stood if it was in none.
    """
    held, before = world.held(name), world.pose(name)
    world.detach(name, pose)
    try:
        yield
    finally:
        if held is None:
            world.detach(name, before)
        else:
            world.attach(name, side, held)


@contextmanager
def allowed(world: World, *pairs: tuple[str, str]) -> Iterator[None]:
    """Allow more groups to touch inside the block."""
    before = world.allow()
    world.allow(*before, *pairs)
    try:
        yield
    finally:
        world.allow(*before)


@contextmanager
def room(world: World, margin: float) -> Iterator[None]:
    """Set the collision margin to this distance [m] inside the block."""
    before = world.margin
    world.margin = margin
    try:
        yield
    finally:
        world.margin = before

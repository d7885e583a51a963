"""The scene of the experiment, observed."""

import math

import pytest

from companion.languages import wm
from companion.languages.values import BodyPosture, Pose, Side
from services.knowledge.store import Store

from .storing import store_observation


def yaw(angle):
    """A turn about z, w first."""
    return math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)


# The recorded scene kb_world_model_011 of proghtn-backstream: jar and bowl in the cabinet, which
# stands on a table.
KITCHEN = (
    wm.SeenObject("table_1", "table", Pose((0.783, -0.840, 0.0), yaw(-0.747)), 1.0),
    wm.SeenObject("table_2", "table", Pose((1.087, 0.434, 0.0), yaw(-1.335)), 1.1),
    wm.SeenObject("jar_1", "jar", Pose((0.851, 0.369, 1.281), yaw(2.976)), 1.2),
    wm.SeenObject("bowl_1", "bowl_high", Pose((0.809, 0.437, 0.881), yaw(-2.14)), 1.3),
    wm.SeenObject("cabinet_2", "cabinet_no_door", Pose((0.8994, 0.3646, 1.125), yaw(-2.9235)), 1.4),
    wm.SeenBody(BodyPosture(0.1, (0.2,) * 7, (0.3,) * 7, (0.4, 0.5), (0.6,) * 4, (0.7,) * 4)),
    wm.SeenHand(Side.LEFT),
    wm.SeenHand(Side.RIGHT),
)


@pytest.fixture
def kitchen():
    """A store in memory with the whole scene in it."""
    store = Store.open()
    for count, observation in enumerate(KITCHEN, start=1):
        assert store_observation(store, observation, (1, count), now=2.0)
    return store


@pytest.fixture
def handled(kitchen):
    """The same after the jar was taken and put back."""
    held = wm.SeenHand(Side.LEFT, "jar_1", "7", Pose((0.0, 0.0, 0.0)))
    for count, observation in enumerate((held, wm.SeenHand(Side.LEFT), KITCHEN[2])):
        assert store_observation(kitchen, observation, (2, count), now=3.0)
    return kitchen

"""A robot's wheels and odometry, as a device of its agent: told where to drive, they tell where it
is.
"""

from collections.abc import Iterator

import msgspec
from agent_runtime.io.devices import Called, Post

from depot.world import STEP_S, Point, along, length, way


class Drive(msgspec.Struct, frozen=True):
    """Drive from here to a station; `speed` in m/s."""

    start: Point
    goal: str
    speed: float


class At(msgspec.Struct, frozen=True, tag=True):
    """It is there now."""

    here: Point


class Arrived(msgspec.Struct, frozen=True, tag=True):
    """It stands at the station."""

    station: str


Sensed = At | Arrived


def driven(word: Drive) -> Iterator[tuple[float, Sensed]]:
    """Yield the sensed places along the way, with the time from now on [s]."""
    points = way(word.start, word.goal)
    total_s = length(points) / word.speed
    for step in range(1, int(total_s / STEP_S) + 1):
        yield step * STEP_S, At(along(points, step * STEP_S * word.speed))
    yield total_s, Arrived(word.goal)


def wheels(post: Post) -> Called:
    """The device."""
    return Called(post, driven)

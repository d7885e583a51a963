"""The depot's small world, kinematics only: stations in two halls, one aisle between them, straight
ways at one speed.

Lengths in m, times in s. No dynamics, no collisions: the aisle is kept free by talking, not by
looking. Every number is an estimate, chosen so that a transport takes some seconds and a person can
follow it.
"""

import math

Point = tuple[float, float]

STATIONS: dict[str, Point] = {
    "receiving": (0.0, 6.0),
    "press": (6.0, 5.0),
    "mule_home": (-2.0, 5.0),
    "store": (0.0, -6.0),
    "shipping": (6.0, -5.0),
    "ox_home": (8.0, -4.0),
}
AISLE: tuple[Point, Point] = ((3.0, 2.0), (3.0, -2.0))
"""Its ends, in the north hall (y > 0) and in the south hall."""
STEP_S = 0.5
"""Period with which a robot learns its place [s]."""


def crosses(start: Point, goal: str) -> bool:
    """Whether the way to a station leads through the aisle."""
    return (start[1] > 0.0) is not (STATIONS[goal][1] > 0.0)


def way(start: Point, goal: str) -> tuple[Point, ...]:
    """The corners of the way, both ends included."""
    north, south = AISLE
    through = () if not crosses(start, goal) else (north, south) if start[1] > 0.0 else (south, north)
    return (start, *through, STATIONS[goal])


def length(points: tuple[Point, ...]) -> float:
    """Length of a way [m]."""
    whole = 0.0
    for a, b in zip(points, points[1:], strict=False):
        whole += math.dist(a, b)
    return whole


def duration(start: Point, goals: tuple[str, ...], speed: float) -> float:
    """Return the time to drive to one station after the other [s]; `speed` in m/s."""
    total, here = 0.0, start
    for goal in goals:
        total += length(way(here, goal)) / speed
        here = STATIONS[goal]
    return total


def along(points: tuple[Point, ...], travelled: float) -> Point:
    """Return the point after `travelled` metres of a way."""
    for a, b in zip(points, points[1:], strict=False):
        leg = math.dist(a, b)
        if travelled < leg:
            part = travelled / leg
            return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])
        travelled -= leg
    return points[-1]

"""Where something can be put down: free spots of the flat surfaces km knows, within the arm's reach, best first."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from companion.languages import wm
from companion.languages.values import Cylinder, Pose, Side
from services.planner.search.steps import Geometry
from velma.kinematics.frames import heading, transform

GRID_M, MARGIN_M = 0.025, 0.05  # placement grid and margin of the published planner (proghtn-backstream@019fd34)
CLEAR_RADIUS_M, CLEAR_HEIGHT_M = 0.14, 0.25  # estimate: the bowl (0.10) and a hand's finger beside it
ABOVE_M = 0.01  # the volume asked about begins so far above the surface (estimate)
BEST_DISTANCE_M, BEST_HEADING = 0.78, math.radians(42.0)  # where runs with the true robot model put and poured
TURNING_M = 0.5  # a radian away from the best heading is as bad as so many metres from the best distance (estimate)
SPOTS = 8  # so many free ones suffice (estimate)
NEAR_M = 0.05  # so near one that is not free, another one is not asked about (estimate)


@dataclass(frozen=True)
class Spot:
    """A point (3,) [m] on a flat surface of the thing `surface`."""

    surface: str
    at: np.ndarray


def spots(geometry: Geometry, state: str, side: Side, foot: float, name: str) -> list[Spot]:
    """Free spots for the thing `name`, which stands on a disc of radius `foot` [m]; where it stood counts as free."""
    free: list[Spot] = []
    taken: list[Spot] = []
    for spot in _by_distance(_within_reach(geometry, state, side, foot), side):
        if any(np.linalg.norm(spot.at - other.at) < NEAR_M for other in taken):
            continue
        (free if _clear(geometry, state, spot, name) else taken).append(spot)
        if len(free) == SPOTS:
            break
    return free


def _within_reach(geometry: Geometry, state: str, side: Side, foot: float) -> Iterator[Spot]:
    reach = geometry.ask(wm.RobotReach(state=state, side=side), wm.Reach)
    for surface in geometry.ask(wm.FlatSurfaces(state=state), wm.Surfaces).surfaces:
        for at in _grid(surface, foot):
            if reach.near < min(float(np.linalg.norm(at - np.array(s))) for s in reach.shoulders) < reach.far:
                yield Spot(surface.object, at)


def _grid(surface: wm.Surface, foot: float) -> Iterator[np.ndarray]:
    """Points of a surface (3,), far enough from its edges."""
    frame = transform(surface.at)
    half = [s / 2 - foot - MARGIN_M for s in surface.size]
    for x in np.arange(-half[0], half[0] + 1e-9, GRID_M):
        for y in np.arange(-half[1], half[1] + 1e-9, GRID_M):
            yield frame.act(np.array([x, y, 0.0]))


def _by_distance(found: Iterator[Spot], side: Side) -> list[Spot]:
    """Those first that are nearest to where putting down and pouring went well."""
    wanted = -BEST_HEADING if side is Side.RIGHT else BEST_HEADING

    def far_off(spot: Spot) -> float:
        away = abs(math.hypot(spot.at[0], spot.at[1]) - BEST_DISTANCE_M)
        return away + TURNING_M * abs(heading(spot.at) - wanted)

    return sorted(found, key=far_off)


def _clear(geometry: Geometry, state: str, spot: Spot, name: str) -> bool:
    """Whether nothing else reaches into the space above the spot."""
    x, y, z = (float(v) for v in spot.at)
    volume = Cylinder(CLEAR_RADIUS_M, CLEAR_HEIGHT_M, Pose((x, y, z + ABOVE_M + CLEAR_HEIGHT_M / 2)))
    query = wm.CollisionsInVolume(state=state, volume=volume, ignored=(name, spot.surface))
    return not geometry.ask(query, wm.Objects).objects

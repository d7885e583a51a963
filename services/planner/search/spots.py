"""Places to put something down: free spots on flat surfaces that km knows, in reach of the arm, best first."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from companion.languages import wm
from companion.languages.values import Cylinder, Pose, Side
from services.planner.search.steps import Geometry
from velma.kinematics.frames import heading, standing, transform

GRID_M, MARGIN_M = 0.025, 0.05  # placement grid and margin of the published planner (proghtn-backstream@019fd34)
ABOVE_M = 0.01  # height above the surface where the volume starts that has to be free (estimate)
BEST_DISTANCE_M, BEST_HEADING = 0.78, math.radians(42.0)  # where runs with the true robot model put and poured
TURNING_M = 0.5  # a radian from the best heading is as bad as this distance [m] from the best distance (estimate)
TURNED = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)  # [rad] angles of the torso for which reach is computed (estimate)
TOGETHER = 8  # spots tried together (estimate)
NEAR_M = 0.05  # [m] from a spot that is not free; once more from those tried for each time (estimate)


@dataclass(frozen=True)
class Volume:
    """An upright cylinder above a spot [m]."""

    radius: float
    height: float


# estimate: the bowl (0.10) and a finger beside it; a jar (0.20) that comes down from 0.10 above, so no shelf
FROM_ABOVE = Volume(0.14, 0.35)


@dataclass(frozen=True)
class Spot:
    """A point (3,) [m] on a flat surface of the thing `surface`."""

    surface: str
    at: np.ndarray

    def near(self, others: Iterable["Spot"], distance: float = NEAR_M) -> bool:
        """Whether one of the others is close to it."""
        return any(np.linalg.norm(self.at - other.at) < distance for other in others)


def spots(
    geometry: Geometry, state: str, side: Side, foot: float, name: str, on: tuple[str, ...] = ()
) -> Iterator[list[Spot]]:
    """Yield free spots for the thing `name`, which stands on a disc of radius `foot` [m], some at a time; `on`: on this
    furniture alone.

    Those above the shoulders come last. km is asked only for the spots that are used. The spot where the thing itself
    stood counts as free."""
    reach = geometry.ask(wm.RobotReach(state=state, side=side), wm.Reach)
    surfaces = geometry.ask(wm.FlatSurfaces(state=state), wm.Surfaces).surfaces
    near = _within(reach, (one for one in surfaces if not on or one.object in on), foot)
    shoulder = max(s[2] for s in reach.shoulders)
    for overhead in (False, True):
        found = [spot for spot in near if (spot.at[2] > shoulder) == overhead]
        yield from _free(geometry, state, sorted(found, key=lambda spot: _far_off(spot, side)), name)


def _free(geometry: Geometry, state: str, found: list[Spot], name: str) -> Iterator[list[Spot]]:
    """Yield free spots, each time farther from those before: beside some that did not do, others rarely do."""
    taken: list[Spot] = []
    tried: list[Spot] = []
    free: list[Spot] = []
    apart = NEAR_M
    for spot in found:
        if spot.near(taken) or spot.near(tried, apart):
            continue
        (free if clear(geometry, state, spot, name) else taken).append(spot)
        if len(free) == TOGETHER:
            yield free
            tried, free, apart = [*tried, *free], [], apart + NEAR_M
    if free:
        yield free


def _within(reach: wm.Reach, surfaces: Iterable[wm.Surface], foot: float) -> list[Spot]:
    """Return the spots that the arm reaches with the torso turned."""
    shoulders = [standing((0.0, 0.0, 0.0), torso).act(np.array(s)) for s in reach.shoulders for torso in TURNED]
    found = [Spot(surface.object, at) for surface in surfaces for at in grid(surface, foot)]
    return [s for s in found if reach.near < min(np.linalg.norm(s.at - x) for x in shoulders) < reach.far]


def _far_off(spot: Spot, side: Side) -> float:
    """Return how far a spot is from where putting down and pouring went well [m]."""
    wanted = -BEST_HEADING if side is Side.RIGHT else BEST_HEADING
    away = abs(math.hypot(spot.at[0], spot.at[1]) - BEST_DISTANCE_M)
    return away + TURNING_M * abs(heading(spot.at) - wanted)


def grid(surface: wm.Surface, foot: float, margin: float = MARGIN_M) -> Iterator[np.ndarray]:
    """Yield points of a surface (3,), far enough from its edges."""
    frame = transform(surface.at)
    half = [s / 2 - foot - margin for s in surface.size]
    for x in np.arange(-half[0], half[0] + 1e-9, GRID_M):
        for y in np.arange(-half[1], half[1] + 1e-9, GRID_M):
            yield frame.act(np.array([x, y, 0.0]))


def clear(geometry: Geometry, state: str, spot: Spot, name: str, room: Volume = FROM_ABOVE) -> bool:
    """Whether the space above the spot is free, also of other parts of the thing it is on."""
    x, y, z = (float(v) for v in spot.at)
    volume = Cylinder(room.radius, room.height, Pose((x, y, z + ABOVE_M + room.height / 2)))
    query = wm.CollisionsInVolume(state=state, volume=volume, ignored=(name,))
    return not geometry.ask(query, wm.Objects).objects

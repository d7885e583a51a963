"""Places to put something down: free spots on flat surfaces that km knows, in reach of the arm, best first."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from companion.languages import wm
from companion.languages.values import Cylinder, Pose, Side
from companion.planning.steps import Geometry
from velma.kinematics.frames import heading, transform
from velma.kinematics.tasks.placing import FROM_ABOVE, Volume, points_on, turned, within

GRID_M, MARGIN_M = 0.025, 0.05  # placement grid and margin of the published planner (proghtn-backstream@019fd34)
BEST_DISTANCE_M, BEST_HEADING = 0.78, math.radians(42.0)  # where runs with the true robot model put and poured
TURNING_M = 0.5  # a radian from the best heading is as bad as this distance [m] from the best distance (estimate)
TOGETHER = 8  # spots tried together (estimate)
NEAR_M = 0.05  # [m] from a spot that is not free; once more from those tried for each time (estimate)


@dataclass(frozen=True)
class Spot:
    """A point (3,) [m] on a flat surface of the thing `surface`."""

    surface: str
    at: np.ndarray

    def near(self, others: Iterable["Spot"], distance: float = NEAR_M) -> bool:
        """Whether one of the others is close to it."""
        return any(math.dist(self.at, other.at) < distance for other in others)


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
    shoulders = turned(reach.shoulders)
    found = [Spot(surface.object, at) for surface in surfaces for at in grid(surface, foot)]
    return [spot for spot in found if within(spot.at, shoulders, reach.near, reach.far)]


def _far_off(spot: Spot, side: Side) -> float:
    """Return how far a spot is from where putting down and pouring went well [m]."""
    wanted = -BEST_HEADING if side is Side.RIGHT else BEST_HEADING
    away = abs(math.hypot(spot.at[0], spot.at[1]) - BEST_DISTANCE_M)
    return away + TURNING_M * abs(heading(spot.at) - wanted)


def grid(surface: wm.Surface, foot: float, margin: float = MARGIN_M) -> Iterator[np.ndarray]:
    """Yield points of a surface (3,), far enough from its edges."""
    yield from points_on(transform(surface.at), surface.size, foot, margin=margin, spacing=GRID_M)


def clear(geometry: Geometry, state: str, spot: Spot, name: str, room: Volume = FROM_ABOVE) -> bool:
    """Whether the space above the spot is free, also of other parts of the thing it is on."""
    volume = Cylinder(room.radius, room.height, Pose(room.centre(spot.at)))
    query = wm.CollisionsInVolume(state=state, volume=volume, ignored=(name,))
    return not geometry.ask(query, wm.Objects).objects

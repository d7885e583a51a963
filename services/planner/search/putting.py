"""Primitive tasks that put something down and bring an empty arm home."""

import math
from collections.abc import Iterator
from itertools import islice

import numpy as np
import pinocchio as pin

from companion.languages import rc, wm
from companion.languages.values import Cylinder, Pose, Side
from services.planner.search.situation import Held, on_wire
from services.planner.search.steps import (
    DOWN_SPEED,
    EFFORTS,
    EMPTY_SPEED,
    LOADED_SPEED,
    OPEN_S,
    QUICK,
    RETREAT_SPEED,
    Geometry,
    Step,
    approach_points,
    arrived,
    move,
)
from velma import names
from velma.kinematics.frames import transform
from velma.kinematics.tasks.placing import Placing, backwards, placings

CARRIED_TILT = (math.radians(25.0), math.radians(60.0))  # [rad] tried in turn; an empty bowl may tilt
GRID_M, MARGIN_M = 0.025, 0.05  # placement grid and margin of the published planner
CLEAR_RADIUS_M, CLEAR_HEIGHT_M = 0.14, 0.25  # estimate: the bowl (0.10) and a hand's finger beside it
BEST_DISTANCE_M, BEST_HEADING = 0.78, math.radians(42.0)  # where runs with the true robot model put and poured
SPOTS, PLACINGS, TRIES = 8, 12, 300  # spots asked about, placings chosen from, samples tried (estimates)
HOME_TORSO = (0.0, -0.3, 0.3, -0.6, 0.6, -0.9, 0.9)  # [rad], same runs


def spots(
    geometry: Geometry, state: str, side: Side, foot: float, ignored: tuple[str, ...]
) -> list[tuple[str, np.ndarray]]:
    """Free spots within the arm's reach, best first: whose flat surface, where (3,); `foot`: radius of the base [m]."""
    reach = geometry.ask(wm.RobotReach(state=state, side=side), wm.Reach)
    shoulders = [np.array(s) for s in reach.shoulders]
    wanted = -BEST_HEADING if side is Side.RIGHT else BEST_HEADING
    candidates = []
    for surface in geometry.ask(wm.FlatSurfaces(state=state), wm.Surfaces).surfaces:
        for spot in _grid(surface, foot):
            distance = min(float(np.linalg.norm(spot - s)) for s in shoulders)
            if reach.near < distance < reach.far:
                away = abs(math.hypot(spot[0], spot[1]) - BEST_DISTANCE_M)
                candidates.append((away + 0.5 * abs(math.atan2(spot[1], spot[0]) - wanted), surface.object, spot))
    free = []
    for _, surface_object, spot in sorted(candidates, key=lambda c: c[0])[: 3 * SPOTS]:
        if _clear(geometry, state, spot, (*ignored, surface_object)):
            free.append((surface_object, spot))
        if len(free) == SPOTS:
            break
    return free


def _grid(surface: wm.Surface, foot: float) -> Iterator[np.ndarray]:
    frame = transform(surface.at)
    half = [s / 2 - foot - MARGIN_M for s in surface.size]
    for x in np.arange(-half[0], half[0] + 1e-9, GRID_M):
        for y in np.arange(-half[1], half[1] + 1e-9, GRID_M):
            yield frame.act(np.array([x, y, 0.0]))


def _clear(geometry: Geometry, state: str, spot: np.ndarray, ignored: tuple[str, ...]) -> bool:
    x, y, z = (float(v) for v in spot)
    volume = Cylinder(CLEAR_RADIUS_M, CLEAR_HEIGHT_M, Pose((x, y, z + 0.01 + CLEAR_HEIGHT_M / 2)))
    query = wm.CollisionsInVolume(state=state, volume=volume, ignored=ignored)
    return not geometry.ask(query, wm.Objects).objects


def place(geometry: Geometry, state: str, side: Side) -> Step | None:
    """Put the held object on a flat surface, let go, retreat."""
    here = geometry.at(state)
    held = here.held[side]
    grasp = geometry.ask(wm.GraspDefinition(state=state, object=held.object, grasp=held.grasp), wm.Grasps).grasps[0]
    retreat = backwards([(transform(s.pose).inverse(), s.fingers) for s in grasp.steps])
    model = geometry.ask(wm.ObjectModel(state=state, object=held.object), wm.ModelOf)
    free = spots(geometry, state, side, model.base_radius, (held.object,))
    if not free:
        geometry.failed(f"no free place within reach of the {side} arm for {held.object}")
        return None
    origin = np.array([0.0, 0.0, model.base_z])
    found = placings(
        geometry.robot, here.world, side, here.q, held.object, held.T_grip_object,
        [(surface, spot - origin) for surface, spot in free], retreat,
        geometry.rng("place", held.object, side), tries=TRIES,
    )  # fmt: skip
    some = list(islice(found, PLACINGS))
    for largest_tilt, efforts in zip(CARRIED_TILT, (QUICK, EFFORTS), strict=True):
        reached = geometry.free_motion(here, side, [p.above for p in some], largest_tilt=largest_tilt, efforts=efforts)
        if reached is not None:
            index, path = reached
            return _placing(geometry, held, some[index], retreat, side, path, free)
    geometry.failed(f"the {side} arm finds no way to put {held.object} down")
    return None


def _placing(
    geometry: Geometry,
    held: Held,
    placing: Placing,
    retreat: list[tuple[pin.SE3, float]],
    side: Side,
    path: list[np.ndarray],
    free: list[tuple[str, np.ndarray]],
) -> Step:
    surface = min(free, key=lambda s: float(np.linalg.norm((s[1] - placing.place.translation)[:2])))[0]
    commands = (
        move(side, path, LOADED_SPEED),
        rc.Release(
            key="",
            side=side,
            object=held.object,
            surface=surface,
            place=on_wire(placing.place),
            retreat=approach_points(retreat),
        ),
    )
    changes = (
        wm.Released(side=side),
        wm.Moved(object=held.object, pose=on_wire(placing.place), on=surface, exact=False),
        *arrived(side, placing.way_back[-1], retreat[0][1]),
    )
    duration = (
        geometry.duration(path, LOADED_SPEED)
        + geometry.duration(placing.way_down, DOWN_SPEED)
        + OPEN_S
        + geometry.duration(placing.way_back, RETREAT_SPEED)
    )
    return Step(f"place {held.object}", commands, changes, duration)


def home(geometry: Geometry, state: str, side: Side) -> Step | None:
    """Bring an empty arm to its start posture; the torso goes where that is free."""
    here = geometry.at(state)
    goals = []
    for torso in (float(here.q[names.TORSO]), *HOME_TORSO):
        goal = here.q.copy()
        goal[names.ARM[side]] = names.START[names.ARM[side]]
        goal[names.TORSO] = torso
        if here.world.free(goal):
            goals.append(goal)
    reached = geometry.free_motion(here, side, goals)
    if reached is None:
        geometry.failed(f"the {side} arm finds no way home")
        return None
    _, path = reached
    speed = LOADED_SPEED if here.loaded() else EMPTY_SPEED
    return Step(
        f"{side} arm home",
        (move(side, path, speed, 1.0),),
        arrived(side, path[-1], 1.0),
        geometry.duration(path, speed),
    )

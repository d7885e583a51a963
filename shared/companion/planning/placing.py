"""Where a held thing can be put down, and the primitive step that puts it there."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
import pinocchio as pin

from companion.languages import hfsm, rc, wm
from companion.languages.cmd import BACK
from companion.languages.facts import Kind, fact
from companion.languages.values import Cylinder, Pose, Shape, Side
from companion.models import TALL_M, looked_into
from companion.planning.grasping import ANY_TORSO, TORSO, preferred
from companion.planning.steps import (
    EFFORTS,
    QUICK,
    Geometry,
    Held,
    Situation,
    Step,
    approach_points,
    configured,
    hand_steps,
    move,
    on_wire,
)
from velma.kinematics.frames import heading, transform
from velma.kinematics.motion import Motion
from velma.kinematics.shapes import solid
from velma.kinematics.tasks import DOWN_SPEED, LOADED_SPEED, RETREAT_SPEED
from velma.kinematics.tasks.grasping import LIFT_M, GraspWay
from velma.kinematics.tasks.inserting import Opening, insertions
from velma.kinematics.tasks.placing import (
    FROM_ABOVE,
    Placing,
    Volume,
    backwards,
    placings,
    points_on,
    turned,
    within,
)

# --- Places to put something down: free spots on flat surfaces that km knows, in reach of the arm,
# best first


# placement grid and margin of the published planner (proghtn-backstream@019fd34)
GRID_M, MARGIN_M = 0.025, 0.05
# where runs with the true robot model put and poured
BEST_DISTANCE_M, BEST_HEADING = 0.78, math.radians(42.0)
# a radian from the best heading is as bad as this distance [m] from the best distance (estimate)
TURNING_M = 0.5
TOGETHER = 8  # spots tried together (estimate)
BATCHES = 6  # times that spots are tried, of low ones and of high ones (estimate)
# [m] from a spot that is not free; once more from those tried for each time (estimate)
NEAR_M = 0.05


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
    """Yield free spots for the thing `name`, which stands on a disc of radius `foot` [m], some at a
    time; `on`: on this furniture alone.

    Those come last where it stands too high to be looked into. km is asked only for the spots that
    are used. The spot where the thing itself stood counts as free.
    """
    reach = geometry.ask(wm.RobotReach(state=state, side=side), wm.Reach)
    surfaces = geometry.ask(wm.FlatSurfaces(state=state), wm.Surfaces).surfaces
    shoulders = turned(reach.shoulders)
    there = (one for one in surfaces if not on or one.object in on)
    all_spots = (Spot(one.object, at) for one in there for at in grid(one, foot))
    near = [spot for spot in all_spots if within(spot.at, shoulders, reach.near, reach.far)]
    wanted = -BEST_HEADING if side is Side.RIGHT else BEST_HEADING

    def far_off(spot: Spot) -> float:
        """From where putting down and pouring went well [m]."""
        away = abs(math.hypot(spot.at[0], spot.at[1]) - BEST_DISTANCE_M)
        return away + TURNING_M * abs(heading(spot.at) - wanted)

    for low in (True, False):
        found = [spot for spot in near if looked_into(*np.add(spot.at, (0.0, 0.0, TALL_M))) == low]
        yield from islice(_free(geometry, state, sorted(found, key=far_off), name), BATCHES)


def _free(geometry: Geometry, state: str, found: list[Spot], name: str) -> Iterator[list[Spot]]:
    """Yield free spots, each time farther from those before: beside some that did not do, others
    rarely do.
    """
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


def grid(surface: wm.Surface, foot: float, margin: float = MARGIN_M) -> Iterator[np.ndarray]:
    """Yield points of a surface (3,), far enough from its edges."""
    yield from points_on(transform(surface.at), surface.size, foot, margin=margin, spacing=GRID_M)


def clear(geometry: Geometry, state: str, spot: Spot, name: str, room: Volume = FROM_ABOVE) -> bool:
    """Whether the space above the spot is free, also of other parts of the thing it is on."""
    volume = Cylinder(room.radius, room.height, Pose(room.centre(spot.at)))
    query = wm.CollisionsInVolume(state=state, volume=volume, ignored=(name,))
    return not geometry.ask(query, wm.Objects).objects


# --- Goal places of a thing -----------------------------------------------------------------------


BESIDE_M = 0.02  # room beside a thing behind an opening, for a finger (estimate)
BEHIND_OPENING = 12  # free places behind an opening that are tried (estimate)
EDGE_M = 0.01  # from the foot of a thing to the edge of a shelf (estimate)
NEXT_M = 0.08  # between two of them (estimate)


@dataclass(frozen=True)
class Surfaces:
    """Furniture that a thing may be put on from above, all of it where none is named; there a
    single spot, if any.
    """

    on: tuple[str, ...] = ()
    spot: Spot | None = None


@dataclass(frozen=True)
class Inside:
    """Free spots behind an opening, best first."""

    opening: Opening
    spots: tuple[Spot, ...]


Place = Surfaces | Inside


def places(geometry: Geometry, state: str, name: str, where: str) -> Iterator[Place]:
    """Yield where a thing may go; `where`: an id or class of furniture, BACK, or "" for any
    surface.
    """
    facts = geometry.facts
    if not where:
        yield Surfaces()
        return
    if where == BACK:
        origin = facts.origin(state, name)
        if not origin.on:
            geometry.failed(fact(Kind.FIRST_PLACE_UNKNOWN, name))
            return
        spot = Spot(
            origin.on, np.add(origin.pose.xyz, (0.0, 0.0, geometry.model(state, name).base_z))
        )
        if facts.container(state, origin.on) and spot.at[2] < _edges(geometry, state, origin.on)[1]:
            yield from _inside(geometry, state, name, origin.on, [spot])
        else:
            yield Surfaces((origin.on,), spot)
        return
    known = facts.places(state, where)
    if on := tuple(one for one in known if not facts.container(state, one)):
        yield Surfaces(on)
    for around in known:
        if facts.container(state, around):
            yield from _inside(geometry, state, name, around, _grid(geometry, state, name, around))


def _inside(
    geometry: Geometry, state: str, name: str, around: str, spots: list[Spot]
) -> Iterator[Place]:
    """Yield the free ones of these spots."""
    model = geometry.model(state, name)
    corners = np.concatenate([_corners(shape) for shape in model.shapes])
    # What it needs behind the opening, from its base up.
    radius, top = float(np.abs(corners[:, :2]).max()), float(corners[:, 2].max())
    room = Volume(radius + BESIDE_M, top - model.base_z + LIFT_M)
    free: list[Spot] = []
    for spot in spots:
        if (
            len(free) < BEHIND_OPENING
            and not spot.near(free, NEXT_M)
            and clear(geometry, state, spot, name, room)
        ):
            free.append(spot)
    if free:
        yield Inside(opening(geometry, state, name, around), tuple(free))
    else:
        geometry.failed(fact(Kind.NO_ROOM, name, around))


def _grid(geometry: Geometry, state: str, name: str, around: str) -> list[Spot]:
    """Spots on the shelves below the top of the opening, those near the middle of a shelf first."""
    shelves = geometry.ask(wm.FlatSurfaces(state=state, object=around), wm.Surfaces).surfaces
    middle, top = _edges(geometry, state, around)
    foot = geometry.model(state, name).base_radius
    found = [
        (
            float(np.linalg.norm(at - shelf.at.xyz)) + abs(shelf.at.xyz[2] - middle),
            number,
            Spot(around, at),
        )
        for number, shelf in enumerate(shelves)
        if shelf.at.xyz[2] < top
        for at in grid(shelf, foot, EDGE_M)
    ]
    return [spot for _, _, spot in sorted(found, key=lambda one: one[:2])]


def opening(geometry: Geometry, state: str, name: str, around: str) -> Opening:
    """The opening of furniture, and how far a thing has to come out of it."""
    out = geometry.outwards(state, around)
    grasps = geometry.ask(wm.GraspSet(state=state, object=name), wm.Grasps).grasps
    return Opening(around, out, grasps[0].out)


def _edges(geometry: Geometry, state: str, around: str) -> tuple[float, float]:
    """The heights of middle and upper edge of an opening [m]."""
    hole = geometry.ask(wm.ObjectHole(state=state, object=around), wm.Hole)
    middle = float(geometry.pose(state, around).act(np.array(hole.centre))[2])
    return middle, middle + hole.radius


def _corners(shape: Shape) -> np.ndarray:
    """The corners (8, 3) of the box around a shape, in the frame of its thing."""
    around = solid(shape)
    around.computeLocalAABB()
    low, high = around.aabb_local.min_, around.aabb_local.max_
    at = transform(shape.at)
    return np.array([at.act(np.array(corner)) for corner in product(*zip(low, high, strict=True))])


# --- Where a held thing can be put down, and the primitive step that puts it there ----------------


# --- Grasps and places behind an opening that go together -----------------------------------------


INSERTIONS, BEST = 6, 3  # looked for; each takes 30 ms (measured on the canonical scene)


def inserted(
    geometry: Geometry,
    here: Situation,
    side: Side,
    name: str,
    target: Inside,
    known: list[GraspWay],
    number: str = "",
) -> list[tuple[str, Placing]]:
    """Some grasps of the known ones, each with a place for the thing behind the opening.

    Those come first after which the hand gets farthest away, so that it is out of the opening
    before it goes home.
    """
    base_z = geometry.model(here.state, name).base_z
    kind = preferred(geometry, here.state, name)[0].kind
    found = insertions(
        geometry.robot,
        here.world,
        side,
        here.q,
        name,
        target.opening,
        [spot.at - (0.0, 0.0, base_z) for spot in target.spots],
        known,
        geometry.rng("insert", name, side, number),
        torso=TORSO.get(kind, ANY_TORSO),
        wanted=INSERTIONS,
    )
    return sorted(
        islice(found, INSERTIONS),
        key=lambda one: float(np.linalg.norm(one[1].retreat[-1][0].translation)),
        reverse=True,
    )


# --- Where a held thing can be put down, and the primitive step that puts it there ----------------


# [rad] largest tilt of a thing on its way, and iterations of a tree, tried in turn: an empty bowl
# may tilt more. At 60 degrees it slipped in the fingers in two runs (doors, seed 10; hard errors of
# eyes, seed 223), at 40 in neither.
CARRIED_TILT = (
    (math.radians(25.0), QUICK),
    (math.radians(40.0), EFFORTS),
    (math.radians(60.0), EFFORTS),
)
PLACINGS, TRIES = 12, 300  # placings to choose from, samples tried (estimates)
LET_GO_S = 3.5
"""[s] in which a hand opens and its motions settle, beside its ways; only for the expected
duration. Measured in a fleet: 2.9 to 3.0 s with a bowl, 3.9 to 4.3 s with a jar, which it has to
open wider for, 6 times each.
"""
Way = Sequence[np.ndarray]
"""Offsets (3,) [m] from a place, through which an object comes; none: straight from above."""
Retreat = list[tuple[pin.SE3, float]]
"""Grip poses relative to the releasing grip, with finger angles [rad], nearest first."""


def place(geometry: Geometry, state: str, side: Side, where: str = "") -> Step | None:
    """The step that puts the held object on a flat surface, opens the hand and retreats; `where`:
    see places.
    """
    here = geometry.at(state)
    held = here.held[side]
    retreat = retreating(geometry, state, held.object, held.grasp)
    for target in places(geometry, state, held.object, where):
        if isinstance(target, Surfaces):
            found = above(geometry, here, side, retreat, target)
            way: Way = ()
        else:
            found = _through(geometry, here, side, retreat, target)
            way = target.opening.way
        if found is not None:
            return _placing(geometry, held, found[0], side, found[1], way)
    return None


def above(
    geometry: Geometry, here: Situation, side: Side, retreat: Retreat, target: Surfaces
) -> tuple[Placing, Motion] | None:
    """A place for the held object and the motion to above it; None, with the reason noted, if there
    is none.
    """
    held, state = here.held[side], here.state
    model = geometry.model(state, held.object)
    if target.spot is None:
        some_spots = spots(geometry, state, side, model.base_radius, held.object, target.on)
    else:
        some_spots = iter(
            [[target.spot]] if clear(geometry, state, target.spot, held.object) else []
        )
    tried = 0
    for free in some_spots:
        tried += len(free)
        some = placings(
            geometry.robot,
            here.world,
            side,
            here.q,
            held.object,
            held.T_grip_object,
            [(spot.surface, spot.at - (0.0, 0.0, model.base_z)) for spot in free],
            retreat,
            geometry.rng("place", held.object, side),
            tries=TRIES,
        )
        found = reached(geometry, here, side, list(islice(some, PLACINGS)))
        if found is not None:
            return found
    kind = Kind.NO_WAY_TO_PUT_DOWN if tried else Kind.NO_PLACE_WITHIN_REACH
    geometry.failed(fact(kind, side, held.object))
    return None


def _through(
    geometry: Geometry, here: Situation, side: Side, retreat: Retreat, target: Inside
) -> tuple[Placing, Motion] | None:
    """A place behind an opening and the motion to before it; None, with the reason noted, if there
    is none.
    """
    held = here.held[side]
    T_held = held.T_grip_object
    outermost_first = [
        (T_release_grip.inverse() * T_held, fingers)
        for T_release_grip, fingers in reversed(retreat)
    ]
    way = GraspWay(held.grasp, (*outermost_first, (T_held, retreat[0][1])))
    some = [placing for _, placing in inserted(geometry, here, side, held.object, target, [way])]
    found = reached(geometry, here, side, some[:BEST]) or reached(geometry, here, side, some[BEST:])
    if found is None:
        geometry.failed(fact(Kind.NO_WAY_INTO, side, held.object, target.opening.name))
    return found


def reached(
    geometry: Geometry, here: Situation, side: Side, some: list[Placing]
) -> tuple[Placing, Motion] | None:
    """One of the placings and the motion to its start; what was poured into the object is not
    tilted out.
    """
    goals, name = [placing.above for placing in some], here.held[side].object
    for number, (largest_tilt, efforts) in enumerate(CARRIED_TILT if goals else ()):
        if number and geometry.facts.filled(here.state, name):
            break
        reached = geometry.free_motion(
            here, side, goals, largest_tilt=largest_tilt, efforts=efforts
        )
        if reached is not None:
            return some[reached[0]], reached[1]
    return None


def retreating(geometry: Geometry, state: str, name: str, grasp: str) -> Retreat:
    """The retreat of the hand from a known grasp."""
    query = wm.GraspDefinition(state=state, object=name, grasp=grasp)
    return backwards(hand_steps(geometry.ask(query, wm.Grasps).grasps[0]))


def _placing(
    geometry: Geometry, held: Held, placing: Placing, side: Side, motion: Motion, way: Way
) -> Step:
    """The step of a solved placing; `motion` leads above it, or to the beginning of the `way`
    there.
    """
    commands = (
        move(side, motion, LOADED_SPEED),
        rc.Release(
            key="",
            side=side,
            object=held.object,
            surface=placing.support,
            place=on_wire(placing.place),
            retreat=approach_points(placing.retreat),
            way=tuple((float(x), float(y), float(z)) for x, y, z in way),
        ),
    )
    changes = (
        wm.Released(side=side),
        wm.Moved(object=held.object, pose=on_wire(placing.place), on=placing.support, exact=False),
        *configured(side, placing.way_back[-1], placing.retreat[0][1]),
    )
    duration = motion.duration + geometry.duration(placing.way_down, DOWN_SPEED) + LET_GO_S
    duration += geometry.duration(placing.way_back, RETREAT_SPEED)
    return Step(hfsm.Step("place", (held.object,)), commands, changes, duration)

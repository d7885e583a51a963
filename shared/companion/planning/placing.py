"""Where a held thing can be put down, and the primitive step that puts it there."""

import math
from collections.abc import Sequence
from itertools import islice

import numpy as np
import pinocchio as pin

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning.grasping import ANY_TORSO, TORSO, preferred
from companion.planning.places import Inside, Spot, Surfaces, clear, places, spots
from companion.planning.situation import Held, Situation, configured, on_wire
from companion.planning.steps import EFFORTS, OPEN_S, QUICK, Geometry, Step, approach_points, hand_steps, move
from velma.kinematics.motion import Motion
from velma.kinematics.tasks.grasping import GraspWay
from velma.kinematics.tasks.inserting import insertions
from velma.kinematics.tasks.placing import Placing, backwards, placings
from velma.kinematics.tasks.speeds import DOWN_SPEED, LOADED_SPEED, RETREAT_SPEED

# --- Grasps and places behind an opening that go together ------------------------------------------------------------


INSERTIONS, BEST = 6, 3  # looked for; each takes 30 ms (measured on the canonical scene)


def inserted(
    geometry: Geometry, here: Situation, side: Side, name: str, target: Inside, known: list[GraspWay], number: str = ""
) -> list[tuple[str, Placing]]:
    """Return some grasps of the known ones, each with a place for the thing behind the opening.

    Those come first after which the hand gets farthest away, so that it is out of the opening before it goes home.
    """
    base_z, kind = geometry.model(here.state, name).base_z, preferred(geometry, here.state, name)[0].kind
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
    return sorted(islice(found, INSERTIONS), key=_away, reverse=True)


def _away(found: tuple[str, Placing]) -> float:
    """Return how far the open hand is drawn away [m]."""
    return float(np.linalg.norm(found[1].retreat[-1][0].translation))


# --- Where a held thing can be put down, and the primitive step that puts it there ------------------------------------


# [rad] largest tilt of a thing on its way, and iterations of a tree, tried in turn: an empty bowl may tilt more. At 60
# degrees it slipped in the fingers in two runs (doors, seed 10; hard errors of eyes, seed 223), at 40 in neither.
CARRIED_TILT = ((math.radians(25.0), QUICK), (math.radians(40.0), EFFORTS), (math.radians(60.0), EFFORTS))
PLACINGS, TRIES = 12, 300  # placings to choose from, samples tried (estimates)
BATCHES = 6  # groups of spots tried (estimate)
Way = Sequence[np.ndarray]
"""Offsets (3,) [m] from a place, through which an object comes; none: straight from above."""
Retreat = list[tuple[pin.SE3, float]]
"""Grip poses relative to the releasing grip, with finger angles [rad], nearest first."""


def place(geometry: Geometry, state: str, side: Side, where: str = "") -> Step | None:
    """Return the step that puts the held object on a flat surface, opens the hand and retreats; `where`: see places."""
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
    """Return a place for the held object and the motion to above it; None, with the reason noted, if there is none."""
    held, state = here.held[side], here.state
    model = geometry.model(state, held.object)
    if target.spot is None:
        some_spots = spots(geometry, state, side, model.base_radius, held.object, target.on)
    else:
        some_spots = iter([[target.spot]] if clear(geometry, state, target.spot, held.object) else [])
    tried = 0
    for free in islice(some_spots, BATCHES):
        tried += len(free)
        found = reached(geometry, here, side, _solved(geometry, here, side, free, model.base_z, retreat))
        if found is not None:
            return found
    kind = Kind.NO_WAY_TO_PUT_DOWN if tried else Kind.NO_PLACE_WITHIN_REACH
    geometry.failed(fact(kind, side, held.object))
    return None


def _through(
    geometry: Geometry, here: Situation, side: Side, retreat: Retreat, target: Inside
) -> tuple[Placing, Motion] | None:
    """Return a place behind an opening and the motion to before it; None, with the reason noted, if there is none."""
    held = here.held[side]
    T_held = held.T_grip_object
    outermost_first = [(T_release_grip.inverse() * T_held, fingers) for T_release_grip, fingers in reversed(retreat)]
    way = GraspWay(held.grasp, (*outermost_first, (T_held, retreat[0][1])))
    some = [placing for _, placing in inserted(geometry, here, side, held.object, target, [way])]
    found = reached(geometry, here, side, some[:BEST]) or reached(geometry, here, side, some[BEST:])
    if found is None:
        geometry.failed(fact(Kind.NO_WAY_INTO, side, held.object, target.opening.name))
    return found


def reached(geometry: Geometry, here: Situation, side: Side, some: list[Placing]) -> tuple[Placing, Motion] | None:
    """Return one of the placings and the motion to its start; what was poured into the object is not tilted out."""
    goals, name = [placing.above for placing in some], here.held[side].object
    for number, (largest_tilt, efforts) in enumerate(CARRIED_TILT if goals else ()):
        if number and geometry.facts.filled(here.state, name):
            break
        reached = geometry.free_motion(here, side, goals, largest_tilt=largest_tilt, efforts=efforts)
        if reached is not None:
            return some[reached[0]], reached[1]
    return None


def retreating(geometry: Geometry, state: str, name: str, grasp: str) -> Retreat:
    """Return the retreat of the hand from a known grasp."""
    query = wm.GraspDefinition(state=state, object=name, grasp=grasp)
    return backwards(hand_steps(geometry.ask(query, wm.Grasps).grasps[0]))


def _solved(
    geometry: Geometry, here: Situation, side: Side, free: list[Spot], base_z: float, retreat: Retreat
) -> list[Placing]:
    """Return some placings on the free spots; `base_z`: height of the object's base in its frame [m]."""
    held = here.held[side]
    found = placings(
        geometry.robot,
        here.world,
        side,
        here.q,
        held.object,
        held.T_grip_object,
        [(spot.surface, spot.at - (0.0, 0.0, base_z)) for spot in free],
        retreat,
        geometry.rng("place", held.object, side),
        tries=TRIES,
    )
    return list(islice(found, PLACINGS))


def _placing(geometry: Geometry, held: Held, placing: Placing, side: Side, motion: Motion, way: Way) -> Step:
    """Return the step of a solved placing; `motion` leads above it, or to the beginning of the `way` there."""
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
    duration = (
        motion.duration
        + geometry.duration(placing.way_down, DOWN_SPEED)
        + OPEN_S
        + geometry.duration(placing.way_back, RETREAT_SPEED)
    )
    return Step(hfsm.Step("place", (held.object,)), commands, changes, duration)

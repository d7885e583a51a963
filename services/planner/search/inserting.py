"""Grasps and places behind an opening that go together: which grasp a thing must be taken by to be put there."""

from itertools import islice

import numpy as np

from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from services.planner.search.places import Inside, Surfaces, places
from services.planner.search.situation import Situation
from services.planner.search.steps import Geometry, Step
from services.planner.search.taking import ANY_TORSO, TORSO, preferred, reachable, take, ways
from velma.kinematics.tasks.grasping import GraspWay
from velma.kinematics.tasks.inserting import insertions
from velma.kinematics.tasks.placing import Placing

INSERTIONS, BEST = 6, 3  # looked for; each takes 30 ms (measured on the canonical scene)


def take_to(geometry: Geometry, state: str, name: str, side: Side, number: str, where: str) -> Step | None:
    """Return the step that takes an object by a grasp by which it can be put there (see take and places)."""
    if not reachable(geometry, state, name, side):
        return None
    for target in places(geometry, state, name, where):
        only = _grasps(geometry, state, name, side, number, target)
        step = take(geometry, state, name, side, number, only=only) if only is None or only else None
        if step is not None:
            return step
    return None


def _grasps(
    geometry: Geometry, state: str, name: str, side: Side, number: str, target: Inside | Surfaces
) -> frozenset[str] | None:
    """Return the grasps with which a thing can be put behind an opening; None for any, where it comes from above."""
    if isinstance(target, Surfaces):
        return None
    known = ways(preferred(geometry, state, name))
    found = inserted(geometry, geometry.at(state), side, name, target, known, number)
    if not found:
        geometry.failed(fact(Kind.NO_PLACE_REACHED_IN, side, name, target.opening.name))
    return frozenset(grasp for grasp, _ in found[:BEST])


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

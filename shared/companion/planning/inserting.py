"""Grasps and places behind an opening that go together."""

from itertools import islice

import numpy as np

from companion.languages.values import Side
from companion.planning.grasping import ANY_TORSO, TORSO, preferred
from companion.planning.places import Inside
from companion.planning.situation import Situation
from companion.planning.steps import Geometry
from velma.kinematics.tasks.grasping import GraspWay
from velma.kinematics.tasks.inserting import insertions
from velma.kinematics.tasks.placing import Placing

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

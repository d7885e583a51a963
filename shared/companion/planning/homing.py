"""The primitive step that brings an empty arm home."""

from companion.languages import hfsm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning.situation import Situation, configured
from companion.planning.steps import Geometry, Step, free_speed, move
from velma.kinematics.tasks.carrying import FINGERS, homes


def home(geometry: Geometry, state: str, side: Side) -> Step | None:
    """Return the step that brings an empty arm to its start posture; the torso turns where that is free.

    None, with the reason noted, where no path is found. A step that is asked for again is not searched again.
    """
    if (state, side) not in geometry.homes:
        geometry.homes[state, side] = _home(geometry, geometry.at(state), side)
    found = geometry.homes[state, side]
    if found is None:
        geometry.failed(fact(Kind.NO_WAY_HOME, side))
    return found


def _home(geometry: Geometry, here: Situation, side: Side) -> Step | None:
    """Return the step of the first goal that is reached."""
    goals = [goal for goal in homes(here.q, side) if here.world.free(goal)]
    reached = geometry.free_motion(here, side, goals)
    if reached is None:
        return None
    _, way = reached
    speed = free_speed(here)
    return Step(
        hfsm.Step("home", side=side),
        (move(side, way, speed, FINGERS),),
        configured(side, way.path[-1], FINGERS),
        way.duration,
    )

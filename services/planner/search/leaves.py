"""Leaves of cabinets as km knows them: at which furniture each hangs, and how far it is open."""

import math

from companion.languages import wm
from services.planner.search.asking import Asking
from services.planner.search.situation import DOOR
from velma.kinematics.frames import heading, transform

WIDE, ENOUGH = (1.54, 1.47), 1.35
"""Angles [rad] to which a leaf is turned, the first that the arm can follow, and which are enough. The hinge ends at
1.58. With both leaves at 1.4 jar and bowl could be taken in 4 of 4 seeds, at 1.0 in none; the hand leaves a leaf up to
0.1 short (trials)."""


def closed(ask: Asking, state: str) -> tuple[tuple[str, str], ...]:
    """Return the leaves that are not open enough, each with the furniture in whose opening it hangs."""
    static = ask(wm.StaticObjects(state=state), wm.Objects).objects
    doors = [one.id for one in static if one.kind == DOOR]
    around = [one.id for one in static if one.kind != DOOR] if doors else []
    return tuple(
        (door, one)
        for door in doors
        for one in around
        if ask(wm.Holds(state=state, relation=wm.Relation.IS_IN, subject=door, value=one), wm.Truth).value
        and opened(ask, state, door, one) < ENOUGH
    )


def opened(ask: Asking, state: str, door: str, around: str) -> float:
    """Return how far a leaf is open [rad] at the furniture at which it hangs."""
    poses = (transform(ask(wm.ObjectPose(state=state, object=one), wm.PoseOf).pose) for one in (door, around))
    leaf, body = (heading(pose.rotation[:, 0]) for pose in poses)
    return opens(grasps(ask, state, door)[0]) * math.remainder(leaf - body, math.tau)


def grasps(ask: Asking, state: str, door: str) -> tuple[wm.GraspDef, ...]:
    """Return how a hand may hold the handle of a leaf."""
    return ask(wm.GraspSet(state=state, object=door), wm.Grasps).grasps


def opens(grasp: wm.GraspDef) -> float:
    """Return the sense of rotation about z in which a leaf opens: its handle, in front of it, comes forwards."""
    return -math.copysign(1.0, transform(grasp.steps[-1].pose).inverse().translation[1])

"""Planning to hand a thing over: it is taken, and held out level over the edge of a table on the
person's side.

Where nobody takes it, the same step puts it down where there is room.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import msgspec
import numpy as np
import pinocchio as pin

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning.methods import Known, Subtasks
from companion.planning.placing import place, retreating
from companion.planning.registry import Argument, Plan, each_hand, each_try
from companion.planning.steps import Geometry, Situation, Step, configured, home, move
from companion.tasks.hand_over.done import HandOver, HandOverKind
from velma.kinematics import ik
from velma.kinematics.frames import heading, standing, transform
from velma.kinematics.tasks import LOADED_SPEED
from velma.kinematics.tasks.carrying import CARRY_TILT
from velma.kinematics.tasks.placing import turned, within

TABLE = "table"
WAIT_S = 30.0  # issue
OVER_M = 0.15  # of the thing's foot above the table: a person's hand has room below it (estimate)
EDGE_STEP_M = 0.05  # between two points of an edge (estimate)
# least cosine between an edge's outward direction and that away from the robot (estimate)
OUTWARDS = 0.3
BEST_M = 0.78  # from the robot, where it puts down and pours well (companion.planning.placing)
# rad: of the hand from the way away from the robot, best first (estimates)
ASKEW = (0.0, 0.4, -0.4, 0.8, -0.8)
GOALS, MOST_POINTS = 6, 30  # postures to choose from, points tried (estimates)
# rad, of the torso, as where things are put down (velma.kinematics.tasks.placing)
TORSO = (-1.2, 1.2)


def hand_over_held(known: Known, state: str, name: str) -> Subtasks | None:
    """Hand over what a hand holds, and draw that one back."""
    side = known.facts.holder(state, name)
    if not side:
        return known.unfit(fact(Kind.NO_HAND_HOLDS, name))
    return [("a_hand_over", side), ("a_draw_back", side)]


def hand_over_with(known: Known, state: str, hand: Side, name: str) -> Subtasks | None:
    """Take it with this hand, if it is empty, and hand it over."""
    if holder := known.facts.holder(state, name):
        return known.unfit(fact(Kind.HOLDS, holder, name))
    if held := known.facts.in_hand(state, hand):
        return known.unfit(fact(Kind.HOLDS, hand, held))
    return [("hand_over_taken", name, hand)]


def hand_over_taken(
    known: Known, state: str, number: str, name: str, hand: Side
) -> Subtasks | None:
    """Take it by some grasp, from which it can be held out, and hand it over."""
    return [("a_take", name, hand, number), ("a_hand_over", hand), ("a_draw_back", hand)]


def hand_over(geometry: Geometry, state: str, side: Side) -> Step | None:
    """The step that holds the thing out and gives it to whom pulls; else it is put down, and the
    plan fails.
    """
    here = geometry.at(state)
    held = here.held[side]
    goals = list(islice(_held_out(geometry, here, side), GOALS))
    reached = geometry.free_motion(here, side, goals, largest_tilt=CARRY_TILT)
    if reached is None:
        geometry.failed(fact(HandOverKind.NO_PLACE_TO_HAND_OVER, side, held.object))
        return None
    _, way = reached
    wide = retreating(geometry, state, held.object, held.grasp)[0][1]
    mass = geometry.model(state, held.object).mass
    out = geometry.ask.suppose(state, configured(side, way.path[-1]))
    down = place(geometry, out, side)
    if down is None:
        return None
    stood = geometry.ask.suppose(out, down.changes)
    back = draw_back(geometry, stood, side)
    given = HandOver(key="", side=side, object=held.object, fingers=wide, mass=mass, wait=WAIT_S)
    changes = (wm.Released(side=side), *configured(side, way.path[-1], wide))
    return Step(
        hfsm.Step("hand-over", (held.object,)),
        (move(side, way, LOADED_SPEED), given),
        changes,
        way.duration + WAIT_S,
        instead=(*down.commands, *(back.commands if back else (rc.Home(key="", side=side),))),
        why=(fact(HandOverKind.NOT_TAKEN, held.object),),
    )


def draw_back(geometry: Geometry, state: str, side: Side) -> Step | None:
    """The step that brings an empty arm home, as slowly as a loaded one: a person is near."""
    found = home(geometry, state, side)
    if found is None:
        return None
    moves = (one for one in found.commands if isinstance(one, rc.MoveJoint))
    slow = [msgspec.structs.replace(one, speed=LOADED_SPEED) for one in moves]
    return replace(found, commands=tuple(slow))


def _held_out(geometry: Geometry, here: Situation, side: Side) -> Iterator[np.ndarray]:
    """Yield free postures (15,) with the thing upright over an edge, the hand pointing away from
    the robot.
    """
    held, rng = here.held[side], geometry.rng("hand over", here.held[side].object, side)
    base_z = geometry.model(here.state, held.object).base_z
    points_to = held.T_grip_object.inverse().rotation[:, 2]
    for edge in _edges(geometry, here, side)[:MOST_POINTS]:
        for askew in ASKEW:
            yaw = heading(edge) + askew - heading(points_to)
            at = standing(edge + np.array([0.0, 0.0, OVER_M - base_z]), yaw)
            target: pin.SE3 = at * held.T_grip_object.inverse()
            found = ik.sample(
                geometry.robot, side, target, here.q, rng, torso=TORSO, first=here.world.first_free
            )
            if found is not None:
                yield found
                break


def _edges(geometry: Geometry, here: Situation, side: Side) -> list[np.ndarray]:
    """Points (3,) of the tables' edges that look away from the robot and are in reach, best
    first.
    """
    reach = geometry.ask(wm.RobotReach(state=here.state, side=side), wm.Reach)
    shoulders = turned(reach.shoulders)
    tables = geometry.facts.places(here.state, TABLE)
    surfaces = geometry.ask(wm.FlatSurfaces(state=here.state), wm.Surfaces).surfaces
    points = [point for one in surfaces if one.object in tables for point in _outer(one)]
    near = [point for point in points if within(point, shoulders, reach.near, reach.far)]
    return sorted(near, key=lambda point: abs(math.hypot(point[0], point[1]) - BEST_M))


def _outer(surface: wm.Surface) -> Iterator[np.ndarray]:
    """Yield points (3,) of the edges of a surface whose outward direction is away from the
    robot.
    """
    frame, (x, y) = transform(surface.at), surface.size
    for outwards, along, half, far in (((1, 0), (0, 1), y / 2, x / 2),
                                       ((-1, 0), (0, 1), y / 2, x / 2),
                                       ((0, 1), (1, 0), x / 2, y / 2),
                                       ((0, -1), (1, 0), x / 2, y / 2)):  # fmt: skip
        out, way = frame.rotation @ (*outwards, 0.0), frame.rotation @ (*along, 0.0)
        for step in np.arange(-half, half + 1e-9, EDGE_STEP_M):
            point = frame.translation + far * out + step * way
            if out[:2] @ point[:2] > OUTWARDS * math.hypot(*point[:2]):
                yield point


PLAN = Plan(
    tasks={"hand_over": (Argument.THING,)},
    methods={
        "hand_over": (
            "after_opening",
            hand_over_held,
            each_hand(hand_over_with),
            "after_clearing",
            "after_arms_home",
        ),
        "hand_over_taken": (each_try(hand_over_taken),),
    },
    actions={"a_hand_over": hand_over, "a_draw_back": draw_back},
)

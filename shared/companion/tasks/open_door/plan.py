"""Planning to open a leaf of a cabinet by its handle, before what stands behind it is taken, or is
looked for.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np
import pinocchio as pin

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning.methods import Asking, Known, Subtasks
from companion.planning.registry import Each, Plan, each_hand, object_arguments
from companion.planning.steps import (
    CLOSE_S,
    DOOR,
    OPEN_S,
    Geometry,
    Path,
    Situation,
    Step,
    approach_points,
    configured,
    free_speed,
    hand_steps,
    home,
    move,
    on_wire,
)
from companion.tasks.open_door.done import DoorKind, OpenDoor
from velma import names
from velma.kinematics import backing, ik
from velma.kinematics.frames import heading, transform
from velma.kinematics.tasks import PULL_SPEED, attaching, opening

DOORS = (1, 2)
"""Ranks of the closed doors before a thing, one of which is opened first: a cabinet has two."""
WIDE, ENOUGH = (1.54, 1.47), 1.35
"""Angles [rad] to which a leaf is turned, the first that the arm can follow, and which are enough.
The hinge ends at 1.58. With both leaves at 1.4 jar and bowl could be taken in 4 of 4 seeds, at 1.0
in none; the hand leaves a leaf up to 0.1 short (trials).
"""
ROOM_M = 0.012  # of the arm during the turn: ex takes the handle where it is seen then (estimate)
# random torsos and elbows for each way to hold the bar (estimate: half of them follow the turn)
POSTURES = 30
UPRIGHT = 1e-6  # [rad]: rounding of a rotation about an upright axis
TRIED = 4  # of those that follow: to each a free way is looked for (estimate)


# --- when a leaf is opened ------------------------------------------------------------------------


def after_opening(
    known: Known, state: str, number: int, task: str, *arguments: str
) -> Subtasks | None:
    """Open the n-th closed door of the furniture in which its things stand, look at the first
    thing, plan again.

    The leaf then is where it is seen, not where the plan turns it.
    """
    doors = closed(known.ask, state)
    if not doors:
        return None
    inside = [
        one for one in object_arguments(task, arguments) if not known.facts.holder(state, one)
    ]
    around = {known.facts.support(state, one) for one in inside if known.facts.inside(state, one)}
    shut = [(door, body) for door, body in doors if body in around]
    if len(shut) < number:
        return known.unfit(fact(Kind.FEWER_DOORS, number))
    return [("open_door", *shut[number - 1]), ("localize", arguments[0])]


def behind_doors(known: Known, state: str) -> Iterator[Subtasks]:
    """Yield for each closed door: open it and look around. A thing that was never seen may be
    behind it.
    """
    for door, around in closed(known.ask, state):
        yield [("open_door", door, around), ("look_around",)]


def open_door_with(known: Known, state: str, hand: Side, door: str, around: str) -> Subtasks | None:
    """Open it with this hand, and bring that one home."""
    return [("a_open", door, around, hand), ("a_home", hand)]


# --- leaves as km knows them ----------------------------------------------------------------------


def closed(ask: Asking, state: str) -> tuple[tuple[str, str], ...]:
    """The leaves that are not open enough, each with the furniture in whose opening it hangs."""
    static = ask(wm.StaticObjects(state=state), wm.Objects).objects
    doors = [one.id for one in static if one.kind == DOOR]
    around = [one.id for one in static if one.kind != DOOR] if doors else []
    return tuple(
        (door, one)
        for door in doors
        for one in around
        if ask(
            wm.Holds(state=state, relation=wm.Relation.IS_IN, subject=door, value=one), wm.Truth
        ).value
        and opened(ask, state, door, one) < ENOUGH
    )


def opened(ask: Asking, state: str, door: str, around: str) -> float:
    """How far a leaf is open [rad] at the furniture at which it hangs."""
    poses = (
        transform(ask(wm.ObjectPose(state=state, object=one), wm.PoseOf).pose)
        for one in (door, around)
    )
    leaf, body = (heading(pose.rotation[:, 0]) for pose in poses)
    return opens(grasps(ask, state, door)[0]) * math.remainder(leaf - body, math.tau)


def grasps(ask: Asking, state: str, door: str) -> tuple[wm.GraspDef, ...]:
    """How a hand may hold the handle of a leaf."""
    return ask(wm.GraspSet(state=state, object=door), wm.Grasps).grasps


def opens(grasp: wm.GraspDef) -> float:
    """The sense of rotation about z in which a leaf opens: its handle, in front of it, comes
    forwards.
    """
    return -math.copysign(1.0, transform(grasp.steps[-1].pose).inverse().translation[1])


# --- the step that opens one ----------------------------------------------------------------------


@dataclass(frozen=True)
class _Leaf:
    """A leaf to be opened: its pose, the turn about its hinge [rad], how large a turn is enough.

    `ends`: how the hand may hold the bar at the end of the turn (T_leaf_grip), best first.
    """

    name: str
    pose: pin.SE3
    turn: float
    least: float
    ends: list[pin.SE3]


@dataclass(frozen=True)
class _Way:
    """Postures to the handle and along the turn, the one with the hand drawn back, and the hand at
    the turn's end.
    """

    path: Path
    last: np.ndarray
    end: pin.SE3


def open_door(geometry: Geometry, state: str, door: str, around: str, side: Side) -> Step | None:
    """The step that opens a leaf with an empty hand, from whose end a way home is found.

    None, with the reason noted, where there is none.
    """
    here, known = geometry.at(state), grasps(geometry.ask, state, door)
    if side in here.held:
        geometry.failed(fact(Kind.HOLDS, side, here.held[side].object))
        return None
    now, pose = opened(geometry.ask, state, door, around), geometry.pose(state, door)
    # as thick as it is: things stand close behind it
    here.world.put(door, geometry.model(state, door).shapes, pose)
    for wide, grasp in product(WIDE, known):
        turn = opens(grasp) * (wide - now)
        leaf = _Leaf(door, pose, turn, ENOUGH - now, _ends(grasp, known, turn))
        ways = list(islice(_ways(geometry, here, side, leaf, grasp), TRIED))
        reached = geometry.free_motion(here, side, [way.path[0] for way in ways], tried=TRIED)
        if reached is None:
            continue
        index, motion = reached
        lead = move(side, motion, free_speed(here), grasp.steps[0].fingers)
        step = _opening(geometry, side, leaf, grasp, ways[index], lead, motion.duration)
        if home(geometry, geometry.ask.suppose(state, step.changes), side):
            return step
    geometry.failed(fact(DoorKind.NO_WAY_TO_OPEN, side, door))
    return None


def _ends(grasp: wm.GraspDef, known: tuple[wm.GraspDef, ...], turn: float) -> list[pin.SE3]:
    """How the hand may hold the bar after the leaf's turn (T_leaf_grip), best first.

    By the same grasp, or by another one if the hand then turns less than the leaf: the fingers
    slide about the bar.
    """
    begin, *hands = (hand_steps(one)[-1][0] for one in (grasp, *known))
    slides = [(slide, hand) for hand in hands if (slide := _about_bar(begin, hand)) * turn < 0.0]
    return [begin, *(hand for _, hand in sorted(slides, key=lambda one: abs(one[0])))]


def _about_bar(begin: pin.SE3, end: pin.SE3) -> float:
    """The rotation [rad] about the upright bar between two ways to hold it; 0 if it is about
    another axis.
    """
    x, y, z = pin.log3(end.rotation @ begin.rotation.T)
    return float(z) if np.hypot(x, y) < UPRIGHT else 0.0


def _ways(
    geometry: Geometry, here: Situation, side: Side, leaf: _Leaf, grasp: wm.GraspDef
) -> Iterator[_Way]:
    """Yield ways to open a leaf by this grasp; the fingers are wide afterwards."""
    robot, world, (outer, inner) = geometry.robot, here.world, hand_steps(grasp)
    rng = geometry.rng("open", leaf.name, side, grasp.id)
    # A turn to an end at which the arm cannot hold the turned leaf's bar would be in vain.
    after, random = opening.turned(leaf.pose, leaf.turn), geometry.rng("reach", leaf.name, side)
    leaf = replace(
        leaf, ends=[end for end in leaf.ends if ik.reachable(robot, side, after * end, random)]
    )
    if not leaf.ends:
        return
    for q in ik.postures(robot, side, leaf.pose * inner[0], here.q, rng, starts=POSTURES):
        with attaching.allowed(world, (leaf.name, f"{side}_hand")):
            world.fingers(side, inner[1])
            found = _way(geometry, here, side, leaf, grasp, q) if world.free(q) else None
            world.fingers(side, outer[1])
        if found is not None:
            yield found


def _way(
    geometry: Geometry, here: Situation, side: Side, leaf: _Leaf, grasp: wm.GraspDef, q: np.ndarray
) -> _Way | None:
    """The way by the posture q (15,) at the handle; None where the arm does not follow."""
    robot, world, (outer, inner) = geometry.robot, here.world, hand_steps(grasp)
    columns = names.COLUMNS[side]
    try:
        back = ik.line(robot, side, q, leaf.pose * outer[0], accept=world.free, columns=columns)
    except ik.PathBlocked:
        return None
    for end in leaf.ends:
        try:
            world.fingers(side, grasp.closed)
            with attaching.room(world, ROOM_M):
                turning = opening.arc(robot, world, side, q, leaf.name, leaf.pose, leaf.turn, end)
        except ik.PathBlocked:
            continue
        finally:
            world.fingers(side, inner[1])
        after, out = opening.turned(leaf.pose, leaf.turn), end * inner[0].inverse() * outer[0]
        # the hand is drawn back from the turned leaf
        with attaching.stood(world, leaf.name, after, side):
            last = [turning[-1], *backing.way_out(robot, world, side, turning[-1], [after * out])][
                -1
            ]
            if world.free(last):
                return _Way([*back[::-1], *turning], last, end)
    return None


def _opening(
    geometry: Geometry,
    side: Side,
    leaf: _Leaf,
    grasp: wm.GraspDef,
    way: _Way,
    lead: rc.MoveJoint,
    leading: float,
) -> Step:
    """The step of a solved way; `lead` brings the hand to its start in `leading` seconds."""
    steps = hand_steps(grasp)
    command = OpenDoor(
        key="",
        side=side,
        door=leaf.name,
        approach=approach_points(steps),
        closed=grasp.closed,
        squeeze=grasp.squeeze,
        speed=grasp.speed,
        turn=leaf.turn,
        least=leaf.least,
        end=on_wire(way.end),
    )
    opened_pose = on_wire(opening.turned(leaf.pose, leaf.turn))
    moved = wm.Moved(object=leaf.name, pose=opened_pose)
    changes = (moved, *configured(side, way.last, steps[-1][1]))
    duration = leading + geometry.duration(way.path, PULL_SPEED) + CLOSE_S + OPEN_S
    return Step(hfsm.Step("open", (leaf.name,)), (lead, command), changes, duration)


PLAN = Plan(
    methods={"open_door": (each_hand(open_door_with), "after_arms_home")},
    around={"after_opening": Each(after_opening, DOORS)},
    actions={"a_open": open_door},
    reveals=behind_doors,
)

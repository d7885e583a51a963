"""The primitive task that opens a leaf by its handle."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
import pinocchio as pin

from companion.languages import rc, wm
from companion.languages.values import Side
from services.planner.search import leaves
from services.planner.search.situation import Situation, configured, on_wire
from services.planner.search.steps import CLOSE_S, OPEN_S, Geometry, Path, Step, approach_points, free_speed, move
from velma import names
from velma.kinematics import ik
from velma.kinematics.frames import transform
from velma.kinematics.tasks import attaching, opening
from velma.kinematics.tasks.speeds import PULL_SPEED

POSTURES = 30  # random torsos and elbows for each way to hold the bar (estimate: half of them follow the turn)
TRIED = 4  # of those that follow: to each a free way is looked for (estimate)


@dataclass(frozen=True)
class _Leaf:
    """A leaf that is to be opened: its pose, the turn about its hinge [rad], and how large a turn is enough."""

    name: str
    pose: pin.SE3
    turn: float
    least: float


@dataclass(frozen=True)
class _Way:
    """Postures to the handle and along the turn, the one with the hand drawn back, and how the bar is held."""

    path: Path
    last: np.ndarray
    grasp: wm.GraspDef


def open_door(geometry: Geometry, state: str, door: str, around: str, side: Side) -> Step | None:
    """Return the step that opens a leaf with an empty hand; None, with the reason noted, where none is found."""
    here, known = geometry.at(state), leaves.grasps(geometry.ask, state, door)
    if side in here.held:
        geometry.failed(f"the {side} hand holds {here.held[side].object}")
        return None
    now, pose = leaves.opened(geometry.ask, state, door, around), geometry.pose(state, door)
    here.world.put(door, geometry.model(state, door).shapes, pose)  # as thick as it is: things stand close behind it
    for wide, grasp in product(leaves.WIDE, known):
        leaf = _Leaf(door, pose, leaves.opens(grasp) * (wide - now), leaves.ENOUGH - now)
        ways = list(islice(_ways(geometry, here, side, leaf, grasp), TRIED))
        reached = geometry.free_motion(here, side, [way.path[0] for way in ways], tried=TRIED)
        if reached is not None:
            index, motion = reached
            lead = move(side, motion, free_speed(here), grasp.steps[0].fingers)
            return _opening(geometry, side, leaf, ways[index], lead, motion.duration)
    geometry.failed(f"the {side} hand finds no way to open {door}")
    return None


def _handle(grasp: wm.GraspDef) -> list[tuple[pin.SE3, float]]:
    """Return T_leaf_grip and finger angle [rad] of each step, outermost first."""
    return [(transform(step.pose).inverse(), step.fingers) for step in grasp.steps]


def _ways(geometry: Geometry, here: Situation, side: Side, leaf: _Leaf, grasp: wm.GraspDef) -> Iterator[_Way]:
    """Yield ways to open a leaf by this grasp; the fingers are wide afterwards."""
    robot, world, (outer, inner) = geometry.robot, here.world, _handle(grasp)
    rng = geometry.rng("open", leaf.name, side, grasp.id)
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
    """Return the way by the posture q (15,) at the handle; None where the arm does not follow."""
    robot, world, (outer, inner) = geometry.robot, here.world, _handle(grasp)
    after, columns = opening.turned(leaf.pose, leaf.turn), names.COLUMNS[side]
    try:
        back = ik.line(robot, side, q, leaf.pose * outer[0], accept=world.free, columns=columns)
        world.fingers(side, grasp.closed)
        turning = opening.arc(robot, world, side, q, leaf.name, leaf.pose, leaf.turn)
        world.fingers(side, inner[1])
        with attaching.stood(world, leaf.name, after, side):
            away = ik.line(robot, side, turning[-1], after * outer[0], accept=world.free, columns=columns)
    except ik.PathBlocked:
        return None
    return _Way([*back[::-1], *turning], away[-1], grasp)


def _opening(geometry: Geometry, side: Side, leaf: _Leaf, way: _Way, lead: rc.MoveJoint, leading: float) -> Step:
    """Return the step of a solved way; `lead` brings the hand to its start in `leading` seconds."""
    steps, grasp = _handle(way.grasp), way.grasp
    command = rc.OpenDoor(
        key="",
        side=side,
        door=leaf.name,
        approach=approach_points(steps),
        closed=grasp.closed,
        squeeze=grasp.squeeze,
        speed=grasp.speed,
        turn=leaf.turn,
        least=leaf.least,
    )
    changes = (
        wm.Moved(object=leaf.name, pose=on_wire(opening.turned(leaf.pose, leaf.turn))),
        *configured(side, way.last, steps[-1][1]),
    )
    duration = leading + geometry.duration(way.path, PULL_SPEED) + CLOSE_S + OPEN_S
    return Step(f"open {leaf.name}", (lead, command), changes, duration)

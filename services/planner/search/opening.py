"""The primitive task that opens a leaf by its handle."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
import pinocchio as pin

from companion.languages import rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from services.planner.search import leaves
from services.planner.search.putting import home
from services.planner.search.situation import Situation, configured, on_wire
from services.planner.search.steps import CLOSE_S, OPEN_S, Geometry, Path, Step, approach_points, free_speed, move
from velma import names
from velma.kinematics import backing, ik
from velma.kinematics.frames import transform
from velma.kinematics.tasks import attaching, opening
from velma.kinematics.tasks.speeds import PULL_SPEED

ROOM_M = 0.012  # of the arm during the turn: ex takes the handle where it is seen then (estimate)
POSTURES = 30  # random torsos and elbows for each way to hold the bar (estimate: half of them follow the turn)
UPRIGHT = 1e-6  # [rad]: rounding of a rotation about an upright axis
TRIED = 4  # of those that follow: to each a free way is looked for (estimate)


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
    """Postures to the handle and along the turn, the one with the hand drawn back, and the hand at the turn's end."""

    path: Path
    last: np.ndarray
    end: pin.SE3


def open_door(geometry: Geometry, state: str, door: str, around: str, side: Side) -> Step | None:
    """Return the step that opens a leaf with an empty hand, from whose end a way home is found.

    None, with the reason noted, where there is none.
    """
    held, known = geometry.at(state).held, leaves.grasps(geometry.ask, state, door)
    if side in held:
        geometry.failed(fact(Kind.HOLDS, side, held[side].object))
        return None
    now, pose = leaves.opened(geometry.ask, state, door, around), geometry.pose(state, door)
    for wide, grasp in product(leaves.WIDE, known):
        turn = leaves.opens(grasp) * (wide - now)
        leaf = _Leaf(door, pose, turn, leaves.ENOUGH - now, _ends(grasp, known, turn))
        step = _by(geometry, state, side, leaf, grasp)
        if step is not None and home(geometry, geometry.ask.suppose(state, step.changes), side):
            return step
    geometry.failed(fact(Kind.NO_WAY_TO_OPEN, side, door))
    return None


def _by(geometry: Geometry, state: str, side: Side, leaf: _Leaf, grasp: wm.GraspDef) -> Step | None:
    """Return the step that opens a leaf by one grasp; None where none is found."""
    here, model = geometry.at(state), geometry.model(state, leaf.name)
    here.world.put(leaf.name, model.shapes, leaf.pose)  # as thick as it is: things stand close behind it
    ways = list(islice(_ways(geometry, here, side, leaf, grasp), TRIED))
    reached = geometry.free_motion(here, side, [way.path[0] for way in ways], tried=TRIED)
    if reached is None:
        return None
    index, motion = reached
    lead = move(side, motion, free_speed(here), grasp.steps[0].fingers)
    return _opening(geometry, side, leaf, grasp, ways[index], lead, motion.duration)


def _handle(grasp: wm.GraspDef) -> list[tuple[pin.SE3, float]]:
    """Return T_leaf_grip and finger angle [rad] of each step, outermost first."""
    return [(transform(step.pose).inverse(), step.fingers) for step in grasp.steps]


def _ends(grasp: wm.GraspDef, known: tuple[wm.GraspDef, ...], turn: float) -> list[pin.SE3]:
    """Return how the hand may hold the bar after the leaf's turn (T_leaf_grip), best first.

    By the same grasp, or by another one if the hand then turns less than the leaf: the fingers slide about the bar.
    """
    begin, *hands = (_handle(one)[-1][0] for one in (grasp, *known))
    slides = [(slide, hand) for hand in hands if (slide := _about_bar(begin, hand)) * turn < 0.0]
    return [begin, *(hand for _, hand in sorted(slides, key=lambda one: abs(one[0])))]


def _about_bar(begin: pin.SE3, end: pin.SE3) -> float:
    """Return the rotation [rad] about the upright bar between two ways to hold it; 0 if it is about another axis."""
    x, y, z = pin.log3(end.rotation @ begin.rotation.T)
    return float(z) if np.hypot(x, y) < UPRIGHT else 0.0


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
        away = _away(geometry, here, side, leaf, turning[-1], end * inner[0].inverse() * outer[0])
        if away is not None:
            return _Way([*back[::-1], *turning], away, end)
    return None


def _away(
    geometry: Geometry, here: Situation, side: Side, leaf: _Leaf, q: np.ndarray, out: pin.SE3
) -> np.ndarray | None:
    """Return a free posture (15,), the hand drawn back towards `out` (T_leaf_grip) from the turned leaf, or None."""
    robot, world = geometry.robot, here.world
    after = opening.turned(leaf.pose, leaf.turn)
    with attaching.stood(world, leaf.name, after, side):
        last = [q, *backing.way_out(robot, world, side, q, [after * out])][-1]
        return last if world.free(last) else None


def _opening(
    geometry: Geometry, side: Side, leaf: _Leaf, grasp: wm.GraspDef, way: _Way, lead: rc.MoveJoint, leading: float
) -> Step:
    """Return the step of a solved way; `lead` brings the hand to its start in `leading` seconds."""
    steps = _handle(grasp)
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
        end=on_wire(way.end),
    )
    changes = (
        wm.Moved(object=leaf.name, pose=on_wire(opening.turned(leaf.pose, leaf.turn))),
        *configured(side, way.last, steps[-1][1]),
    )
    duration = leading + geometry.duration(way.path, PULL_SPEED) + CLOSE_S + OPEN_S
    return Step(f"open {leaf.name}", (lead, command), changes, duration)

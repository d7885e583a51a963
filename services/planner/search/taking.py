"""Primitive tasks that take something out of its place and bring it where it is out of the way."""

import math
from dataclasses import dataclass
from itertools import islice

import numpy as np
import pinocchio as pin

from companion.languages import rc, wm
from companion.languages.values import Side
from services.planner.search.asking import Unanswered
from services.planner.search.situation import Held, Situation, on_wire
from services.planner.search.steps import (
    APPROACH_SPEED,
    CLOSE_S,
    EMPTY_SPEED,
    LIFT_SPEED,
    LOADED_SPEED,
    Geometry,
    Step,
    approach_points,
    arrived,
    move,
)
from velma.kinematics.frames import transform
from velma.kinematics.tasks.carrying import carries
from velma.kinematics.tasks.grasping import LIFT_M, Approach, GraspWay, Target, approaches

GRASPS, CARRIES = 8, 16  # estimate: so many are found in 0.1 s
CARRY_TILT = math.radians(35.0)  # same runs


@dataclass(frozen=True)
class Manner:
    """How a kind of grasp is carried out: way out of the place [m], speed of closing [rad/s], torso angles [rad]."""

    out: float
    close_speed: float
    torso: tuple[float, float]


# Task runs with the true robot model; a box (face) was never tried there.
MANNERS = {
    "side": Manner(0.28, 0.6, (-0.7, 0.7)),
    "rim_two_inside": Manner(0.22, 0.3, (-1.0, 1.0)),
    "rim_one_inside": Manner(0.22, 0.3, (-1.0, 1.0)),
    "face": Manner(0.28, 0.3, (-0.9, 0.9)),
}


def out_of(geometry: Geometry, state: str, name: str, pose: pin.SE3) -> np.ndarray:
    """Unit direction (3,) in which the object leaves its place: out of the thing it is in, else towards the robot."""
    on = geometry.ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).on
    try:
        hole = geometry.ask(wm.ObjectHole(state=state, object=on), wm.Hole)
        around = geometry.ask(wm.ObjectPose(state=state, object=on), wm.PoseOf)
        out = transform(around.pose).rotation @ np.array(hole.axis)
    except Unanswered:
        out = -pose.translation.copy()
    out[2] = 0.0
    return np.asarray(out / np.linalg.norm(out))


def grasps(geometry: Geometry, state: str, name: str) -> list[wm.GraspDef]:
    """The known grasps of an object that are of the first, preferred kind."""
    known = geometry.ask(wm.GraspSet(state=state, object=name), wm.Grasps).grasps
    return [g for g in known if g.kind == known[0].kind]


def ways(known: list[wm.GraspDef]) -> list[GraspWay]:
    """Grasps of WM as grasps of the geometry."""
    return [GraspWay(g.id, tuple((transform(s.pose), s.fingers) for s in g.steps)) for g in known]


def take(geometry: Geometry, state: str, name: str, side: Side) -> Step | None:
    """Grasp an object where it stands and pull it out; the hand must be empty."""
    here = geometry.at(state)
    pose = transform(geometry.ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).pose)
    model = geometry.ask(wm.ObjectModel(state=state, object=name), wm.ModelOf)
    known = grasps(geometry, state, name)
    manner = MANNERS[known[0].kind]
    target = Target(
        name,
        pose,
        model.symmetric,
        out_of(geometry, state, name, pose),
        manner.out,
    )
    found = approaches(
        geometry.robot,
        here.world,
        side,
        here.q,
        target,
        ways(known),
        geometry.rng("take", name, side),
        torso=manner.torso,
        wanted=GRASPS,
    )
    if not found:
        geometry.failed(f"no grasp of {name} with the {side} hand can be reached and pulled out")
        return None
    reached = geometry.free_motion(here, side, [a.way_in[0] for a in found])
    if reached is None:
        geometry.failed(f"the {side} arm finds no free way to {name}")
        return None
    index, path = reached
    chosen = geometry.ask(wm.GraspDefinition(state=state, object=name, grasp=found[index].grasp), wm.Grasps).grasps[0]
    return _taking(geometry, here, target, found[index], chosen, side, path, model.mass)


def _taking(
    geometry: Geometry,
    here: Situation,
    target: Target,
    approach: Approach,
    grasp: wm.GraspDef,
    side: Side,
    path: list[np.ndarray],
    mass: float,
) -> Step:
    speed = LOADED_SPEED if here.loaded() else EMPTY_SPEED
    lift = rc.Segment((0.0, 0.0, LIFT_M), LIFT_SPEED)
    x, y, z = (float(v) for v in target.out * target.distance)
    commands = (
        move(side, path, speed, approach.steps[0][1]),
        rc.Grasp(
            key="",
            side=side,
            object=target.name,
            grasp=grasp.id,
            approach=approach_points(approach.steps),
            squeeze=grasp.squeeze,
            speed=MANNERS[grasp.kind].close_speed,
            mass=mass,
        ),
        rc.MoveCartesian(key="", side=side, segments=(lift, rc.Segment((x, y, z), LOADED_SPEED))),
    )
    T_grip_object = approach.steps[-1][0].inverse()
    changes = (
        wm.Grasped(object=target.name, side=side, grasp=grasp.id, pose=on_wire(T_grip_object)),
        *arrived(side, approach.way_out[-1], grasp.closed),
    )
    duration = (
        geometry.duration(path, speed)
        + geometry.duration(approach.way_in, APPROACH_SPEED)
        + CLOSE_S
        + geometry.duration(approach.way_out, LOADED_SPEED)
    )
    return Step(f"take {target.name}", commands, changes, duration)


def carry(geometry: Geometry, state: str, side: Side) -> Step | None:
    """Bring the held object, upright, where the other arm and the torso have room."""
    here = geometry.at(state)
    held: Held = here.held[side]
    postures = carries(geometry.robot, here.world, side, here.q, held.T_grip_object, geometry.rng("carry", side))
    reached = geometry.free_motion(here, side, list(islice(postures, CARRIES)), largest_tilt=CARRY_TILT, tried=CARRIES)
    if reached is None:
        geometry.failed(f"no posture found in which the {side} arm carries {held.object} out of the way")
        return None
    _, path = reached
    command = move(side, path, LOADED_SPEED)
    return Step(f"carry {held.object}", (command,), arrived(side, path[-1]), geometry.duration(path, LOADED_SPEED))

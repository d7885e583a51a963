"""The situation at the start of a step, as km tells it: postures, what the hands hold, the shapes
around.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from companion.languages import wm
from companion.languages.values import Box, Pose, Shape, Side
from companion.planning.methods import Asking
from velma import names
from velma.kinematics import collision
from velma.kinematics.frames import transform, xyz_quat
from velma.kinematics.robot import Robot

SIDES = (Side.RIGHT, Side.LEFT)
DOOR = "Door"
"""Class of the ontology."""
ROOM_M = 0.012
"""Kept from a panel besides the margin: it gives way to a hand that is beside its path, and closes.
Estimate: hands are mostly 10 mm beside.
"""


def on_wire(pose: pin.SE3) -> Pose:
    """The pose, as WM has it, of a transform."""
    return Pose(*xyz_quat(pose))


@dataclass(frozen=True)
class Held:
    """The object in a hand."""

    object: str
    grasp: str
    T_grip_object: pin.SE3


@dataclass(frozen=True)
class Situation:
    """State id at km; q (15,) [rad]; what is held; the collision world of that state."""

    state: str
    q: np.ndarray
    held: dict[Side, Held]
    world: collision.World


def posture(ask: Asking, state: str) -> np.ndarray:
    """q (15,) [rad] in that state."""
    torso = ask(wm.TorsoConfiguration(state=state), wm.Configuration).q
    arms = [ask(wm.ArmConfiguration(state=state, side=side), wm.Configuration).q for side in SIDES]
    return np.array([*torso, *arms[0], *arms[1]])


def in_hand(ask: Asking, state: str) -> dict[Side, Held]:
    """What each hand holds in that state."""
    held = {}
    for side in SIDES:
        grasp = ask(wm.GraspAtSide(state=state, side=side), wm.GraspOf)
        if grasp.object and grasp.pose is not None:
            held[side] = Held(grasp.object, grasp.grasp, transform(grasp.pose))
    return held


def situation(ask: Asking, robot: Robot, state: str) -> Situation:
    """All that a step has to know of a state. Raises Unanswered if km does not know it."""
    held = in_hand(ask, state)
    furniture = ask(wm.StaticObjects(state=state), wm.Objects).objects
    static, doors = {one.id for one in furniture}, {one.id for one in furniture if one.kind == DOOR}
    world = collision.World(robot)
    there = ask(wm.EnvironmentShapes(state=state), wm.Shapes).shapes
    for placed in there:
        kind: collision.Kind = "furniture" if placed.object in static else "object"
        shapes = _roomy(placed.shapes) if placed.object in doors else placed.shapes
        world.put(placed.object, shapes, transform(placed.pose), kind)
    for side, grasped in held.items():
        model = ask(wm.ObjectModel(state=state, object=grasped.object), wm.ModelOf)
        world.put(grasped.object, model.shapes, pin.SE3.Identity(), "object")
        world.attach(grasped.object, side, grasped.T_grip_object)
    for side in SIDES:
        fingers = ask(wm.GripperConfiguration(state=state, side=side), wm.Configuration).q
        world.fingers(side, float(max(fingers[:3])))
    q = posture(ask, state)
    near = {name for a, b, _ in world.touching(q) for name in (a, b)} & doors if doors else set()
    # a hand that let go of it has less room than that
    for placed in (one for one in there if one.object in near):
        world.put(placed.object, placed.shapes, transform(placed.pose), "furniture")
    return Situation(state, q, held, world)


def _roomy(shapes: tuple[Shape, ...]) -> tuple[Shape, ...]:
    """The boards of a leaf with its panel, which is wider than thick, thicker by ROOM_M on each
    side.
    """
    found: list[Shape] = []
    for one in shapes:
        if isinstance(one, Box) and one.size[1] > one.size[0]:
            x, y, z = one.size
            one = replace(one, size=(x + 2 * ROOM_M, y, z))
        found.append(one)
    return tuple(found)


def configured(side: Side, q: np.ndarray, fingers: float | None = None) -> tuple[wm.AnyChange, ...]:
    """The changes to torso and arm as in q (15,) [rad], and to the finger angle [rad]."""
    arm = tuple(float(x) for x in q[names.ARM[side]])
    changes: list[wm.AnyChange] = [
        wm.Configured(part="torso", q=(float(q[names.TORSO]),)),
        wm.Configured(part=f"{side}_arm", q=arm),
    ]
    if fingers is not None:
        changes.append(wm.Configured(part=f"{side}_hand", q=(fingers, fingers, fingers, 0.0)))
    return tuple(changes)

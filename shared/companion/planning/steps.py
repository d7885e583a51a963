"""Steps of primitive tasks: robot commands, the changes they make, and their expected duration; and
the situation at the start of a step, as km tells it.

A step asks km for what it needs in its first state, computes the geometry, and returns a Step; None
if no geometry was found, with the reason added to `why`. Speeds and distances: task runs with the
true robot model.
"""

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Box, Pose, Shape, Side, Vector
from companion.look_around import EVERYWHERE
from companion.planning.methods import Asking, Known, Unanswered
from velma import names
from velma.kinematics import collision, ik, motion
from velma.kinematics.frames import tilt, transform, xyz_quat
from velma.kinematics.motion import Keep, Motion
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import EMPTY_SPEED, LOADED_SPEED, looking
from velma.kinematics.tasks.carrying import FINGERS, homes, upright
from velma.kinematics.timing import timed

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


TRIED, ENOUGH = 8, 3  # estimate: more goals make motions hardly quicker, but planning slower
# Iterations of a tree: most paths need some hundreds (benchmarks/kinematics.py), so all goals are
# tried with few before any with many; trees for each goal.
QUICK, EFFORTS, ATTEMPTS = (500,), (500, 4000), 2
# so far tilted in a hand, a thing was taken as it lay: none is carried so (putting)
TAKEN_LYING = math.radians(61.0)
# [s] a hand takes to close by touch and to open; only for the expected duration
CLOSE_S, OPEN_S = 4.0, 2.5

Path = list[np.ndarray]
"""Postures (15,) [rad], one after the other."""


@dataclass(frozen=True)
class Step:
    """What one primitive task does, its commands (without keys yet), changes to the state, expected
    duration [s].

    `instead`: commands in place of all that follows where the last command fails; then the plan has
    failed, and `why`.
    """

    step: hfsm.Step
    commands: tuple[rc.Command, ...]
    changes: tuple[wm.AnyChange, ...]
    duration: float
    instead: tuple[rc.Command, ...] = ()
    why: Facts = ()


@dataclass
class Geometry(Known):
    """The common part of all steps: queries to km, the robot, the seed, and why the last attempts
    failed.

    As far as they were looked for: `reachable`, whether a thing can be taken in a state with a
    hand; `homes`, the step that brings a hand home in a state, None where there is none; `pouring`,
    the hand that is likely to pour from a thing into another one at this pose.
    """

    robot: Robot
    seed: int
    reachable: dict[tuple[str, str, Side], bool] = field(default_factory=dict)
    homes: dict[tuple[str, Side], Step | None] = field(default_factory=dict)
    pouring: dict[tuple[str, str, Pose], Side] = field(default_factory=dict)

    def rng(self, *words: str) -> np.random.Generator:
        """Random numbers that depend on seed and attempt, not on the order of attempts."""
        return np.random.default_rng(
            [self.seed, *(int.from_bytes(w.encode()[:24], "little") % 2**63 for w in words)]
        )

    def at(self, state: str) -> Situation:
        """The situation in a state at km."""
        return situation(self.ask, self.robot, state)

    def pose(self, state: str, name: str) -> pin.SE3:
        """The pose of the thing (T_world_object) in that state."""
        return transform(self.ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).pose)

    def model(self, state: str, name: str) -> wm.ModelOf:
        """Shapes, mass and base of the thing."""
        return self.ask(wm.ObjectModel(state=state, object=name), wm.ModelOf)

    def outwards(self, state: str, name: str) -> np.ndarray:
        """The horizontal unit direction (3,) out of the opening of the thing."""
        hole = self.ask(wm.ObjectHole(state=state, object=name), wm.Hole)
        return horizontal(self.pose(state, name).rotation @ np.array(hole.axis))

    def free_motion(
        self,
        here: Situation,
        side: Side,
        goals: Sequence[np.ndarray],
        *,
        largest_tilt: float | None = None,
        tried: int = TRIED,
        efforts: Sequence[int] = EFFORTS,
    ) -> tuple[int, Motion] | None:
        """Index of a goal (15,) and the motion to it: the quickest of the first few among the
        `tried` nearest.

        None if none of them can be reached with the last of the `efforts` (iterations of a tree).
        Torso and the arm of `side` move; what it holds stays within `largest_tilt` [rad] of the
        vertical.
        """
        if not goals:
            return None
        keep = None
        if largest_tilt is not None and side in here.held:
            T_grip_object = here.held[side].T_grip_object
            if tilt(self.robot.grip(here.q, side) * T_grip_object) <= TAKEN_LYING:
                keep = upright(self.robot, side, T_grip_object, largest_tilt)
        least = ik.travel(self.robot, side, here.q, np.array(goals))
        nearest = [int(k) for k in np.argsort(least, kind="stable")[:tried]]
        for effort in efforts:
            found = self._ways(
                here, side, [(k, float(least[k]), goals[k]) for k in nearest], keep, effort
            )
            if found:
                return min(found, key=lambda one: one[1].duration)
        return None

    def _ways(
        self,
        here: Situation,
        side: Side,
        goals: list[tuple[int, float, np.ndarray]],
        keep: Keep | None,
        effort: int,
    ) -> list[tuple[int, Motion]]:
        """Index of the goal and motion, some; `goals`: index, least time [s], posture, nearest
        first.
        """
        speed = free_speed(here)
        found: list[tuple[int, Motion]] = []
        for index, least, goal in goals:
            if len(found) == ENOUGH or any(least > way.duration for _, way in found):
                break
            way = motion.plan(
                self.robot, here.world, side, here.q, goal,
                keep=keep, seed=self.seed, tool_speed=speed, iterations=effort, attempts=ATTEMPTS,
            )  # fmt: skip
            if way is not None:
                found.append((index, way))
        return found

    def duration(self, path: Path, speed: float) -> float:
        """The time [s] of a joint path at a tool speed [m/s]."""
        return timed(self.robot, path, tool_speed=speed).duration if len(path) > 1 else 0.0


def horizontal(direction: np.ndarray) -> np.ndarray:
    """The horizontal unit vector (3,) in a direction (3,)."""
    level = np.array([direction[0], direction[1], 0.0])
    return np.asarray(level / np.linalg.norm(level))


def free_speed(here: Situation) -> float:
    """The tool speed [m/s] of free motions: slower with an object in a hand."""
    return LOADED_SPEED if here.held else EMPTY_SPEED


def move(side: Side, way: Motion, speed: float, fingers: float | None = None) -> rc.MoveJoint:
    """The command of a free motion."""
    points = tuple(tuple(float(x) for x in q[names.COLUMNS[side]]) for q in way.path)
    return rc.MoveJoint(key="", side=side, path=points, speed=speed, fingers=fingers)


def moved(
    step: hfsm.Step, side: Side, way: Motion, speed: float, fingers: float | None = None
) -> Step:
    """The step that is one free motion."""
    changes = configured(side, way.path[-1], fingers)
    return Step(step, (move(side, way, speed, fingers),), changes, way.duration)


def hand_steps(grasp: wm.GraspDef) -> list[tuple[pin.SE3, float]]:
    """T_object_grip and finger angle [rad] of each step of a grasp, outermost first."""
    return [(transform(step.pose).inverse(), step.fingers) for step in grasp.steps]


def approach_points(steps: Iterable[tuple[pin.SE3, float]]) -> tuple[rc.ApproachPoint, ...]:
    """Grip poses with finger angles [rad], as RC has them."""
    return tuple(rc.ApproachPoint(on_wire(pose), fingers) for pose, fingers in steps)


# --- Primitive steps that turn the head: at one thing, and for one --------------------------------


LOOK_S = 0.4
"""[s] of a look at what was just put down, at which the head looks already; only for the expected
duration. Measured in a fleet: 12 of them took 0.1 to 1.0 s, 0.4 in the mean.
"""


def look_at(geometry: Geometry, state: str, step: hfsm.Step, points: tuple[Vector, ...]) -> Step:
    """The step that looks at points (in the world, [m]) in turn. It needs no fact: where km does
    not know how the head stands, it is taken to look straight ahead.
    """
    torso: tuple[float, ...] = (0.0,)
    head: tuple[float, ...] = (0.0, 0.0)
    with suppress(Unanswered):
        torso = geometry.ask(wm.TorsoConfiguration(state=state), wm.Configuration).q
        head = geometry.ask(wm.HeadConfiguration(state=state), wm.Configuration).q
    lasts_s = looking.duration(torso[0], head, points)
    return Step(step, (rc.Look(key="", at=points),), (), lasts_s)


def look_for(geometry: Geometry, state: str, word: str) -> Step:
    """The step that looks wherever the head can be turned to, for a thing that has not been
    seen.
    """
    return look_at(geometry, state, hfsm.Step("look-for", (word,)), EVERYWHERE)


def look(geometry: Geometry, state: str, name: str) -> Step:
    """The step that looks where the object should be."""
    return _look(geometry, state, name, "")


def confirm(geometry: Geometry, state: str, name: str) -> Step:
    """The step that looks whether the object stands where it was put; what is not seen is not
    checked.
    """
    return _look(geometry, state, name, name)


def _look(geometry: Geometry, state: str, name: str, put: str) -> Step:
    x, y, z = (float(v) for v in geometry.pose(state, name).translation)
    return Step(
        hfsm.Step("look-at", (name,)), (rc.Look(key="", at=((x, y, z),), put=put),), (), LOOK_S
    )


# --- The primitive step that brings an empty arm home ---------------------------------------------


def home(geometry: Geometry, state: str, side: Side) -> Step | None:
    """The step that brings an empty arm to its start posture; the torso turns where that is free.

    None, with the reason noted, where no path is found. A step that is asked for again is not
    searched again.
    """
    if (state, side) not in geometry.homes:
        here = geometry.at(state)
        goals = [goal for goal in homes(here.q, side) if here.world.free(goal)]
        found = None
        if reached := geometry.free_motion(here, side, goals):
            step = hfsm.Step("home", side=side)
            found = moved(step, side, reached[1], free_speed(here), FINGERS)
        geometry.homes[state, side] = found
    if geometry.homes[state, side] is None:
        geometry.failed(fact(Kind.NO_WAY_HOME, side))
    return geometry.homes[state, side]

"""The collision world: contact shapes of the robot and of the things around it, checked by coal.

Shapes, excluded pairs and the rule "a link does not meet its neighbour" are read from the robot file that MuJoCo
simulates, so both give the same verdicts (tested). Every geometry belongs to a group: "left_hand", "right_hand"
(palm and fingers), "robot" (the rest), or the name of a thing. Things at rest are not checked against each other; a
thing in a hand is checked against all but that hand. No planning, no physics.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal
from xml.etree import ElementTree as ET

import coal
import numpy as np
import pinocchio as pin

from velma import names
from velma.compiled import library
from velma.errors import VelmaError
from velma.kinematics.frames import transform
from velma.kinematics.near import Near, Tree, tree
from velma.kinematics.plain_checks import PlainChecks
from velma.kinematics.robot import Robot, body_frame
from velma.kinematics.shapes import distance, nearer, solid
from velma.names import Array

Kind = Literal["furniture", "object"]

MARGIN = 0.006  # m: kept free between any two shapes when planning (trial runs)
DISTAL_SHARE = 1 / 3  # a finger's outer joint turns by this share of the inner one while it moves freely (BarrettHand)
ROBOT = "robot"
THIN_M = 0.001  # radius of a line of sight (estimate)


class UnknownThing(VelmaError):
    """The collision world has no thing of that name."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(f"nothing called {name!r} was put into the collision world; it holds {', '.join(self.known)}")


@dataclass
class _Thing:
    shapes: tuple[Any, ...]
    kind: Kind
    pose: Any  # T_world_thing, or T_grip_thing while held
    side: str | None = None
    geometries: range = field(default=range(0))
    solids: list[Any] = field(init=False)
    at: list[Any] = field(init=False)  # T_thing_shape

    def __post_init__(self) -> None:
        self.solids = [solid(shape) for shape in self.shapes]
        self.at = [transform(shape.at) for shape in self.shapes]


@dataclass(frozen=True)
class _Body:
    """The robot's geometries: all 33 joints, their shapes, the group of each, and which pairs are compared (n, n).

    `tree`: its hinges; `columns` (15,): the angle of each joint of a posture among all angles.
    """

    model: Any
    shapes: Any
    groups: tuple[str, ...]
    meets: Array
    fixed: Array
    tree: Tree
    columns: names.Columns


def _group(body: str) -> str:
    return next((f"{side}_hand" for side in names.SIDES if body.startswith(f"{side}_Hand")), ROBOT)


@lru_cache(maxsize=8)
def _body(robot: Robot) -> _Body:
    model = pin.buildModelFromMJCF(str(robot.path))
    shapes = pin.buildGeomFromMJCF(model, str(robot.path), pin.GeometryType.COLLISION)
    bodies = [model.frames[shape.parentFrame].name for shape in shapes.geometryObjects]
    joints = np.array([shape.parentJoint for shape in shapes.geometryObjects])
    parents = np.array(model.parents)[joints]
    excluded = {frozenset((e.attrib["body1"], e.attrib["body2"])) for e in ET.parse(robot.path).iter("exclude")}
    apart = np.array([[frozenset((a, b)) not in excluded for b in bodies] for a in bodies])
    # MuJoCo never compares shapes on one joint, nor a link with its parent, unless that is the world.
    neighbours = (parents[:, None] == joints) & (parents[:, None] > 0)
    meets = apart & (joints[:, None] != joints) & ~neighbours & ~neighbours.T
    columns = np.array([model.joints[model.getJointId(name)].idx_q for name in names.BODY])
    return _Body(model, shapes, tuple(map(_group, bodies)), meets, joints == 0, tree(model, columns), columns)


class World:
    """The robot among things. Not thread-safe; q (15,) [rad], poses T_world_thing, `margin` [m]."""

    def __init__(self, robot: Robot, margin: float = MARGIN) -> None:
        self._margin = margin
        self.checks = 0  # states checked so far
        self._body = _body(robot)
        model = self._body.model
        self._data = model.createData()
        self._q = pin.neutral(model)
        self._head = model.getJointId(names.HEAD[-1])
        self._index = {name: model.joints[model.getJointId(name)].idx_q for name in list(model.names)[1:]}
        self._grip = {side: body_frame(model, names.GRIP_BODY[side]) for side in names.SIDES}
        self._things: dict[str, _Thing] = {}
        self._allowed: tuple[tuple[str, str], ...] = ()
        self._checks: Near | PlainChecks | None = None  # None after things were added or removed
        self._fresh = False  # whether the compared pairs agree with what is held and allowed

    @property
    def margin(self) -> float:
        """Distance [m] below which shapes count as touching; may be changed at any time."""
        return self._margin

    @margin.setter
    def margin(self, margin: float) -> None:
        self._margin = margin

    # -- things ----------------------------------------------------------------------------------------------------
    def put(self, name: str, shapes: Sequence[Any], pose: Any, kind: Kind = "furniture") -> None:
        """Put a thing at rest at `pose`; it replaces one of that name, also a held one. Moving one is cheap."""
        old = self._things.get(name)
        if old is not None and (old.shapes is shapes or old.shapes == tuple(shapes)) and old.kind == kind:
            self._place(old, None, pose)
            return
        self._things[name] = _Thing(tuple(shapes), kind, pose)
        self._forget()

    def remove(self, name: str) -> None:
        """Remove the thing."""
        self._thing(name)
        del self._things[name]
        self._forget()

    def attach(self, name: str, side: str, T_grip_object: Any) -> None:
        """Attach the thing to the hand of `side`."""
        self._place(self._thing(name), side, T_grip_object)

    def detach(self, name: str, pose: Any = None) -> None:
        """Put a held thing at rest at `pose`; without one, where it is with all joints as last checked."""
        thing = self._thing(name)
        if pose is None:
            pose = self._where(thing)
        self._place(thing, None, pose)

    def pose(self, name: str) -> Any:
        """Return T_world_thing; of a held one, with all joints as last checked."""
        return self._where(self._thing(name))

    def held(self, name: str) -> Any:
        """Return T_grip_thing of a thing in a hand; None of one that rests."""
        thing = self._thing(name)
        return thing.pose if thing.side else None

    def fingers(self, side: str, angle: float) -> None:
        """Bend all three fingers of a hand by `angle` [rad]; their outer joints follow as in free motion."""
        for inner, outer in zip(names.PROXIMAL[side], names.DISTAL[side], strict=True):
            self._q[self._index[inner]] = min(angle, names.FINGER_UPPER)
            self._q[self._index[outer]] = min(angle * DISTAL_SHARE, names.DISTAL_UPPER)

    def head(self, pan: float, tilt: float) -> None:
        """Turn the head to pan and tilt [rad]."""
        for name, angle in zip(names.HEAD, (pan, tilt), strict=True):
            self._q[self._index[name]] = angle

    def allow(self, *pairs: tuple[str, str]) -> tuple[tuple[str, str], ...]:
        """Allow only these pairs of groups to touch; return the pairs allowed before."""
        before = self._allowed
        self._allowed, self._fresh = pairs, False
        return before

    def carried(self, side: str) -> bool:
        """Whether a thing is in the hand of that side."""
        return any(thing.side == side for thing in self._things.values())

    def moves(self, name: str, side: str) -> bool:
        """Whether the arm of `side` moves this link or thing, as `touching` names it."""
        thing = self._things.get(name)
        return name.startswith(f"{side}_") if thing is None else thing.side == side

    # -- checks ----------------------------------------------------------------------------------------------------
    def free(self, q: Array) -> bool:
        """Whether nothing comes nearer to anything than the margin, at q (15,), which is finite."""
        self.checks += 1
        return self._current().free(self._compares, self._margin, q)

    def first_free(self, postures: Array) -> int | None:
        """Return the number of the first posture (n, 15) that is free, as `free` says; None if none is."""
        found = self._current().first(self._compares, self._margin, postures, True)
        self.checks += min(found + 1, len(postures))
        return found if found < len(postures) else None

    def all_free(self, postures: Array) -> bool:
        """Whether all postures (n, 15) are free, as `free` says; none is looked at after one that is not."""
        found = self._current().first(self._compares, self._margin, postures, False)
        self.checks += min(found + 1, len(postures))
        return found == len(postures)

    def touching(self, q: Array) -> list[tuple[str, str, float]]:
        """Return pairs nearer than the margin at q, nearest first: link or thing, link or thing, distance [m]."""
        checks = self._current()
        nearest: dict[tuple[str, str], float] = {}
        for k in checks.close(self._compares, self._margin, q):
            first, second = (int(shape) for shape in self._numbered[:, k])
            pair = checks.solids[first], checks.at(first), checks.solids[second], checks.at(second)
            if nearer(*pair, self._margin):
                key = (self._called(first), self._called(second))
                nearest[key] = min(distance(*pair), nearest.get(key, np.inf))
        return sorted(((a, b, d) for (a, b), d in nearest.items()), key=lambda found: found[2])

    def hidden(self, q: Array, eye: Array, points: Sequence[Array], name: str) -> int:
        """Return how many points (3,) of the thing `name` the robot or a thing hides from `eye` (3,), at q (15,).

        Neither the head nor that thing itself hides any.
        """
        checks = self._current()
        checks.close(self._compares, self._margin, q)
        joints = [geometry.parentJoint for geometry in self._body.shapes.geometryObjects]
        others = [
            (checks.solids[k], checks.at(k))
            for k, group in enumerate(self._groups)
            if group != name and not (k < len(joints) and joints[k] == self._head)
        ]
        return sum(_crossed(others, eye, point) for point in points)

    def inside(self, shape: Any, pose: Any) -> set[str]:
        """Return the things at rest that reach into a shape at T_world_shape."""
        room, there = solid(shape), _placed(pose)
        request = coal.CollisionRequest()
        return {
            name
            for name, thing in self._things.items()
            if thing.side is None
            and any(
                coal.collide(room, there, part, _placed(thing.pose * at), request, coal.CollisionResult())
                for part, at in zip(thing.solids, thing.at, strict=True)
            )
        }

    # -- inside ----------------------------------------------------------------------------------------------------
    def _thing(self, name: str) -> _Thing:
        try:
            return self._things[name]
        except KeyError:
            raise UnknownThing(name, self._things) from None

    def _where(self, thing: _Thing) -> Any:
        if thing.side is None:
            return thing.pose
        pin.forwardKinematics(self._body.model, self._data, self._q)
        return pin.updateFramePlacement(self._body.model, self._data, self._grip[thing.side]) * thing.pose

    def _forget(self) -> None:
        self._checks, self._fresh = None, False

    def _called(self, geometry: int) -> str:
        own = len(self._body.groups)
        if geometry >= own:
            return str(self._groups[geometry])
        return str(self._body.model.frames[self._body.shapes.geometryObjects[geometry].parentFrame].name)

    def _place(self, thing: _Thing, side: str | None, pose: Any) -> None:
        self._fresh = self._fresh and thing.side == side
        thing.side, thing.pose = side, pose
        if self._checks is not None:
            self._mount(self._checks, thing)

    def _mount(self, checks: Near | PlainChecks, thing: _Thing) -> None:
        joint, T_joint_thing = 0, thing.pose
        if thing.side is not None:
            grip = self._body.model.frames[self._grip[thing.side]]
            joint, T_joint_thing = grip.parentJoint, grip.placement * thing.pose
        for k, at in zip(thing.geometries, thing.at, strict=True):
            checks.mount(k, joint, T_joint_thing * at)

    def _current(self) -> Near | PlainChecks:
        """Return the checks, with what may not touch as things are held and allowed now; worked out once for each."""
        checks = self._checks
        if checks is None:
            checks = self._checks = self._built()
        if not self._fresh:
            now = (self._allowed, tuple(thing.side for thing in self._things.values()))
            if now not in self._worked_out:
                self._worked_out[now] = checks.among(self._compared()[tuple(self._numbered)])
            self._compares, self._fresh = self._worked_out[now], True
        return checks

    def _built(self) -> Near | PlainChecks:
        """Return checks of all shapes, with every pair that may be compared."""
        groups, solids = list(self._body.groups), [one.geometry for one in self._body.shapes.geometryObjects]
        for name, thing in self._things.items():
            thing.geometries = range(len(groups), len(groups) + len(thing.shapes))
            groups += [name] * len(thing.shapes)
            solids += thing.solids
        self._groups = np.array(groups)
        self._pairs = self._possible()
        self._numbered: names.Columns = np.array(np.nonzero(np.triu(self._pairs)))
        self._worked_out: dict[Any, Any] = {}
        body, built = self._body, library()
        if built is None:
            return self._filled(PlainChecks(body.model, self._q, body.columns, solids, self._numbered))
        joints = [one.parentJoint for one in body.shapes.geometryObjects] + [0] * (len(groups) - len(body.groups))
        numbers: dict[tuple[int, str], int] = {}
        bodies = np.array([numbers.setdefault(key, len(numbers)) for key in zip(joints, groups, strict=True)])
        return self._filled(Near(built, body.tree, self._q, solids, bodies, self._numbered))

    def _filled(self, checks: Near | PlainChecks) -> Near | PlainChecks:
        """Return checks with each shape where it is."""
        for k, one in enumerate(self._body.shapes.geometryObjects):
            checks.mount(k, one.parentJoint, one.placement)
        for thing in self._things.values():
            self._mount(checks, thing)
        return checks

    def _possible(self) -> Array:
        count, own = len(self._groups), len(self._body.groups)
        furniture = np.isin(self._groups, [name for name, t in self._things.items() if t.kind == "furniture"])
        meets: Array = self._groups[:, None] != self._groups
        meets[:own, :own] = self._body.meets
        meets[np.ix_(furniture, furniture)] = False
        fixed = np.zeros(count, dtype=bool)
        fixed[:own] = self._body.fixed
        meets[np.ix_(fixed, furniture)] = meets[np.ix_(furniture, fixed)] = False
        return meets

    def _compared(self) -> Array:
        meets = self._pairs.copy()
        resting = [name for name, thing in self._things.items() if thing.side is None]
        still = np.isin(self._groups, resting)
        still[: len(self._body.groups)] = self._body.fixed
        meets[np.ix_(still, still)] = False
        carried = [(name, f"{thing.side}_hand") for name, thing in self._things.items() if thing.side]
        for a, b in (*carried, *self._allowed):
            first, second = self._groups == a, self._groups == b
            meets[np.ix_(first, second)] = meets[np.ix_(second, first)] = False
        return meets


def _placed(pose: Any) -> Any:
    return coal.Transform3s(pose.rotation, pose.translation)


def _crossed(shapes: Sequence[tuple[Any, Any]], eye: Array, point: Array) -> bool:
    """Whether the line from the eye to the point meets one of the shapes, each with its transform."""
    way = point - eye
    length = float(np.linalg.norm(way))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way / length).matrix()
    line = coal.Capsule(THIN_M, length)
    at = coal.Transform3s(turn, eye + way / 2)
    request, found = coal.CollisionRequest(), coal.CollisionResult()
    return any(coal.collide(line, at, shape, there, request, found) for shape, there in shapes)

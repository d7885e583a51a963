"""The collision world: contact shapes of the robot and of the things around it, checked by coal.

Shapes, excluded pairs and the rule "a link does not meet its neighbour" are read from the robot file that MuJoCo
simulates, so both give the same verdicts (tested). Every geometry belongs to a group: "left_hand", "right_hand"
(palm and fingers), "robot" (the rest), or the name of a thing. Things at rest are not checked against each other; a
thing in a hand is checked against all but that hand. No planning, no physics.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal
from xml.etree import ElementTree as ET

import coal
import numpy as np
import pinocchio as pin

from velma import names
from velma.errors import VelmaError
from velma.kinematics.frames import transform
from velma.kinematics.near import Among, near
from velma.kinematics.robot import Robot, body_frame
from velma.kinematics.shapes import solid
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


@dataclass(frozen=True)
class _Body:
    """The robot's geometries: all 33 joints, their shapes, the group of each, and which pairs are compared (n, n)."""

    model: Any
    shapes: Any
    groups: tuple[str, ...]
    meets: Array
    fixed: Array


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
    return _Body(model, shapes, tuple(map(_group, bodies)), meets, joints == 0)


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
        self._columns = np.array([model.joints[model.getJointId(name)].idx_q for name in names.BODY])
        self._index = {name: model.joints[model.getJointId(name)].idx_q for name in list(model.names)[1:]}
        self._grip = {side: body_frame(model, names.GRIP_BODY[side]) for side in names.SIDES}
        self._things: dict[str, _Thing] = {}
        self._allowed: tuple[tuple[str, str], ...] = ()
        self._shapes: Any = None  # None after things were added or removed: everything below is built again
        self._pairs: Array = np.empty((0, 0))  # which geometries may ever meet (n, n)
        self._fresh = False  # whether the compared pairs agree with what is held and allowed

    @property
    def margin(self) -> float:
        """Distance [m] below which shapes count as touching; may be changed at any time."""
        return self._margin

    @margin.setter
    def margin(self, margin: float) -> None:
        if margin != self._margin:
            self._margin = margin
            if self._shapes is not None:
                self._broaden()

    # -- things ----------------------------------------------------------------------------------------------------
    def put(self, name: str, shapes: Sequence[Any], pose: Any, kind: Kind = "furniture") -> None:
        """Put a thing at rest at `pose`; it replaces one of that name, also a held one. Moving one is cheap."""
        old = self._things.get(name)
        if old is not None and (old.shapes is shapes or old.shapes == tuple(shapes)) and old.kind == kind:
            self._place(old, None, pose)
            return
        for shape in shapes:
            solid(shape)  # raise NoShape now, not at the next check
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
        if not all(map(math.isfinite, q.tolist())):  # 0.6 us of 12; nothing would meet what is nowhere
            return False
        if not self._fresh:
            self._refresh()
        self.checks += 1
        self._q[self._columns] = q
        pin.updateGeometryPlacements(self._body.model, self._data, self._shapes, self._placed, self._q)
        if self._among is None:
            self._broad.update(False)
            return not pin.computeCollisions(self._broad, self._stop)
        left = self._among.left(self._margin)
        return left is not None and not any(pin.computeCollision(self._shapes, self._placed, k) for k in left)

    def touching(self, q: Array) -> list[tuple[str, str, float]]:
        """Return pairs nearer than the margin at q, nearest first: link or thing, link or thing, distance [m]."""
        if not self._fresh:
            self._refresh()
        self._q[self._columns] = q
        pin.computeCollisions(self._body.model, self._data, self._shapes, self._placed, self._q, False)
        nearest: dict[tuple[str, str], float] = {}
        for k, pair in enumerate(self._shapes.collisionPairs):
            if self._placed.activeCollisionPairs[k] and self._placed.collisionResults[k].isCollision():
                key = (self._called(pair.first), self._called(pair.second))
                distance = pin.computeDistance(self._shapes, self._placed, k).min_distance
                nearest[key] = min(distance, nearest.get(key, np.inf))
        return sorted(((a, b, d) for (a, b), d in nearest.items()), key=lambda found: found[2])

    def hidden(self, q: Array, eye: Array, points: Sequence[Array], name: str) -> int:
        """Return how many points (3,) of the thing `name` the robot or a thing hides from `eye` (3,), at q (15,).

        Neither the head nor that thing itself hides any.
        """
        if not self._fresh:
            self._refresh()
        self._q[self._columns] = q
        pin.updateGeometryPlacements(self._body.model, self._data, self._shapes, self._placed, self._q)
        others = [
            (self._shapes.geometryObjects[k].geometry, coal.Transform3s(at.rotation, at.translation))
            for k, (group, at) in enumerate(zip(self._groups, self._placed.oMg, strict=True))
            if group != name and self._shapes.geometryObjects[k].parentJoint != self._head
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
                coal.collide(room, there, solid(part), _placed(thing.pose * transform(part.at)), request, found)
                for part in thing.shapes
                for found in (coal.CollisionResult(),)
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
        self._shapes, self._fresh = None, False

    def _called(self, geometry: int) -> str:
        shape = self._shapes.geometryObjects[geometry]
        return str(self._body.model.frames[shape.parentFrame].name if geometry < len(self._body.groups) else shape.name)

    def _place(self, thing: _Thing, side: str | None, pose: Any) -> None:
        self._fresh = self._fresh and thing.side == side
        thing.side, thing.pose = side, pose
        if self._shapes is None:
            return
        joint, T_joint_thing = 0, pose
        if side is not None:
            grip = self._body.model.frames[self._grip[side]]
            joint, T_joint_thing = grip.parentJoint, grip.placement * pose
        for k, shape in zip(thing.geometries, thing.shapes, strict=True):
            geometry = self._shapes.geometryObjects[k]
            geometry.parentJoint, geometry.placement = joint, T_joint_thing * transform(shape.at)

    def _refresh(self) -> None:
        """Compare what may not touch as things are held and allowed now; what was worked out for it before is kept."""
        if self._shapes is None:
            self._build()
        now = (self._allowed, tuple(thing.side for thing in self._things.values()))
        if now not in self._worked_out:
            meets = self._compared()
            among = self._near.among(meets[self._numbered]) if self._near is not None else None
            self._worked_out[now] = meets, among
        meets, self._among = self._worked_out[now]
        self._placed.setActiveCollisionPairs(self._shapes, meets, True)
        self._fresh = True

    def _build(self) -> None:
        """Build all geometries again, with every pair that may be compared."""
        self._shapes = self._body.shapes.copy()
        groups = list(self._body.groups)
        for name, thing in self._things.items():
            thing.geometries = range(len(groups), len(groups) + len(thing.shapes))
            for shape in thing.shapes:
                geometry = pin.GeometryObject(name, 0, 0, transform(shape.at), solid(shape))
                geometry.name = name
                self._shapes.addGeometryObject(geometry)
                groups.append(name)
        self._groups = np.array(groups)
        for thing in self._things.values():
            self._place(thing, thing.side, thing.pose)
        self._pairs = self._possible()
        self._shapes.setCollisionPairs(self._pairs, True)
        self._placed = self._shapes.createData()
        self._stop = pin.CollisionCallBackDefault(self._shapes, self._placed, True)
        self._numbered = np.nonzero(np.triu(self._pairs))
        self._near = near(self._shapes, self._placed, groups, np.array(self._numbered))
        self._worked_out: dict[Any, tuple[Array, Among | None]] = {}
        self._broaden()

    def _broaden(self) -> None:
        """Extend the broad phase by the margin. Of those in Pinocchio, comparing all boxes is the quickest here."""
        margins = np.full((len(self._groups), len(self._groups)), self._margin)
        self._placed.setSecurityMargins(self._shapes, margins, True, True)
        if self._near is None:
            self._broad = pin.BroadPhaseManager_NaiveCollisionManager(self._body.model, self._shapes, self._placed)

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

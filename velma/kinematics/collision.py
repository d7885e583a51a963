"""The collision world: contact shapes of the robot and of the things around it, checked by coal.

Shapes, excluded pairs and the rule "a link does not meet its neighbour" are read from the robot
file that MuJoCo simulates, so both give the same verdicts (tested). Every geometry belongs to a
group: "left_hand", "right_hand" (palm and fingers), "robot" (the rest), or the name of a thing.
Things at rest are not checked against each other; a thing in a hand is checked against all but that
hand. No planning, no physics.
"""

import ctypes
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal
from xml.etree import ElementTree as ET

import coal
import numpy as np
import pinocchio as pin

from velma import names
from velma.compiled import fields, library
from velma.errors import VelmaError
from velma.kinematics.frames import transform
from velma.kinematics.robot import Robot, axis, body_frame
from velma.kinematics.shapes import distance, nearer, solid
from velma.names import Array, Columns

# --- Checks of the collision world by the library of velma.compiled: where the shapes are, and
# which pairs are too near Pairs of spheres, of a sphere and a box, and most of boxes are decided in
# C, the others by coal. Must not know: things, hands.


_KINDS = {coal.Sphere: 1, coal.Box: 2}
_MOST = 64  # joints; as in near.c


class _Near(ctypes.Structure):
    """As in near.c."""

    _fields_ = fields(
        (ctypes.c_int, "joints shapes bodies"),
        (ctypes.c_void_p, "parent placed axis column angle used joint"),
        (ctypes.c_void_p, "on mounted moved at half kind body box body_box"),
    )


class _Among(ctypes.Structure):
    """As in near.c."""

    _fields_ = fields(
        (ctypes.c_int, "pairs body_pairs"),
        (ctypes.c_void_p, "first_body second_body start first second number found"),
    )


@dataclass(frozen=True)
class Tree:
    """The robot's hinges as C takes them: `parent` (n,), `placed` (n, 12), `axis` (n, 3), and
    `column` (15,), the joint of each column of a posture. Joints are those of Pinocchio but the
    universe, numbered from 0.
    """

    parent: Array
    placed: Array
    axis: Array
    column: Array


def tree(model: Any, column: Columns) -> Tree:
    """Return the tree of a model whose joints are hinges."""
    joints = range(1, model.njoints)
    if len(joints) > _MOST:
        raise ValueError(
            f"a robot of {len(joints)} joints, expected at most {_MOST} (velma/compiled/near.c)"
        )
    return Tree(
        np.array([model.parents[k] - 1 for k in joints], dtype=np.int32),
        np.array([numbers(model.jointPlacements[k]) for k in joints]),
        np.array([axis(model.joints[k]) for k in joints]),
        column.astype(np.int32),
    )


def numbers(pose: Any) -> Array:
    """Return a pose as C takes it (12,): rotation by rows, then position [m]."""
    return np.concatenate((pose.rotation.ravel(), pose.translation))


@dataclass(frozen=True)
class Among:
    """Some of the pairs, as near.c wants them. It reads the arrays, so they are kept as long as
    this.
    """

    itself: Any
    found: Any
    arrays: tuple[Any, ...]


class Near:
    """Which of some shapes may be nearer than a margin in a posture (15,); `angle` (n,) [rad]: of
    all joints.
    """

    def __init__(
        self,
        built: ctypes.CDLL,
        tree: Tree,
        angle: Array,
        solids: Sequence[Any],
        bodies: Columns,
        pairs: Columns,
    ) -> None:
        """Of coal's shapes, of bodies numbered from 0 (n,), the pairs (2, m)."""
        count, most = len(solids), int(bodies.max()) + 1
        self.solids, self.pairs = solids, pairs
        self._on, self._mounted = np.full(count, -1, dtype=np.int32), np.zeros((count, 12))
        self._moved, self._at = np.ones(count, dtype=np.uint8), np.empty((count, 12))
        half = np.array([_half(shape) for shape in solids])
        kind = np.array([_KINDS.get(type(shape), 0) for shape in solids], dtype=np.uint8)
        joints = len(tree.parent)
        hinges = tree.parent, tree.placed, tree.axis, tree.column, angle
        posed = np.full(joints, np.nan), np.empty((joints, 12))
        mounted = self._on, self._mounted, self._moved, self._at, half, kind
        boxes = np.empty((count, 6)), np.empty((most, 6))
        self._kept = (*hinges, *posed, *mounted, bodies.astype(np.int32), *boxes)
        near = _Near(joints, count, most, *(array.ctypes.data for array in self._kept))
        self._itself, self._left = ctypes.byref(near), ctypes.c_int()
        self._given = np.empty(15)
        # to ask numpy for an address takes a while
        self._one = self._given.ctypes.data, 1, 1, ctypes.byref(self._left)
        self._first, self._pairs = built.near_first, built.near_pairs
        address, number = ctypes.c_void_p, ctypes.c_double
        self._pairs.argtypes = [address, address, number, address]
        self._first.argtypes = [*self._pairs.argtypes, ctypes.c_int, ctypes.c_int, address]
        of = np.sort(bodies[pairs], axis=0)
        order = np.lexsort(of)
        rows = np.concatenate((of, pairs, [np.arange(len(order))]))
        self._sorted = rows.astype(np.int32)[:, order]

    def among(self, wanted: Array) -> Among:
        """Return those of the pairs that are `wanted` (m,)."""
        one_body, other_body, *pairs = self._sorted[:, wanted[self._sorted[-1]]]
        begins = np.ones(len(one_body), dtype=bool)
        begins[1:] = (one_body[1:] != one_body[:-1]) | (other_body[1:] != other_body[:-1])
        start = np.append(np.flatnonzero(begins), len(begins)).astype(np.int32)
        found = np.empty(len(begins) + len(start), dtype=np.int32)
        both = one_body[begins], other_body[begins]
        arrays = (*both, start, *map(np.ascontiguousarray, pairs), found)
        among = _Among(len(begins), len(start) - 1, *(array.ctypes.data for array in arrays))
        return Among(ctypes.byref(among), found, arrays)

    def mount(self, shape: int, joint: int, pose: Any) -> None:
        """Fix a shape to a joint of Pinocchio's, 0 the world, at T_joint_shape."""
        self._on[shape], self._mounted[shape], self._moved[shape] = joint - 1, numbers(pose), 1

    def at(self, shape: int) -> Any:
        """Return T_world_shape, as coal has it, in the posture looked at last."""
        pose = self._at[shape]
        return coal.Transform3s(pose[:9].reshape(3, 3), pose[9:])

    # --- checks -----------------------------------------------------------------------------------
    def free(self, among: Among, margin: float, q: Array) -> bool:
        """Whether no pair is nearer than the margin [m]; False where an angle is not finite."""
        self._given[:] = q
        self._first(self._itself, among.itself, margin, *self._one)
        left = self._left.value
        return left == 0 or (left > 0 and not self._meets(among, margin))

    def first(self, among: Among, margin: float, postures: Array, free: bool) -> int:
        """Return the number of the first posture (n, 15) that is free, or is not; n if there is
        none.
        """
        given, left = np.ascontiguousarray(postures, dtype=np.float64), self._left
        k = 0
        step, at = given.strides[0], given.ctypes.data
        while k < len(given):
            rest = at + k * step, len(given) - k, not free, ctypes.byref(left)
            k += int(self._first(self._itself, among.itself, margin, *rest))
            if k == len(given):
                return k
            if (left.value == 0 or (left.value > 0 and not self._meets(among, margin))) is free:
                return k
            k += 1
        return k

    def close(self, among: Among, margin: float, q: Array) -> list[int]:
        """Return the numbers of pairs that may be nearer than the margin, in order."""
        self._given[:] = q
        count = self._pairs(self._itself, among.itself, margin, self._given.ctypes.data)
        return sorted(among.found[:count].tolist())

    def _meets(self, among: Among, margin: float) -> bool:
        """Whether one of the pairs that C left meets."""
        for k in among.found[: self._left.value].tolist():
            a, b = (int(shape) for shape in self.pairs[:, k])
            if nearer(self.solids[a], self.at(a), self.solids[b], self.at(b), margin):
                return True
        return False


def _half(shape: Any) -> Array:
    """Half edges [m] of the box around a shape of coal in its own frame."""
    match shape:
        case coal.Sphere():
            return np.full(3, shape.radius)
        case coal.Box():
            return np.asarray(shape.halfSide)
        case _:
            shape.computeLocalAABB()
            return np.asarray(
                np.maximum(np.abs(shape.aabb_local.max_), np.abs(shape.aabb_local.min_))
            )


# --- Checks of the collision world where there is no library of velma.compiled: by Pinocchio's
# broad phase and coal


class PlainChecks:
    """As Near, slower. `angle` (n,) [rad]: of all joints; `columns` (15,): those of a
    posture among them.
    """

    def __init__(
        self, model: Any, angle: Array, columns: Columns, solids: Sequence[Any], pairs: Columns
    ) -> None:
        """Of coal's shapes, the pairs (2, m)."""
        self.solids, self.pairs = solids, pairs
        self._model = model
        self._data = model.createData()
        self._angle = angle
        self._columns = columns
        self._shapes = pin.GeometryModel()
        for shape in solids:
            self._shapes.addGeometryObject(pin.GeometryObject("", 0, 0, pin.SE3.Identity(), shape))
        self._shapes.setCollisionPairs(self._whole(np.ones(pairs.shape[1], dtype=bool)), True)
        self._placed = self._shapes.createData()
        self._stop = pin.CollisionCallBackDefault(self._shapes, self._placed, True)
        self._margin: float | None = None
        self._active: Array | None = None

    def _whole(self, wanted: Array) -> Array:
        """Return which shapes are compared (n, n) where these pairs are wanted (m,)."""
        meets = np.zeros((len(self.solids), len(self.solids)), dtype=bool)
        first, second = self.pairs[:, wanted]
        meets[first, second] = meets[second, first] = True
        return meets

    def among(self, wanted: Array) -> Array:
        """Return those of the pairs that are `wanted` (m,)."""
        return np.array(wanted)

    def mount(self, shape: int, joint: int, pose: Any) -> None:
        """Fix a shape to a joint, 0 the world, at T_joint_shape."""
        one = self._shapes.geometryObjects[shape]
        one.parentJoint, one.placement = joint, pose

    def at(self, shape: int) -> Any:
        """Return T_world_shape, as coal has it, in the posture looked at last."""
        return _placed(self._placed.oMg[shape])

    def free(self, among: Array, margin: float, q: Array) -> bool:
        """Whether no pair is nearer than the margin [m]; False where an angle is not finite."""
        if not np.isfinite(q).all():
            return False
        self._keep_apart(margin)
        if among is not self._active:
            self._active = among
            self._placed.setActiveCollisionPairs(self._shapes, self._whole(among), True)
        self._place(q)
        self._broad.update(False)
        return not pin.computeCollisions(self._broad, self._stop)

    def first(self, among: Array, margin: float, postures: Array, free: bool) -> int:
        """Return the number of the first posture (n, 15) that is free, or is not; n if there is
        none.
        """
        verdicts = (self.free(among, margin, q) is free for q in postures)
        return next((k for k, found in enumerate(verdicts) if found), len(postures))

    def close(self, among: Array, margin: float, q: Array) -> list[int]:
        """Return the numbers of pairs that are nearer than the margin, in order."""
        self._keep_apart(margin)
        self._place(q)
        return [
            k
            for k in np.flatnonzero(among).tolist()
            if pin.computeCollision(self._shapes, self._placed, k)
        ]

    def _keep_apart(self, margin: float) -> None:
        """Have shapes meet that are nearer than the margin. Of Pinocchio's broad phases all boxes
        are quickest here.
        """
        if margin != self._margin:
            self._margin = margin
            self._placed.setSecurityMargins(
                self._shapes, np.full(2 * (len(self.solids),), margin), True, True
            )
            self._broad = pin.BroadPhaseManager_NaiveCollisionManager(
                self._model, self._shapes, self._placed
            )

    def _place(self, q: Array) -> None:
        self._angle[self._columns] = q
        pin.updateGeometryPlacements(
            self._model, self._data, self._shapes, self._placed, self._angle
        )


# --- The collision world --------------------------------------------------------------------------


Kind = Literal["furniture", "object"]

MARGIN = 0.006  # m: kept free between any two shapes when planning (trial runs)
# a finger's outer joint turns by this share of the inner one while it moves freely (BarrettHand)
DISTAL_SHARE = 1 / 3
ROBOT = "robot"
THIN_M = 0.001  # radius of a line of sight (estimate)


class UnknownThing(VelmaError):
    """The collision world has no thing of that name."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(
            f"nothing called {name!r} was put into the collision world; it holds"
            f" {', '.join(self.known)}"
        )


@dataclass
class _CollisionObject:
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
    """The robot's geometries: all 33 joints, their shapes, the group of each, and which pairs are
    compared (n, n).

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
    excluded = {
        frozenset((e.attrib["body1"], e.attrib["body2"]))
        for e in ET.parse(robot.path).iter("exclude")
    }
    apart = np.array([[frozenset((a, b)) not in excluded for b in bodies] for a in bodies])
    # MuJoCo never compares shapes on one joint, nor a link with its parent, unless that is the
    # world.
    neighbours = (parents[:, None] == joints) & (parents[:, None] > 0)
    meets = apart & (joints[:, None] != joints) & ~neighbours & ~neighbours.T
    columns = np.array([model.joints[model.getJointId(name)].idx_q for name in names.BODY])
    return _Body(
        model, shapes, tuple(map(_group, bodies)), meets, joints == 0, tree(model, columns), columns
    )


class World:
    """The robot among things. Not thread-safe; q (15,) [rad], poses T_world_thing.

    `margin`: distance [m] below which shapes count as touching; may be changed at any time.
    """

    def __init__(self, robot: Robot, margin: float = MARGIN) -> None:
        self.margin = margin
        self.checks = 0  # states checked so far
        self._body = _body(robot)
        model = self._body.model
        self._data = model.createData()
        self._q = pin.neutral(model)
        self._head = model.getJointId(names.HEAD[-1])
        self._index = {
            name: model.joints[model.getJointId(name)].idx_q for name in list(model.names)[1:]
        }
        self._grip = {side: body_frame(model, names.GRIP_BODY[side]) for side in names.SIDES}
        self._things: dict[str, _CollisionObject] = {}
        self._allowed: tuple[tuple[str, str], ...] = ()
        self._checks: Near | PlainChecks | None = None  # None after things were added or removed
        self._fresh = False  # whether the compared pairs agree with what is held and allowed

    # --- things -----------------------------------------------------------------------------------
    def put(self, name: str, shapes: Sequence[Any], pose: Any, kind: Kind = "furniture") -> None:
        """Put a thing at rest at `pose`; it replaces one of that name, also a held one. Moving one
        is cheap.
        """
        old = self._things.get(name)
        if (
            old is not None
            and (old.shapes is shapes or old.shapes == tuple(shapes))
            and old.kind == kind
        ):
            self._place(old, None, pose)
            return
        self._things[name] = _CollisionObject(tuple(shapes), kind, pose)
        self._checks = None

    def remove(self, name: str) -> None:
        """Remove the thing."""
        self._thing(name)
        del self._things[name]
        self._checks = None

    def attach(self, name: str, side: str, T_grip_object: Any) -> None:
        """Attach the thing to the hand of `side`."""
        self._place(self._thing(name), side, T_grip_object)

    def detach(self, name: str, pose: Any = None) -> None:
        """Put a held thing at rest at `pose`; without one, where it is with all joints as last
        checked.
        """
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
        """Bend all three fingers of a hand by `angle` [rad]; their outer joints follow as in free
        motion.
        """
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

    # --- checks -----------------------------------------------------------------------------------
    def free(self, q: Array) -> bool:
        """Whether nothing comes nearer to anything than the margin, at q (15,), which is finite."""
        self.checks += 1
        return self._current().free(self._compares, self.margin, q)

    def first_free(self, postures: Array) -> int | None:
        """Return the number of the first posture (n, 15) that is free, as `free` says; None if none
        is.
        """
        found = self._current().first(self._compares, self.margin, postures, True)
        self.checks += min(found + 1, len(postures))
        return found if found < len(postures) else None

    def all_free(self, postures: Array) -> bool:
        """Whether all postures (n, 15) are free, as `free` says; none is looked at after one that
        is not.
        """
        found = self._current().first(self._compares, self.margin, postures, False)
        self.checks += min(found + 1, len(postures))
        return found == len(postures)

    def touching(self, q: Array) -> list[tuple[str, str, float]]:
        """Return pairs nearer than the margin at q, nearest first: link or thing, link or thing,
        distance [m].
        """
        checks = self._current()
        nearest: dict[tuple[str, str], float] = {}
        for k in checks.close(self._compares, self.margin, q):
            first, second = (int(shape) for shape in self._numbered[:, k])
            pair = checks.solids[first], checks.at(first), checks.solids[second], checks.at(second)
            if nearer(*pair, self.margin):
                key = (self._called(first), self._called(second))
                nearest[key] = min(distance(*pair), nearest.get(key, np.inf))
        return sorted(((a, b, d) for (a, b), d in nearest.items()), key=lambda found: found[2])

    def hidden(self, q: Array, eye: Array, points: Sequence[Array], name: str) -> int:
        """Return how many points (3,) of the thing `name` the robot or a thing hides from `eye`
        (3,), at q (15,).

        Neither the head nor that thing itself hides any.
        """
        checks = self._current()
        checks.close(self._compares, self.margin, q)
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
        request, found = coal.CollisionRequest(), coal.CollisionResult()
        return {
            name
            for name, thing in self._things.items()
            if thing.side is None
            and any(
                coal.collide(room, there, part, _placed(thing.pose * at), request, found)
                for part, at in zip(thing.solids, thing.at, strict=True)
            )
        }

    # --- inside -----------------------------------------------------------------------------------
    def _thing(self, name: str) -> _CollisionObject:
        try:
            return self._things[name]
        except KeyError:
            raise UnknownThing(name, self._things) from None

    def _where(self, thing: _CollisionObject) -> Any:
        if thing.side is None:
            return thing.pose
        pin.forwardKinematics(self._body.model, self._data, self._q)
        return (
            pin.updateFramePlacement(self._body.model, self._data, self._grip[thing.side])
            * thing.pose
        )

    def _called(self, geometry: int) -> str:
        own = len(self._body.groups)
        if geometry >= own:
            return str(self._groups[geometry])
        return str(
            self._body.model.frames[self._body.shapes.geometryObjects[geometry].parentFrame].name
        )

    def _place(self, thing: _CollisionObject, side: str | None, pose: Any) -> None:
        self._fresh = self._fresh and thing.side == side
        thing.side, thing.pose = side, pose
        if self._checks is not None:
            self._mount(self._checks, thing)

    def _mount(self, checks: Near | PlainChecks, thing: _CollisionObject) -> None:
        joint, T_joint_thing = 0, thing.pose
        if thing.side is not None:
            grip = self._body.model.frames[self._grip[thing.side]]
            joint, T_joint_thing = grip.parentJoint, grip.placement * thing.pose
        for k, at in zip(thing.geometries, thing.at, strict=True):
            checks.mount(k, joint, T_joint_thing * at)

    def _current(self) -> Near | PlainChecks:
        """Return the checks, with what may not touch as things are held and allowed now; worked out
        once for each.
        """
        checks = self._checks
        if checks is None:
            checks = self._checks = self._built()
            self._fresh = False
        if not self._fresh:
            now = (self._allowed, tuple(thing.side for thing in self._things.values()))
            if now not in self._worked_out:
                self._worked_out[now] = checks.among(self._compared()[tuple(self._numbered)])
            self._compares, self._fresh = self._worked_out[now], True
        return checks

    def _built(self) -> Near | PlainChecks:
        """Return checks of all shapes, with every pair that may be compared."""
        groups = list(self._body.groups)
        solids = [one.geometry for one in self._body.shapes.geometryObjects]
        for name, thing in self._things.items():
            thing.geometries = range(len(groups), len(groups) + len(thing.shapes))
            groups += [name] * len(thing.shapes)
            solids += thing.solids
        self._groups = np.array(groups)
        self._pairs = self._possible()
        self._numbered: names.Columns = np.array(np.nonzero(np.triu(self._pairs)))
        self._worked_out: dict[Any, Any] = {}
        body, built = self._body, library()
        checks: Near | PlainChecks
        if built is None:
            checks = PlainChecks(body.model, self._q, body.columns, solids, self._numbered)
        else:
            joints = [one.parentJoint for one in body.shapes.geometryObjects]
            joints += [0] * (len(groups) - len(body.groups))
            numbers: dict[tuple[int, str], int] = {}
            bodies = np.array(
                [numbers.setdefault(key, len(numbers)) for key in zip(joints, groups, strict=True)]
            )
            checks = Near(built, body.tree, self._q, solids, bodies, self._numbered)
        for k, one in enumerate(body.shapes.geometryObjects):
            checks.mount(k, one.parentJoint, one.placement)
        for thing in self._things.values():
            self._mount(checks, thing)
        return checks

    def _possible(self) -> Array:
        count, own = len(self._groups), len(self._body.groups)
        furniture = np.isin(
            self._groups, [name for name, t in self._things.items() if t.kind == "furniture"]
        )
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
        carried = [
            (name, f"{thing.side}_hand") for name, thing in self._things.items() if thing.side
        ]
        for a, b in (*carried, *self._allowed):
            first, second = self._groups == a, self._groups == b
            meets[np.ix_(first, second)] = meets[np.ix_(second, first)] = False
        return meets


def _placed(pose: Any) -> Any:
    return coal.Transform3s(pose.rotation, pose.translation)


def _crossed(shapes: Sequence[tuple[Any, Any]], eye: Array, point: Array) -> bool:
    """Whether the line from the eye to the point meets one of the shapes, each with its
    transform.
    """
    way = point - eye
    length = float(np.linalg.norm(way))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way / length).matrix()
    line = coal.Capsule(THIN_M, length)
    at = coal.Transform3s(turn, eye + way / 2)
    request, found = coal.CollisionRequest(), coal.CollisionResult()
    return any(coal.collide(line, at, shape, there, request, found) for shape, there in shapes)

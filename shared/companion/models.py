"""Object models and grasps: what is known about kinds of things before any of them is seen.

`MODELS` by model name, `GRASPS` by model name, `REACH` by side, read once from models.toml and
grasps.json, where the numbers have their sources. Must not know: agents, where any thing is.
"""

import math
from functools import cached_property
from pathlib import Path

import msgspec

from companion.languages import wm
from companion.languages.values import Box, Cylinder, Pose, Shape, Side, Vector
from companion.world.geometry import conjugate, product

UP: Vector = (0.0, 0.0, 1.0)
_HALF = math.sqrt(0.5)
LYING = "lying"
"""Kind of the grasps of things that lie on their side."""
ACROSS = {"lying": (_HALF, 0.0, -_HALF, 0.0), "lying_turned": (0.0, _HALF, 0.0, _HALF)}
"""Turn of a thing in a grasp across its axis: its z is the grip's -x, as where it stands
(grasps.json, jar), or x.
"""
HANDLE = "handle"
"""Kind of the grasps of a leaf by the bar of its handle: the leaf is turned by them, not taken."""
ALONG = (("down", (_HALF, 0.0, _HALF, 0.0), -1.0), ("up", (0.0, _HALF, 0.0, _HALF), 1.0))
"""Name of a grasp of a handle, T_leaf_grip with the grip's z along the leaf's x, and whether the
grip's x points up.
"""
UPRIGHT = math.cos(math.radians(15.0))
"""Of the axis of a thing to the vertical: farther tilted, it lies (as velma.kinematics.frames has
it).
"""
BEFORE_M = 0.15
"""Way of the hand to a thing (grasps.json, jar)."""
EYES: Vector = (0.16, 0.0, 1.65)
"""Where the eyes are while they look down at what an arm reaches [m, world]: they turn about it at
up to 13 cm (velma.kinematics.robot.Robot.camera), which is two degrees of what they look at.
"""
LEAST_RISE = math.radians(35.0)
"""From where a vessel is looked into, above the horizontal: from lower down hardly anything in it
is seen (velma.eyes.content.LOW_RISE).
"""
TALL_M = 0.2  # of the jar, the tallest thing with an opening (models.toml)
KNOWN_AS = {"bowl": "bowl_high", "cabinet": "cabinet_no_door"}
"""Kinds of the simulated scene (velma.model.kinds.Model) -> names of models, where they differ."""


class Opening(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Centre, radius of the largest circle, direction out of it; in the object's frame."""

    centre: Vector
    radius: float
    axis: Vector = UP


class Base(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The disc an object stands on: height in its frame and radius [m]."""

    z: float
    radius: float


class Flat(msgspec.Struct, frozen=True, array_like=True):
    """A horizontal rectangle of an object: centre in its frame, edge lengths along its x and y
    [m].
    """

    x: float
    y: float
    z: float
    along_x: float
    along_y: float

    @property
    def centre(self) -> Vector:
        return self.x, self.y, self.z


class Solid(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A box with its edge lengths, or an upright cylinder with radius and length [m]."""

    at: Vector
    size: Vector = (0.0, 0.0, 0.0)
    radius: float = 0.0
    length: float = 0.0


class Flared(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An open vessel with a slanted wall of `boxes` boards around a disc; outer radii at rim and
    base [m].
    """

    rim: float
    base: float
    height: float
    wall: float
    floor: float
    boxes: int

    def shapes(self) -> tuple[Shape, ...]:
        """The disc and the boards. A board's outer face is a tangent of the wall at mid height;
        neighbours meet at the rim.
        """
        z0 = self.floor / 2
        slant = math.atan2(self.rim - self.base, self.height - z0)
        slanted = math.hypot(self.rim - self.base, self.height - z0)
        size = (self.wall, 2 * self.rim * math.tan(math.pi / self.boxes), slanted)
        radius, z = (self.rim + self.base) / 2 - self.wall / 2, (self.height + z0) / 2
        cs, ss = math.cos(slant / 2), math.sin(slant / 2)
        found: list[Shape] = [Cylinder(self.base, self.floor, Pose((0.0, 0.0, z0)))]
        for k in range(self.boxes):  # turned about y by the slant, then about z to its place
            a = 2 * math.pi * k / self.boxes
            ca, sa = math.cos(a / 2), math.sin(a / 2)
            at = Pose(
                (radius * math.cos(a), radius * math.sin(a), z),
                (ca * cs, -sa * ss, ca * ss, sa * cs),
            )
            found.append(Box(size, at))
        return tuple(found)


class Model(msgspec.Struct, frozen=True, forbid_unknown_fields=True, dict=True):
    """A kind of object. `kind` is its class in the ontology; shapes are in its own frame."""

    name: str
    kind: str
    source: str
    moveable: bool
    mass: float
    base: Base
    symmetric: bool = False
    hole: Opening | None = None
    boxes: tuple[Solid, ...] = ()
    cylinders: tuple[Solid, ...] = ()
    flared: Flared | None = None
    surfaces: tuple[Flat, ...] = ()

    @cached_property
    def shapes(self) -> tuple[Shape, ...]:
        boxes = (Box(one.size, Pose(one.at)) for one in self.boxes)
        cylinders = (Cylinder(one.radius, one.length, Pose(one.at)) for one in self.cylinders)
        return (*boxes, *cylinders, *(self.flared.shapes() if self.flared else ()))

    def of(self, object: str) -> wm.ModelOf:
        """The answer of km about one object of this kind."""
        kinds, foot = (self.moveable, self.mass, self.symmetric), (self.base.z, self.base.radius)
        return wm.ModelOf(object, self.name, self.shapes, *kinds, *foot)


class Handle(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a hand takes a leaf by the bar of its handle. The bar is upright, parallel to the hinge;
    the fingers close across it, and the hand's approach is slanted to the panel.

    The bar in the leaf's frame [m]; `depth`: its distance from the grip frame, `before`: way of the
    hand to it [m]. Fingers before they close, and where one stops that meets nothing [rad]; squeeze
    and speed as of a grasp; slants of the hand against the panel, best first.
    """

    model: str
    bar: Vector
    depth: float
    before: float
    fingers: float
    closed: float
    squeeze_deg: float
    speed: float
    slants_deg: tuple[float, ...]

    def grasps(self) -> tuple[wm.GraspDef, ...]:
        """Each slant with the grip's x down, then each with it up."""
        squeeze, found = math.radians(self.squeeze_deg), []
        for name, turn, up in ALONG:
            for slant in self.slants_deg:
                # T_grip_leaf with the bar so deep before the grip. The slant brings the hand from
                # the hinge's side.
                yaw = math.pi - math.radians(slant) * math.copysign(1.0, self.bar[1])
                c, s = math.cos(yaw), math.sin(yaw)
                x, y, z = self.bar
                ahead, across = c * x + s * y, up * (s * x - c * y)
                quat = conjugate(product((math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)), turn))
                steps = (
                    wm.GraspStep(Pose((-up * z, -across, depth - ahead), quat), self.fingers)
                    for depth in (self.depth + self.before, self.depth)
                )
                force = (self.closed, squeeze, self.speed, self.before)
                grasp = (f"{name}_{slant:g}", tuple(steps), *force, HANDLE)
                found.append(wm.GraspDef(*grasp))
        return tuple(found)


class GraspKind(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Grasps from number `first` on are of this kind."""

    name: str
    first: int


class Lying(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a hand takes an object that lies on its side: distance of its axis from the palm's grip
    frame [m], fingers before they close [rad], the way out [m].
    """

    squeeze_deg: float
    depth: float
    fingers: float
    out: float


class Closing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Grasps of objects of a model, and the way out (models.toml says what the numbers mean)."""

    model: str
    squeeze_deg: float
    speed: float
    out: float
    deeper: float
    kinds: tuple[GraspKind, ...]
    lying: Lying | None = None

    def kind_of(self, number: int) -> str:
        """The kind of the grasp with this number."""
        return [kind.name for kind in self.kinds if kind.first <= number][-1]


class _Reach(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    near: float
    far: float
    left: Vector
    right: Vector


class _ModelsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    model: tuple[Model, ...]
    closing: tuple[Closing, ...]
    reach: _Reach
    handle: tuple[Handle, ...] = ()


class _GraspSet(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    closed: float
    grasps: tuple[tuple[str, tuple[tuple[float, ...], ...]], ...]


class _GraspsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    source: str
    row: str
    sets: dict[str, _GraspSet]


def fitting(known: tuple[wm.GraspDef, ...], pose: Pose) -> tuple[wm.GraspDef, ...]:
    """The grasps that fit an object as it is: those of one that lies, if it does and there are
    some.
    """
    _, x, y, _ = pose.quat_wxyz
    lying = tuple(grasp for grasp in known if grasp.kind == LYING)
    lies = 1.0 - 2.0 * (x * x + y * y) < UPRIGHT
    return lying if lies and lying else tuple(grasp for grasp in known if grasp.kind != LYING)


def _step(row: tuple[float, ...], deeper: float) -> wm.GraspStep:
    """x y z w x y z finger -> a step, `deeper` towards the palm (the grip frame's z points away
    from it).
    """
    x, y, z, w, i, j, k, fingers = row
    norm = math.sqrt(w * w + i * i + j * j + k * k)
    return wm.GraspStep(Pose((x, y, z - deeper), (w / norm, i / norm, j / norm, k / norm)), fingers)


def _grasps(closing: Closing, entry: _GraspSet) -> tuple[wm.GraspDef, ...]:
    """The grasps of the file, and those across the axis, from above, of an object that lies."""
    found = [
        wm.GraspDef(
            id=name,
            steps=tuple(_step(row, closing.deeper) for row in rows),
            closed=entry.closed,
            squeeze=math.radians(closing.squeeze_deg),
            speed=closing.speed,
            out=closing.out,
            kind=closing.kind_of(number),
        )
        for number, (name, rows) in enumerate(entry.grasps)
    ]
    if (lies := closing.lying) is not None:
        depths, squeeze = (lies.depth + BEFORE_M, lies.depth), math.radians(lies.squeeze_deg)
        for name, turn in ACROSS.items():
            steps = tuple(
                wm.GraspStep(Pose((0.0, 0.0, depth), turn), lies.fingers) for depth in depths
            )
            found.append(
                wm.GraspDef(name, steps, entry.closed, squeeze, closing.speed, lies.out, LYING)
            )
    return tuple(found)


_here = Path(__file__).parent
_models = msgspec.toml.decode((_here / "models.toml").read_bytes(), type=_ModelsFile)
_sets = msgspec.json.decode((_here / "grasps.json").read_bytes(), type=_GraspsFile).sets

MODELS: dict[str, Model] = {model.name: model for model in _models.model}
CLOSINGS: dict[str, Closing] = {closing.model: closing for closing in _models.closing}
GRASPS: dict[str, tuple[wm.GraspDef, ...]] = {
    **{name: _grasps(CLOSINGS[name], entry) for name, entry in _sets.items()},
    **{handle.model: handle.grasps() for handle in _models.handle},
}
REACH: dict[Side, wm.Reach] = {
    side: wm.Reach(_models.reach.near, _models.reach.far, (getattr(_models.reach, side),))
    for side in Side
}


def looked_into(x: float, y: float, z: float) -> bool:
    """Whether an opening with its middle here [m, world] is low enough for the eyes."""
    return math.atan2(EYES[2] - z, math.hypot(x - EYES[0], y - EYES[1])) > LEAST_RISE

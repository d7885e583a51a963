"""Object models and grasps: what is known about kinds of things before any of them is seen.

`MODELS` by model name, `GRASPS` by model name, `REACH` by side, read once from models.toml and grasps.json, where the
numbers have their sources. Must not know: agents, where any thing is.
"""

import math
import tomllib
from pathlib import Path
from typing import Any

import msgspec

from companion.handles import Handle
from companion.languages import wm
from companion.languages.values import Box, Cylinder, Pose, Shape, Side, Vector

UP: Vector = (0.0, 0.0, 1.0)
LYING = "lying"
"""Kind of the grasps of things that lie on their side."""
ACROSS = {
    "lying": (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0),
    "lying_turned": (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)),
}
"""Turn of a thing in a grasp across its axis: its z is the grip's -x, as where it stands (grasps.json, jar), or x."""
UPRIGHT = math.cos(math.radians(15.0))
"""Of the axis of a thing to the vertical: farther tilted, it lies (as velma.kinematics.frames has it)."""
BEFORE_M = 0.15
"""Way of the hand to a thing (grasps.json, jar)."""
KNOWN_AS = {"bowl": "bowl_high", "cabinet": "cabinet_no_door"}
"""Kinds of the simulated scene (velma.model.kinds.Model) -> names of models, where they differ."""


class Opening(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Centre, radius of the largest circle, direction out of it; in the object's frame."""

    centre: Vector
    radius: float
    axis: Vector = UP


class Base(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The disc a thing stands on: height in its frame and radius [m]."""

    z: float
    radius: float


class Flat(msgspec.Struct, frozen=True, array_like=True):
    """A horizontal rectangle of a thing: centre in its frame, edge lengths along its x and y [m]."""

    x: float
    y: float
    z: float
    along_x: float
    along_y: float

    @property
    def centre(self) -> Vector:
        """Its middle, in the thing's frame."""
        return self.x, self.y, self.z


class Model(msgspec.Struct, frozen=True):
    """A kind of thing. `kind` is its class in the ontology; shapes are in its own frame."""

    name: str
    kind: str
    source: str
    moveable: bool
    mass: float
    symmetric: bool
    base: Base
    shapes: tuple[Shape, ...]
    hole: Opening | None = None
    surfaces: tuple[Flat, ...] = ()

    def of(self, object: str) -> wm.ModelOf:
        """The answer of km about one thing of this kind."""
        return wm.ModelOf(
            object=object,
            model=self.name,
            shapes=self.shapes,
            moveable=self.moveable,
            mass=self.mass,
            symmetric=self.symmetric,
            base_z=self.base.z,
            base_radius=self.base.radius,
        )


class _Solid(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    at: Vector
    size: Vector | None = None
    radius: float = 0.0
    length: float = 0.0


class Flared(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An open vessel with a slanted wall of `boxes` boards around a disc; outer radii at rim and base [m]."""

    rim: float
    base: float
    height: float
    wall: float
    floor: float
    boxes: int

    def shapes(self) -> tuple[Shape, ...]:
        """The disc and the boards. A board's outer face is a tangent of the wall at mid height; neighbours meet at
        the rim.
        """
        z0 = self.floor / 2
        slant = math.atan2(self.rim - self.base, self.height - z0)
        board = (
            self.wall,
            2 * self.rim * math.tan(math.pi / self.boxes),
            math.hypot(self.rim - self.base, self.height - z0),
        )
        middle = (self.rim + self.base) / 2 - self.wall / 2
        disc = Cylinder(self.base, self.floor, Pose((0.0, 0.0, z0)))
        return (disc, *(self._board(board, middle, (self.height + z0) / 2, slant, k) for k in range(self.boxes)))

    def _board(self, size: Vector, radius: float, z: float, slant: float, k: int) -> Box:
        """The k-th board: turned about y by the slant, then about z to its place."""
        a = 2 * math.pi * k / self.boxes
        (ca, sa), (cs, ss) = _half(a), _half(slant)
        return Box(size, Pose((radius * math.cos(a), radius * math.sin(a), z), (ca * cs, -sa * ss, ca * ss, sa * cs)))


class _ModelEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: str
    kind: str
    source: str
    moveable: bool
    mass: float
    base: Base
    symmetric: bool = False
    hole: Opening | None = None
    boxes: tuple[_Solid, ...] = ()
    cylinders: tuple[_Solid, ...] = ()
    flared: Flared | None = None
    surfaces: tuple[Flat, ...] = ()

    def model(self) -> Model:
        boxes = (Box(solid.size or (0.0, 0.0, 0.0), Pose(solid.at)) for solid in self.boxes)
        cylinders = (Cylinder(solid.radius, solid.length, Pose(solid.at)) for solid in self.cylinders)
        return Model(
            name=self.name,
            kind=self.kind,
            source=self.source,
            moveable=self.moveable,
            mass=self.mass,
            symmetric=self.symmetric,
            base=self.base,
            shapes=(*boxes, *cylinders, *(self.flared.shapes() if self.flared else ())),
            hole=self.hole,
            surfaces=self.surfaces,
        )


class GraspKind(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Grasps from number `first` on are of this kind."""

    name: str
    first: int


class Lying(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a hand takes a thing that lies on its side: distance of its axis from the palm's grip frame [m], fingers
    before they close [rad], the way out [m]."""

    squeeze_deg: float
    depth: float
    fingers: float
    out: float


class Closing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Grasps of things of a model, and the way out (models.toml says what the numbers mean)."""

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

    def of(self, side: Side) -> wm.Reach:
        return wm.Reach(self.near, self.far, (self.left if side is Side.LEFT else self.right,))


class _ModelsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    model: tuple[_ModelEntry, ...]
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
    """Return the grasps that fit a thing as it is: those of one that lies, if it does and there are some."""
    _, x, y, _ = pose.quat_wxyz
    lying = tuple(grasp for grasp in known if grasp.kind == LYING)
    lies = 1.0 - 2.0 * (x * x + y * y) < UPRIGHT
    return lying if lies and lying else tuple(grasp for grasp in known if grasp.kind != LYING)


def _half(angle: float) -> tuple[float, float]:
    """Cosine and sine of half an angle."""
    return math.cos(angle / 2), math.sin(angle / 2)


def _step(row: tuple[float, ...], deeper: float) -> wm.GraspStep:
    """x y z w x y z finger -> a step, `deeper` towards the palm (the grip frame's z points away from it)."""
    x, y, z, w, i, j, k, fingers = row
    norm = math.sqrt(w * w + i * i + j * j + k * k)
    return wm.GraspStep(Pose((x, y, z - deeper), (w / norm, i / norm, j / norm, k / norm)), fingers)


def _grasps(closing: Closing, entry: _GraspSet) -> tuple[wm.GraspDef, ...]:
    return tuple(
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
    )


def _lying(closing: Closing, entry: _GraspSet) -> tuple[wm.GraspDef, ...]:
    """The grasps of a thing that lies, if there are some: across its axis, from above."""
    lies = closing.lying
    if lies is None:
        return ()
    depths, squeeze = (lies.depth + BEFORE_M, lies.depth), math.radians(lies.squeeze_deg)
    return tuple(
        wm.GraspDef(
            id=name,
            steps=tuple(wm.GraspStep(Pose((0.0, 0.0, depth), turn), lies.fingers) for depth in depths),
            closed=entry.closed,
            squeeze=squeeze,
            speed=closing.speed,
            out=lies.out,
            kind=LYING,
        )
        for name, turn in ACROSS.items()
    )


def _read(name: str) -> Any:
    path = Path(__file__).with_name(name)
    return tomllib.loads(path.read_text("utf-8")) if path.suffix == ".toml" else msgspec.json.decode(path.read_bytes())


_models = msgspec.convert(_read("models.toml"), _ModelsFile)
_sets = msgspec.convert(_read("grasps.json"), _GraspsFile).sets

MODELS: dict[str, Model] = {entry.name: entry.model() for entry in _models.model}
CLOSINGS: dict[str, Closing] = {closing.model: closing for closing in _models.closing}
GRASPS: dict[str, tuple[wm.GraspDef, ...]] = {
    **{name: (*_grasps(CLOSINGS[name], entry), *_lying(CLOSINGS[name], entry)) for name, entry in _sets.items()},
    **{handle.model: handle.grasps() for handle in _models.handle},
}
REACH: dict[Side, wm.Reach] = {side: _models.reach.of(side) for side in Side}

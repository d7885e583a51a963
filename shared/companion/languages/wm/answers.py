"""Answers of km. Each is a pure function of the store and of the state that was asked about."""

import msgspec

from companion.languages.facts import Facts
from companion.languages.values import Pose, Shape, Side, Vector


class Answer(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """An answer of km."""


class Object(msgspec.Struct, frozen=True, array_like=True):
    """An object: its id, its model, its ontology class."""

    id: str
    model: str
    kind: str


class Objects(Answer, frozen=True):
    objects: tuple[Object, ...]


class PoseOf(Answer, frozen=True):
    """Pose in the world; `exact` False: predicted, not observed. `held_by`: it moves with this hand."""

    object: str
    pose: Pose
    exact: bool
    on: str = ""
    held_by: Side | None = None


class ModelOf(Answer, frozen=True):
    """Shapes in the object's frame, mass [kg]; `symmetric`: about its z axis; it stands on a disc at base_z [m]."""

    object: str
    model: str
    shapes: tuple[Shape, ...]
    moveable: bool
    mass: float
    symmetric: bool
    base_z: float = 0.0
    base_radius: float = 0.0


class Hole(Answer, frozen=True):
    """The opening, in the object's frame: its centre [m], radius of its largest circle [m], the direction out of it.

    A jar opens upwards; a cabinet without doors opens along its x axis.
    """

    object: str
    centre: Vector
    radius: float
    axis: Vector = (0.0, 0.0, 1.0)


class Surface(msgspec.Struct, frozen=True):
    """A flat rectangle of an object: frame in the world (z up), edge lengths [m]."""

    object: str
    at: Pose
    size: tuple[float, float]


class Surfaces(Answer, frozen=True):
    surfaces: tuple[Surface, ...]


class GraspOf(Answer, frozen=True):
    """`pose` is T_grip_object; an empty hand answers with object ""."""

    object: str
    side: Side | None = None
    grasp: str = ""
    pose: Pose | None = None


class GraspStep(msgspec.Struct, frozen=True, array_like=True):
    """Pose of the object in the grip frame (T_grip_object), finger angle [rad] of fingers 1-3 there."""

    pose: Pose
    fingers: float


class GraspDef(msgspec.Struct, frozen=True):
    """A grasp: steps from the outermost to the grasp itself, how it is closed, how far out of its place the thing goes.

    `closed`: angle [rad] the closed fingers are taken for. `squeeze`: motor travel [rad] after touch. `speed`: of the
    closing fingers [rad/s]. `out`: way [m] after which the thing is out of what it stood in.
    """

    id: str
    steps: tuple[GraspStep, ...]
    closed: float
    squeeze: float
    speed: float
    out: float
    kind: str


class Grasps(Answer, frozen=True):
    object: str
    grasps: tuple[GraspDef, ...]


class Configuration(Answer, frozen=True):
    q: tuple[float, ...]


class PlacedShape(msgspec.Struct, frozen=True):
    """A shape of an object, with the object's pose in the world."""

    object: str
    pose: Pose
    shapes: tuple[Shape, ...]


class Shapes(Answer, frozen=True):
    shapes: tuple[PlacedShape, ...]


class Reach(Answer, frozen=True):
    """Distance from the shoulder [m] and shoulder centres in torso_base [m]."""

    near: float
    far: float
    shoulders: tuple[Vector, ...]


class Truth(Answer, frozen=True):
    value: bool


class Made(Answer, frozen=True):
    id: str


class Unknown(Answer, frozen=True):
    """km cannot answer, and why: an unknown object, nothing observed. `later`: it may be able to soon."""

    why: Facts
    later: bool = False


class UnknownState(Answer, frozen=True):
    """km does not have a hypothetical state of this id (any more): its maker makes it again."""

    id: str


AnyAnswer = (
    Objects
    | PoseOf
    | ModelOf
    | Hole
    | Surfaces
    | GraspOf
    | Grasps
    | Configuration
    | Shapes
    | Reach
    | Truth
    | Made
    | Unknown
    | UnknownState
)

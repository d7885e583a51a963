"""WM (world model), the language of queries, answers and observations on channels C4 and C6 (paper,
section 5.4).
"""

from enum import StrEnum

import msgspec

from companion.languages.evidence import Sense
from companion.languages.facts import Facts
from companion.languages.values import BodyPosture, Pose, Shape, Side, Uncertainty, Vector

# --- Changes that a hypothetical state makes to another one ---------------------------------------


class Change(msgspec.Struct, frozen=True, tag=True):
    """A change in a hypothetical state."""


class Moved(Change, frozen=True):
    """The object stands here; `exact` False: the pose is only predicted."""

    object: str
    pose: Pose
    on: str = ""
    exact: bool = False


class Grasped(Change, frozen=True):
    """The hand holds the object; `pose` is T_grip_object."""

    object: str
    side: Side
    grasp: str
    pose: Pose


class Released(Change, frozen=True):
    """The hand holds nothing."""

    side: Side


class Configured(Change, frozen=True):
    """Joints of the body [rad]: `part` is torso, right_arm, left_arm, head, right_hand or
    left_hand.
    """

    part: str
    q: tuple[float, ...]


class Reserved(Change, frozen=True):
    """This space is kept free (True) or free again (False) under this name."""

    name: str
    volume: Shape | None


class Poured(Change, frozen=True):
    """The content of source is in destination."""

    source: str
    destination: str


AnyChange = Moved | Grasped | Released | Configured | Reserved | Poured


# --- Queries to km: each names a hypothetical state, or "" for the world as observed --------------
# The list is a reconstruction: that of 2022 is not public. It follows what the published planner of
# the same group asks of its world (proghtn-backstream, StatesInterface and generators).


class Query(
    msgspec.Struct,
    frozen=True,
    tag=True,
    forbid_unknown_fields=True,
    omit_defaults=True,
    kw_only=True,
):
    """A question to km about `state`."""

    state: str = ""


class ListObjects(Query, frozen=True):
    """Which objects are there, of which class (an ontology class, "" for all)? -> Objects"""

    kind: str = ""


class ObjectPose(Query, frozen=True):
    """Where is it? -> PoseOf"""

    object: str


class ObjectOrigin(Query, frozen=True):
    """Where did it stand before the robot took it for the first time? -> PoseOf"""

    object: str


class ObjectModel(Query, frozen=True):
    """The shape of an object -> ModelOf"""

    object: str


class MoveableObjects(Query, frozen=True):
    """-> Objects"""


class StaticObjects(Query, frozen=True):
    """-> Objects"""


class ObjectHole(Query, frozen=True):
    """Its opening -> Hole"""

    object: str


class FlatSurfaces(Query, frozen=True):
    """Surfaces on which something can be put, of which object ("" for all) -> Surfaces"""

    object: str = ""


class CurrentGrasp(Query, frozen=True):
    """Who holds it? -> GraspOf"""

    object: str


class GraspAtSide(Query, frozen=True):
    """The object in this hand -> GraspOf"""

    side: Side


class GraspSet(Query, frozen=True):
    """All known grasps of an object as it stands or lies -> Grasps"""

    object: str


class GraspDefinition(Query, frozen=True):
    """One grasp -> Grasps of length one"""

    object: str
    grasp: str


class ArmConfiguration(Query, frozen=True):
    """-> Configuration of 7 joints"""

    side: Side


class TorsoConfiguration(Query, frozen=True):
    """-> Configuration of 1 joint"""


class HeadConfiguration(Query, frozen=True):
    """-> Configuration of 2 joints"""


class GripperConfiguration(Query, frozen=True):
    """-> Configuration of fingers 1, 2, 3 and spread"""

    side: Side


class EnvironmentShapes(Query, frozen=True):
    """Shapes of everything that is not the robot, but for the ignored objects -> Shapes"""

    ignored: tuple[str, ...] = ()


class CollisionsInVolume(Query, frozen=True):
    """Which objects reach into this volume (shape placed in the world)? -> Objects"""

    volume: Shape
    ignored: tuple[str, ...] = ()


class ReservedSpace(Query, frozen=True):
    """-> Shapes"""


class RobotReach(Query, frozen=True):
    """-> Reach of an arm"""

    side: Side


class Relation(StrEnum):
    """The relations that `Holds` asks for. On the wire a relation is a str: km answers one that it
    does not know.
    """

    IS_IN = "isIn"
    IS_ON = "isOn"
    IS_GRASPED_BY = "isGraspedBy"
    IS_INSTANCE_OF = "isInstanceOf"
    HAS_EXACT_POSE = "hasExactPose"


class Holds(Query, frozen=True):
    """Does the relation (a Relation) hold of subject and value? -> Truth"""

    relation: str
    subject: str
    value: str = ""


class HypotheticalState(Query, frozen=True):
    """Make the state `id` out of `state` by these changes; made twice it is the same (idempotent)
    -> Made
    """

    id: str
    changes: tuple[AnyChange, ...] = ()


class DropStates(Query, frozen=True):
    """Forget every hypothetical state whose id begins so -> Made"""

    prefix: str


AnyQuery = (
    ListObjects
    | ObjectPose
    | ObjectOrigin
    | ObjectModel
    | MoveableObjects
    | StaticObjects
    | ObjectHole
    | FlatSurfaces
    | CurrentGrasp
    | GraspAtSide
    | GraspSet
    | GraspDefinition
    | ArmConfiguration
    | TorsoConfiguration
    | HeadConfiguration
    | GripperConfiguration
    | EnvironmentShapes
    | CollisionsInVolume
    | ReservedSpace
    | RobotReach
    | Holds
    | HypotheticalState
    | DropStates
)


# --- Answers of km: each is a pure function of the store and of the state that was asked about ----


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
    """Pose in the world; `exact` False: predicted, not observed. `held_by`: it moves with this
    hand.
    """

    object: str
    pose: Pose
    exact: bool
    on: str = ""
    held_by: Side | None = None


class ModelOf(Answer, frozen=True):
    """Shapes in the object's frame, mass [kg]; `symmetric`: about its z axis; it stands on a disc
    at base_z [m].
    """

    object: str
    model: str
    shapes: tuple[Shape, ...]
    moveable: bool
    mass: float
    symmetric: bool
    base_z: float = 0.0
    base_radius: float = 0.0


class Hole(Answer, frozen=True):
    """The opening, in the object's frame: its centre [m], radius of its largest circle [m], the
    direction out of it.

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
    """Pose of the object in the grip frame (T_grip_object), finger angle [rad] of fingers 1-3
    there.
    """

    pose: Pose
    fingers: float


class GraspDef(msgspec.Struct, frozen=True):
    """A grasp: steps from the outermost to the grasp itself, how it is closed, how far out of its
    place the thing goes.

    `closed`: angle [rad] the closed fingers are taken for. `squeeze`: motor travel [rad] after
    touch. `speed`: of the closing fingers [rad/s]. `out`: way [m] after which the thing is out of
    what it stood in.
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
    """km cannot answer, and why: an unknown object, nothing observed. `later`: it may be able to
    soon.
    """

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


# --- Observations that ta tells km ----------------------------------------------------------------


class Observation(
    msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True
):
    """An observation that ta tells km, one subject each: the newest one of a subject is the true
    one.
    """


class SeenObject(Observation, frozen=True):
    """`content`: mass of what was seen in the object [kg], right to some grams; None: it was not
    looked into.

    `uncertainty`: of the pose; None: it is not known.
    """

    object: str
    model: str
    pose: Pose
    at: float
    content: float | None = None
    uncertainty: Uncertainty | None = None


class SeenBody(Observation, frozen=True):
    body: BodyPosture


class SeenHand(Observation, frozen=True):
    """The content of a hand; object "" when it is empty. `by`: senses that told it last; none: it
    was not checked.
    """

    side: Side
    object: str = ""
    grasp: str = ""
    pose: Pose | None = None
    by: tuple[Sense, ...] = ()


class FeltContent(Observation, frozen=True):
    """`left` [kg] of the content of `source` was felt to leave it over `destination`."""

    source: str
    destination: str
    left: float


class PlacedObject(Observation, frozen=True):
    """A hand let go of an object here at `at`; nobody has seen it since."""

    object: str
    model: str
    pose: Pose
    at: float


class LostObject(Observation, frozen=True):
    """An object is not in the hand that held it, and nobody knows where it is."""

    object: str
    side: Side


class GivenObject(Observation, frozen=True):
    """A hand gave an object to a person. Nobody knows where it is now."""

    object: str
    side: Side


class MissingObject(Observation, frozen=True):
    """An object was looked for, and is not where it should be: nothing hides the place. Nobody
    knows where it is.
    """

    object: str


class NothingSeen(Observation, frozen=True):
    """A look around is over, and showed nothing: why. One that showed something ends with the
    posture.
    """

    why: Facts


class WorldLost(Observation, frozen=True):
    """A new simulated world was made, so no earlier observation holds; why. A look around
    follows.
    """

    why: Facts


AnySight = (
    SeenObject
    | PlacedObject
    | SeenBody
    | SeenHand
    | FeltContent
    | LostObject
    | GivenObject
    | MissingObject
)
AnyObservation = AnySight | NothingSeen | WorldLost


class ObserveWorld(msgspec.Struct, frozen=True, tag=True):
    """Subscribe: tell me what is observed from now on."""


Content = AnyQuery | AnyAnswer | AnyObservation | ObserveWorld

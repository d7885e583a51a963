"""Queries to km. Each names a hypothetical state, or "" for the world as observed.

The list is a reconstruction: that of 2022 is not public. It follows what the published planner of the same group asks
of its world (proghtn-backstream, StatesInterface and generators).
"""

from enum import StrEnum

import msgspec

from companion.languages.values import Shape, Side
from companion.languages.wm.changes import AnyChange


class Query(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
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
    """The relations that `Holds` asks for. On the wire a relation is a str: km answers one that it does not know."""

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
    """Make the state `id` out of `state` by these changes; made twice it is the same (idempotent) -> Made"""

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

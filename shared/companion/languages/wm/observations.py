"""Observations that ta tells km."""

import msgspec

from companion.languages.evidence import Sense
from companion.languages.facts import Facts
from companion.languages.values import BodyPosture, Pose, Side, Uncertainty


class Observation(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """An observation that ta tells km, one subject each: the newest one of a subject is the true one."""


class SeenObject(Observation, frozen=True):
    """`content`: mass of what was seen in the object [kg], right to some grams; None: it was not looked into.

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
    """The content of a hand; object "" when it is empty. `by`: senses that told it last; none: it was not checked."""

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
    """An object was looked for, and is not where it should be: nothing hides the place. Nobody knows where it is."""

    object: str


class NothingSeen(Observation, frozen=True):
    """A look around is over, and showed nothing: why. One that showed something ends with the posture."""

    why: Facts


class WorldLost(Observation, frozen=True):
    """A new simulated world was made, so no earlier observation holds; why. A look around follows."""

    why: Facts


AnySight = SeenObject | PlacedObject | SeenBody | SeenHand | FeltContent | LostObject | GivenObject | MissingObject
AnyObservation = AnySight | NothingSeen | WorldLost


class ObserveWorld(msgspec.Struct, frozen=True, tag=True):
    """Subscribe: tell me what is observed from now on."""

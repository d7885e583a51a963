"""Evidence: which sense told that something is true after an act, of which thing, when, and how
surely.

The row of each act (companion.acts) says what must be true after it, and which senses can tell.
Claims, as kinds of facts, are an enumeration to which the tasks add: the general members are here,
those of one task in its part `done`.
"""

from collections.abc import Iterable
from enum import StrEnum
from functools import cache
from typing import TYPE_CHECKING, Annotated, Self, TypeVar

import msgspec

from companion.tasks import parts

E = TypeVar("E", bound=StrEnum)


@cache
def members(base: type[E]) -> dict[str, E]:
    """The members of all enumerations made from `base`, by value. Raises ValueError if two have the
    same one.
    """
    parts("done")
    found: dict[str, E] = {}
    for one in (one for table in base.__subclasses__() for one in table.__members__.values()):
        if one.value in found:
            both = f"{type(found[one.value]).__name__} and {type(one).__name__}"
            raise ValueError(f"both {both} have {one.value!r}")
        found[one.value] = one
    return found


def member(base: type[E], value: str) -> E:
    """The member with this value. Raises ValueError if there is none."""
    found: E | None = members(base).get(value)
    if found is None:
        raise ValueError(f"unknown {base.__name__} {value!r}")
    return found


Of = Annotated[str, msgspec.Meta(pattern=r"\A[!-~]{0,64}\Z")]
"""The name of a thing (companion.languages.values.Name), "" for none."""


class AnyClaim(StrEnum):
    """Something that must be true after an act: a general claim, or one of a task. `kept`: it is
    about a thing, and a plan keeps it until its end; others are over with their act.
    """

    kept: bool

    def __new__(cls, value: str, kept: bool = True) -> Self:
        """The claim."""
        claim = str.__new__(cls, value)
        claim._value_, claim.kept = value, kept
        return claim


class Claim(AnyClaim):
    """The claims that several acts share."""

    THERE = "there", False  # the joints, the hand and the fingers are at the end of the motion
    HELD = "held"  # the thing is in the hand
    STANDS = "stands"  # the thing stands where a hand left it
    LOOKED = "looked", False  # something was seen


class Sense(StrEnum):
    """A sense of the robot that can tell."""

    EYES = "eyes"
    WRIST = "wrist"
    FINGERS = "fingers"
    JOINTS = "joints"


class Otherwise(StrEnum):
    """What becomes of an act where no sense can tell."""

    FAILED = "failed"  # the task fails
    LOOK = "look"  # the next look at the thing tells; the end of a plan says where none came
    SAID = "said"  # the act is done, and its outcome says what was not checked


class Check(msgspec.Struct, frozen=True):
    """What must be true after an act, `of` which thing (the field of the command that names it, ""
    for what the moving hand holds, or for no thing), `by` which senses, and what becomes of the act
    otherwise.
    """

    claim: AnyClaim
    of: str
    by: tuple[Sense, ...]
    otherwise: Otherwise


if TYPE_CHECKING:
    ClaimOfAct = AnyClaim
else:
    ClaimOfAct = str  # as of companion.languages.facts.Fact.kind


class Evidence(msgspec.Struct, frozen=True, array_like=True):
    """A claim about a thing ("" for none), and which senses told that it is true; none: it was not
    checked.

    `at`: when the last of them told, 0 where none did [s, simulated]; `within`: standard deviation
    of the thing's place by the eyes [m], 0 where it is not known. Raises ValueError for an unknown
    claim.
    """

    claim: ClaimOfAct
    of: Of
    by: tuple[Sense, ...] = ()
    at: float = 0.0
    within: float = 0.0

    def __post_init__(self) -> None:
        """Replace the name of a claim, as it is read, by the claim."""
        if type(self.claim) is str:
            msgspec.structs.force_setattr(self, "claim", member(AnyClaim, self.claim))


def newest(
    known: Iterable[Evidence], told: Iterable[Evidence], held: Iterable[str]
) -> tuple[Evidence, ...]:
    """What is known after an act that `told` this, and after which hands hold the things `held`.

    A thing that is held stands nowhere, and one that is not held any more is in no hand.
    """
    found = {(one.claim, one.of): one for one in (*known, *told) if one.claim.kept}
    now = set(held)
    over = {(Claim.STANDS, name) for name in now} | {
        key for key in found if key[0] is Claim.HELD and key[1] not in now
    }
    return tuple(one for key, one in found.items() if key not in over)


def unchecked(known: Iterable[Evidence]) -> tuple[Evidence, ...]:
    """The claims that no sense has told."""
    return tuple(one for one in known if not one.by)


def fitting(known: Iterable[Evidence], room: int) -> tuple[Evidence, ...]:
    """As much of it as fits into so many bytes, what was not checked first, then what is newest."""
    told: list[Evidence] = []
    for one in sorted(known, key=lambda one: (bool(one.by), -one.at)):
        if (room := room - len(msgspec.msgpack.encode(one))) < 0:
            break
        told.append(one)
    return tuple(told)

"""Evidence: which sense told that something is true after an act, of which thing, when, and how surely.

`CHECKS` of companion.languages.rc says for each act what must be true after it, and which senses can tell.
"""

from collections.abc import Iterable
from enum import StrEnum
from typing import Annotated

import msgspec

Of = Annotated[str, msgspec.Meta(pattern=r"\A[!-~]{0,64}\Z")]
"""The name of a thing (companion.languages.values.Name), "" for none."""


class Claim(StrEnum):
    """Something that must be true after an act."""

    THERE = "there"  # the joints, the hand and the fingers are at the end of the motion
    HELD = "held"  # the thing is in the hand
    STANDS = "stands"  # the thing stands where a hand left it
    OPEN = "open"  # the leaf is turned
    LOOKED = "looked"  # something was seen
    LEFT = "left"  # content left the thing
    ARRIVED = "arrived"  # content is in the thing


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
    """What must be true after an act, `of` which thing (the field of the command that names it, "" for what the moving
    hand holds, or for no thing), `by` which senses, and what becomes of the act otherwise.
    """

    claim: Claim
    of: str
    by: tuple[Sense, ...]
    otherwise: Otherwise


class Evidence(msgspec.Struct, frozen=True, array_like=True):
    """A claim about a thing ("" for none), and which senses told that it is true; none: it was not checked.

    `at`: when the last of them told, 0 where none did [s, simulated]; `within`: standard deviation of the thing's place
    by the eyes [m], 0 where it is not known.
    """

    claim: Claim
    of: Of
    by: tuple[Sense, ...] = ()
    at: float = 0.0
    within: float = 0.0


ABOUT_THINGS = frozenset({Claim.HELD, Claim.STANDS, Claim.OPEN, Claim.LEFT, Claim.ARRIVED})
"""Claims that a plan keeps until its end; the others are over with their act."""


def newest(known: Iterable[Evidence], told: Iterable[Evidence], held: Iterable[str]) -> tuple[Evidence, ...]:
    """Return what is known after an act that `told` this, and after which hands hold the things `held`.

    A thing that is held stands nowhere, and one that is not held any more is in no hand.
    """
    found = {(one.claim, one.of): one for one in (*known, *told) if one.claim in ABOUT_THINGS}
    now = set(held)
    over = {(Claim.STANDS, name) for name in now} | {key for key in found if key[0] is Claim.HELD and key[1] not in now}
    return tuple(one for key, one in found.items() if key not in over)


def unchecked(known: Iterable[Evidence]) -> tuple[Evidence, ...]:
    """Return the claims that no sense has told."""
    return tuple(one for one in known if not one.by)


def fitting(known: Iterable[Evidence], room: int) -> tuple[Evidence, ...]:
    """Return as much of it as fits into so many bytes, what was not checked first, then what is newest."""
    told: list[Evidence] = []
    for one in sorted(known, key=lambda one: (bool(one.by), -one.at)):
        if (room := room - len(msgspec.msgpack.encode(one))) < 0:
            break
        told.append(one)
    return tuple(told)

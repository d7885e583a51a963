"""The act that hands a held thing over to a person, and what must be true after it."""

from companion.languages.evidence import AnyClaim, Check, Otherwise, Sense
from companion.languages.facts import AnyKind, Facts, fact
from companion.languages.rc import Bend, Command, Done, Kilograms, Rest
from companion.languages.values import Name, Side
from companion.languages.wm import AnySight, GivenObject
from companion.rows import THERE, ActRow, ShownRow


class HandOver(Command, frozen=True):
    """Hold a thing out where the hand is, level; open when a person pulls at it steadily; watch it
    leave.

    `fingers`: angle to which they open [rad]. `mass`: of the empty thing [kg]. `wait`: for a pull
    [s].
    """

    side: Side
    object: Name
    fingers: Bend
    mass: Kilograms
    wait: Rest


class HandOverClaim(AnyClaim):
    """What is true of a thing that was handed over."""

    GIVEN = "given"  # it left the hand that gave it


class HandOverKind(AnyKind):
    """How a thing was handed over, and why it was not."""

    HANDED_OVER = "handed-over", "side a"
    FELT_LEAVING = "felt-leaving", "side a"
    SEEN_LEAVING = "seen-leaving", "a"
    NOT_SEEN_LEAVING = "not-seen-leaving", "a"
    NOBODY_PULLED = "nobody-pulled", "side a x:s"
    NOT_TAKEN = "not-taken", "a"
    NO_PLACE_TO_HAND_OVER = "no-place-to-hand-over", "side a"


def outcome_facts(command: HandOver, done: Done) -> Facts:
    """Facts that it was handed over, and whether it was felt and seen to leave."""
    by = next((one.by for one in done.evidence if one.claim is HandOverClaim.GIVEN), ())
    leaving = fact(HandOverKind.FELT_LEAVING, command.side, command.object)
    felt = (leaving,) if Sense.WRIST in by else ()
    seen = HandOverKind.SEEN_LEAVING if Sense.EYES in by else HandOverKind.NOT_SEEN_LEAVING
    over = fact(HandOverKind.HANDED_OVER, command.side, command.object)
    return (over, *felt, fact(seen, command.object))


def sights(command: HandOver, done: Done) -> tuple[AnySight, ...]:
    """What km is told: a person has it now."""
    return (GivenObject(object=command.object, side=command.side),)


_GIVEN = Check(HandOverClaim.GIVEN, "object", (Sense.WRIST, Sense.EYES), Otherwise.FAILED)
ACTS = (
    ActRow(
        HandOver,
        (THERE, _GIVEN),
        rest_s=10.0,
        handles=True,
        outcome_facts=outcome_facts,
        remembered=True,
        sights=sights,
    ),
)
SHOWN = (
    ShownRow(HandOver, "hand over", "#0f766e", "hands something over", "handed-over", ("object",)),
)

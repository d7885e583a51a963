"""The act that pours, what must be true after it, and what is said of it: how much left, and what
arrived.

The source is weighed before and after the tilt, in the same posture; then the eyes look into the
destination.
"""

from companion.languages.evidence import AnyClaim, Check, Otherwise, Sense
from companion.languages.facts import AnyKind, Facts, Kind, fact
from companion.languages.rc import Angle, Command, Done, Kilograms, Rest
from companion.languages.values import Name, Side
from companion.languages.wm import AnySight, FeltContent
from companion.rows import THERE, ActRow, ShownRow, held

LEAST_WEIGHED_KG = 0.015
"""Least difference of the two weights [kg] that counts as content that left: twice its standard
deviation (7.5 g, measured; the sensor drifts by 0.05 N between the two).
"""


class Pour(Command, frozen=True):
    """Tilt a held object over another one, hold, and turn it back.

    `azimuth`: world direction [rad] in which the opening moves down; `spin`: turn of the source
    about its axis [rad]. `tilts`: first and last tilt from the vertical [rad]. `hold`: time at the
    last tilt [s].
    """

    side: Side
    source: Name
    destination: Name
    azimuth: Angle
    spin: Angle
    tilts: tuple[Angle, Angle]
    hold: Rest
    empty_mass: Kilograms


class PourClaim(AnyClaim):
    """What is true of content."""

    LEFT = "left"  # content left the thing
    ARRIVED = "arrived"  # content is in the thing


class PourKind(AnyKind):
    """What a pour did, and why there is none."""

    LEFT = "left", "a x:kg"
    STILL_IN = "still-in", "a x:kg"
    ARRIVED = "arrived", "a x:kg"
    ARRIVED_SOME = "arrived-some", "a"
    REST_NOT_THERE = "rest-not-there", "a"
    NOT_SEEN_IN = "not-seen-in", "a", True
    NOTHING_LEFT = "nothing-left", "a x:kg y:kg"  # its mass before and after
    DURING_THE_TILT = "during-the-tilt", "because"
    BEFORE_THE_TILT = "before-the-tilt", "because"
    NO_TILT = "no-tilt", "a b"
    NO_POUR = "no-pour", "side a b"
    TOO_HIGH = "too-high", "a"  # to look into it
    INTO_ITSELF = "into-itself", "a"


def arrived(pour: Pour, done: Done) -> bool:
    """Whether content was seen to arrive: content that nobody saw there is not poured."""
    return done.arrived is True


def outcome_facts(pour: Pour, done: Done) -> Facts:
    """What was felt to leave, and what was seen to arrive."""
    felt = () if done.weighed is None else _felt(pour, *done.weighed)
    return (*felt, *_looked_into(pour, done))


def _felt(pour: Pour, before: float, after: float) -> Facts:
    """How much [kg] was felt to leave a source, and how much to stay in it, to a gram."""
    rest = after - pour.empty_mass
    left = fact(PourKind.STILL_IN, pour.source, round(rest, 3))
    still = (left,) if rest > LEAST_WEIGHED_KG else ()
    return (fact(PourKind.LEFT, pour.source, round(before - after, 3)), *still)


def _looked_into(pour: Pour, done: Done) -> Facts:
    """How much was seen in the destination then, to ten grams."""
    name = pour.destination
    if name in done.missing:
        return (fact(Kind.NOT_WHERE_IT_WAS, name),)
    if done.arrived is None:
        return (fact(PourKind.NOT_SEEN_IN, name),)
    seen = next((one.content for one in done.seen if one.object == name), None)
    if seen is None:
        there = fact(PourKind.ARRIVED_SOME, name)
    else:
        there = fact(PourKind.ARRIVED, name, round(seen, 2))
    return (there,) if done.arrived else (there, fact(PourKind.REST_NOT_THERE, name))


def sights(pour: Pour, done: Done) -> tuple[AnySight, ...]:
    """What was felt to leave, for km."""
    if done.weighed is None:
        return ()
    before, after = done.weighed
    return (FeltContent(source=pour.source, destination=pour.destination, left=before - after),)


_CHECKS = (
    THERE,
    held("source"),
    Check(PourClaim.LEFT, "source", (Sense.WRIST, Sense.EYES), Otherwise.SAID),
    Check(PourClaim.ARRIVED, "destination", (Sense.EYES,), Otherwise.FAILED),
)
ACTS = (
    ActRow(
        Pour,
        _CHECKS,
        rest_s=30.0,
        handles=True,
        fulfilled=arrived,
        outcome_facts=outcome_facts,
        sights=sights,
    ),
)
SHOWN = (ShownRow(Pour, "pour", "#be185d", "pours", "poured", ("source", "destination")),)

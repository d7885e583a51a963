"""Messages of ta: observations to km, one per subject (paper, step 6: observing the environment); a
look around.
"""

from collections.abc import Iterator

from companion.languages import rc, wm
from companion.languages.evidence import Claim, Evidence, Sense, newest, unchecked
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Side
from companion.look_around import POINTS

SURVEY = rc.Look(key="survey", at=POINTS)
"""The look around for a new observer of the world."""


def observations(
    outcome: rc.Done | rc.NotDone, known: tuple[Evidence, ...] = ()
) -> Iterator[wm.AnySight]:
    """Yield what is nowhere any more, the posture, what each hand holds, then everything seen or
    put down that no hand holds. `known`: evidence after the act.
    """
    by = {one.of: one.by for one in known if one.claim is Claim.HELD}
    for name in outcome.missing:
        yield wm.MissingObject(object=name)
    if isinstance(outcome, rc.NotDone):
        for side, name in outcome.lost.items():
            yield wm.LostObject(object=name, side=side)
    if outcome.body is not None:
        yield wm.SeenBody(body=outcome.body)
    in_hand = set()
    for side in Side:
        held = outcome.held.get(side)
        if held is None:
            yield wm.SeenHand(side=side)
        else:
            name, grasp, pose = held
            in_hand.add(name)
            yield wm.SeenHand(side, name, grasp, pose, by.get(name, ()))
    for seen in outcome.seen:
        if seen.object not in in_hand:
            yield wm.SeenObject(
                seen.object, seen.model, seen.pose, seen.at, seen.content, seen.uncertainty
            )
    for one in outcome.placed:
        yield wm.PlacedObject(object=one.object, model=one.model, pose=one.pose, at=one.at)


def known_after(known: tuple[Evidence, ...], outcome: rc.Done | rc.NotDone) -> tuple[Evidence, ...]:
    """The evidence after an act. An object that stands where it was put is checked by any act that
    sees it: ex would have told that it fell over or is elsewhere. Whether a hand holds what its
    wrist does not feel is not checked.
    """
    held = {name for name, _, _ in outcome.held.values()}
    put = {one.of for one in known if one.claim is Claim.STANDS}
    seen = (one for one in outcome.seen if one.object in put and one.object not in held)
    sure = {one.object: one.uncertainty for one in outcome.seen}
    within = {name: known.deviation if known else 0.0 for name, known in sure.items()}
    by = (Sense.EYES,)
    stands = (Evidence(Claim.STANDS, one.object, by, one.at, within[one.object]) for one in seen)
    if isinstance(outcome, rc.Done):
        return newest((*known, *stands), outcome.evidence, held)
    by_wrist = (one for one in outcome.why if one.kind is Kind.WRIST_DOUBTED)
    doubted = (Evidence(Claim.HELD, one.things[0]) for one in by_wrist)
    return newest(known, doubted, held)


def not_checked(known: tuple[Evidence, ...]) -> Facts:
    """Claims that no sense has checked."""
    return tuple(fact(Kind.NOT_CHECKED, one.claim, one.of) for one in unchecked(known))


def ill(outcome: rc.Done | rc.NotDone) -> Facts:
    """The faulty sensors, and how they are faulty."""
    return tuple(fact(Kind.ILL, one.sense, one.fault, one.off) for one in outcome.ill)


def subject(observation: wm.AnyObservation) -> str:
    """The subject of an observation; the newest one of a subject replaces the older ones."""
    if isinstance(observation, wm.NothingSeen):
        return "look"
    if isinstance(observation, wm.WorldLost):
        return "world"
    if isinstance(observation, wm.SeenBody):
        return "body"
    if isinstance(observation, wm.SeenHand):
        return f"hand/{observation.side}"
    if isinstance(observation, wm.FeltContent):
        return f"content/{observation.source}"
    return f"object/{observation.object}"

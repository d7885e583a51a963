"""Faulty sensors, the acts that are not begun because of them, and which senses told that an act
was done.

Acts that have to be checked are checked by the camera or by the wrist of the hand: one of them
suffices. An arm does not move by poses or joints that are off by more than its paths allow. An act
without an arm is begun with any camera: a look shows whether that is well again.
"""

from collections.abc import Generator, Mapping

import numpy as np

from companion.acts import ACTS
from companion.languages import rc
from companion.languages.evidence import AnyClaim, Claim, Evidence, Sense
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Side
from companion.skills import motions
from companion.skills.loop_messages import GripReport, Motion
from companion.skills.situation import Situation
from companion.skills.skill import Sensed, SkillRow, Tells, failed
from velma.control.grip import Grip
from velma.eyes.health import MOST_OFF
from velma.kinematics.tasks.looking import REST_S

WRIST = {Side.RIGHT: rc.Sensor.RIGHT_WRIST, Side.LEFT: rc.Sensor.LEFT_WRIST}
ARM = {Side.RIGHT: rc.Sensor.RIGHT_ARM, Side.LEFT: rc.Sensor.LEFT_ARM}
# one after the other; estimate: of pictures up to 40 % too dark or bright some show no marker
BLIND_LOOKS = 3
# that a hand may be beside where its joints say: a stream that misses by more falls beside
MOST_BESIDE_M = 0.015
_SLIPS = (Grip.WARNED, Grip.SLIPPED, Grip.LOST)


def take(here: Situation, sensed: Sensed) -> None:
    """Note what a motion shows of the sensors; call it before its sights are taken."""
    # A hand with a sensor weighs never exactly nothing.
    here.numb = {
        side for side in Side if side not in sensed.grips or sensed.grips[side].mass == 0.0
    }
    for side, held in here.held.items():
        felt = sensed.grips.get(side, GripReport())
        held.slipped = held.slipped or felt.felt in _SLIPS
        # its support carries it, and turns it in the hand
        if felt.felt == Grip.UNSURE and felt.mass < held.mass / 2.0:
            held.steady = None
    if sensed.sights:
        here.blind = 0
    elif not sensed.wrong and not sensed.off and here.must_show():
        here.blind += 1


def faulty(here: Situation, sensed: Sensed) -> tuple[rc.Ill, ...]:
    """The faulty sensors; call it after the sights of the motion were taken."""
    wrong = {side: grip.wrong for side, grip in sensed.grips.items() if grip.wrong}
    found = [rc.Ill(WRIST[Side(side)], rc.Fault(one)) for side, one in wrong.items()]
    if sensed.wrong:
        found.append(rc.Ill(rc.Sensor.CAMERA, rc.Fault(sensed.wrong)))
    elif here.blind >= BLIND_LOOKS:
        found.append(rc.Ill(rc.Sensor.CAMERA, rc.Fault.BLIND))
    if sensed.off:
        found.append(rc.Ill(rc.Sensor.NECK, rc.Fault.OFF, _short(sensed.off)))
    for side, held in here.held.items():
        if angle := held.turned()[0]:
            found.append(rc.Ill(ARM[Side(side)], rc.Fault.OFF, _short(angle)))
    return tuple(found)


def refused(here: Situation, command: rc.Command, row: SkillRow) -> Facts:
    """Why an act is not begun with these senses; () where it is."""
    side = getattr(command, "side", None)
    return () if side is None else _doubts(here, side, row.by_joints, row.checked)


def require(here: Situation, side: Side) -> None:
    """Raise failed if an act of this hand cannot go on, or not be checked, with the senses as they
    are now.
    """
    if why := _doubts(here, side, by_joints=True, checked=True):
        raise failed(*why)


def require_sight(here: Situation) -> None:
    """Raise failed if what the eyes show now is nothing, or not true."""
    if _ill(here, rc.Sensor.CAMERA) or _off(here):
        raise failed(fact(Kind.NOTHING_IS_SEEN))


def _doubts(here: Situation, side: Side, by_joints: bool, checked: bool) -> Facts:
    if _off(here):
        why = fact(Kind.BODY_OFF, MOST_OFF)
    elif by_joints and _beside(here, side):
        why = fact(Kind.ARM_OFF, side, MOST_BESIDE_M)
    elif (
        checked and _ill(here, rc.Sensor.CAMERA) and (side in here.numb or _ill(here, WRIST[side]))
    ):
        why = fact(Kind.UNCHECKABLE, side)
    else:
        return ()
    return (fact(Kind.NOT_BEGUN, why),)


def _ill(here: Situation, sense: rc.Sensor) -> bool:
    return any(one.sense == sense for one in here.ill)


def _off(here: Situation) -> bool:
    return any(one.sense == rc.Sensor.NECK and one.off > MOST_OFF for one in here.ill)


def _beside(here: Situation, side: Side) -> bool:
    """Whether the hand is elsewhere; where a slip was felt, that tells why its thing is."""
    held = here.held.get(side)
    return held is not None and not held.slipped and held.turned()[1] > MOST_BESIDE_M


def _short(angle: float) -> float:
    return float(np.round(angle, 4))


# --- Before a thing that should be there is missing, the head looks again: some pictures do not
# show what is there


# before a thing is missing; estimate: of pictures up to 40 % too dark or bright some show no marker
MORE_LOOKS = 3


def missed(here: Situation, key: str, name: str, sensed: Sensed) -> Generator[Motion, Sensed, bool]:
    """Look again where a thing should be and is not seen, and return whether it is missing: no
    picture shows it.
    """
    for _ in range(MORE_LOOKS):
        if name in {sight.name for sight in sensed.sights} or not here.surely_seen(name):
            break
        point = here.seen[name].translation
        sensed = yield motions.still(
            here, key, watch=(point[0], point[1], point[2]), settle_s=REST_S
        )
    return here.miss(name, sensed.sights)


IN_HAND_M = 0.25
"""Between grip and origin of a held thing: a jar or bowl is held within 0.15 m of it (grasps.json),
estimate.
"""
_IN_HAND = (Grip.HELD, Grip.WARNED, Grip.SLIPPED)
Tellers = Mapping[tuple[AnyClaim, Sense], Tells]


def evidence(
    here: Situation, command: rc.Command, sensed: Sensed | None, own: Tellers
) -> tuple[Evidence, ...]:
    """The evidence for an act that is done; `sensed`: after its last motion, None if it had none.

    `own`: how senses tell the claims of this act alone. A claim about a held thing is left out
    where the hand holds nothing, and one about a thing where the command names none.
    """
    if sensed is None:
        return ()
    tells, found = {**TELLS, **own}, []
    for check in ACTS[type(command)].checks:
        held = here.held.get(getattr(command, "side", "")) if check.claim is Claim.HELD else None
        if check.claim is Claim.HELD and held is None:
            continue
        of = getattr(command, check.of) if check.of else held.object if held is not None else ""
        if check.of and not of:
            continue
        telling = {sense: tells[check.claim, sense] for sense in check.by}
        by = tuple(sense for sense, tell in telling.items() if tell(here, command, sensed, of))
        of_place = Sense.EYES in by and tells[check.claim, Sense.EYES] is seen
        uncertainty = here.uncertain.get(of) if of_place else None
        within = 0.0 if uncertainty is None else uncertainty.deviation
        found.append(Evidence(check.claim, of, by, here.time if by else 0.0, within))
    return tuple(found)


def _felt(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    return side is not None and side in sensed.grips and sensed.grips[side].felt in _IN_HAND


def _touched(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    return side is not None and any(sensed.touched.get(side, ()))


def _in_hand(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    inside = here.held[side].T_grip_object.translation if side is not None else np.full(3, np.inf)
    return of in here.looked_at and bool(np.linalg.norm(inside) < IN_HAND_M)


def seen(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    """Tell a claim about the place of a thing: it was seen there, in no hand."""
    return of in here.looked_at and here.holder(of) is None


TELLS: Tellers = {
    # The loop ends a motion only where joints, hand and fingers are at its end.
    (Claim.THERE, Sense.JOINTS): lambda here, command, sensed, of: True,
    (Claim.HELD, Sense.WRIST): _felt,
    (Claim.HELD, Sense.FINGERS): _touched,
    (Claim.HELD, Sense.EYES): _in_hand,
    (Claim.STANDS, Sense.EYES): seen,
    (Claim.LOOKED, Sense.EYES): lambda here, command, sensed, of: bool(here.looked_at),
}
"""How senses tell the claims that acts of any task may have."""

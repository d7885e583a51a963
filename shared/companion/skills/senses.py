"""Faulty sensors, and the acts that are not begun because of them.

Acts that have to be checked are checked by the camera or by the wrist of the hand: one of them
suffices. An arm does not move by poses or joints that are off by more than its paths allow. An act
without an arm is begun with any camera: a look shows whether that is well again.
"""

from collections.abc import Generator

import numpy as np

from companion.languages import rc
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Side
from companion.skills import motions
from companion.skills.loop_messages import GripReport, Motion
from companion.skills.situation import Situation
from companion.skills.skill import Sensed, SkillRow, failed
from velma.control.grip import Grip
from velma.eyes.health import MOST_OFF

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


REST_S = 0.1  # of a look; estimate: a frame of the simulated camera takes 67 ms
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

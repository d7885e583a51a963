"""Faulty sensors, and the acts that are not begun because of them.

A grasp, a pour and putting down are checked by the camera or by the wrist of the hand: one of them suffices. An arm
does not move by poses or joints that are off by more than its paths allow. A look is begun with any camera, since it
shows whether that is well again.
"""

from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np

from companion.languages import rc
from companion.languages.facts import Fact, Facts, Kind, fact
from companion.languages.values import Side
from services.executor.loop.program import GripReport
from services.executor.skills.situation import Situation
from services.executor.skills.skill import NotPossible, Sensed
from velma.control.grip import Grip
from velma.eyes.health import MOST_OFF

WRIST = {Side.RIGHT: rc.Sensor.RIGHT_WRIST, Side.LEFT: rc.Sensor.LEFT_WRIST}
ARM = {Side.RIGHT: rc.Sensor.RIGHT_ARM, Side.LEFT: rc.Sensor.LEFT_ARM}
BLIND_LOOKS = 3  # one after the other; estimate: of pictures up to 40 % too dark or bright some show no marker
MOST_BESIDE_M = 0.015  # that a hand may be beside where its joints say: a stream that misses by more falls beside
_SLIPS = (Grip.WARNED, Grip.SLIPPED, Grip.LOST)

Act = rc.Act
_ARMS = (rc.MoveJoint, rc.MoveCartesian, rc.Grasp, rc.Release, rc.Pour, rc.OpenDoor, rc.Home)
_BY_JOINTS = tuple(act for act in _ARMS if act is not rc.Release)  # that goes by where the thing is seen in the hand
_CHECKED = (rc.Grasp, rc.Release, rc.Pour)


def take(here: Situation, sensed: Sensed) -> None:
    """Note what a motion shows of the sensors; call it before its sights are taken."""
    here.numb = {side for side in Side if not _feels(sensed, side)}
    for side, held in here.held.items():
        felt = sensed.grips.get(side, GripReport())
        held.slipped = held.slipped or felt.felt in _SLIPS
        if felt.felt == Grip.UNSURE and felt.mass < held.mass / 2.0:  # its support carries it, and turns it in the hand
            held.steady = None
    if sensed.sights:
        here.blind = 0
    elif not sensed.wrong and not sensed.off and here.must_show():
        here.blind += 1


def told(here: Situation, sensed: Sensed) -> tuple[rc.Ill, ...]:
    """Return the faulty sensors; call it after the sights of the motion were taken."""
    return tuple(_told(here, sensed))


def _told(here: Situation, sensed: Sensed) -> Iterator[rc.Ill]:
    for side, grip in sensed.grips.items():
        if grip.wrong:
            yield rc.Ill(WRIST[Side(side)], rc.Fault(grip.wrong))
    if sensed.wrong:
        yield rc.Ill(rc.Sensor.CAMERA, rc.Fault(sensed.wrong))
    elif here.blind >= BLIND_LOOKS:
        yield rc.Ill(rc.Sensor.CAMERA, rc.Fault.BLIND)
    if sensed.off:
        yield rc.Ill(rc.Sensor.NECK, rc.Fault.OFF, _short(sensed.off))
    for side, held in here.held.items():
        if angle := held.turned()[0]:
            yield rc.Ill(ARM[Side(side)], rc.Fault.OFF, _short(angle))


def refused(here: Situation, command: Act) -> Facts:
    """Return why an act is not begun with these senses; () where it is."""
    if isinstance(command, rc.Look):
        return ()
    side = command.side
    rows = (why(side) for acts, when, why in _NOT_BEGUN if isinstance(command, acts) and when(here, side))
    return tuple(fact(Kind.NOT_BEGUN, why) for why in islice(rows, 1))


def require(here: Situation, command: Act) -> None:
    """Raise failed if the act cannot go on with the senses as they are now: of a look, if it shows nothing true."""
    blind = isinstance(command, rc.Look) and (_ill(here, rc.Sensor.CAMERA) or _off(here))
    if why := (fact(Kind.NOTHING_IS_SEEN),) if blind else refused(here, command):
        raise NotPossible(rc.NotDoneKind.FAILED, why)


def _ill(here: Situation, sense: rc.Sensor) -> bool:
    return any(one.sense == sense for one in here.ill)


def _unchecked(here: Situation, side: Side) -> bool:
    return _ill(here, rc.Sensor.CAMERA) and (side in here.numb or _ill(here, WRIST[side]))


def _off(here: Situation, _: Side | None = None) -> bool:
    return any(one.sense == rc.Sensor.NECK and one.off > MOST_OFF for one in here.ill)


def _beside(here: Situation, side: Side) -> bool:
    """Whether the hand is elsewhere; where a slip was felt, that tells why its thing is."""
    return side in here.held and not here.held[side].slipped and here.held[side].turned()[1] > MOST_BESIDE_M


def _feels(sensed: Sensed, side: Side) -> bool:
    """Whether the hand has a sensor: one that has weighs never exactly nothing."""
    return side in sensed.grips and sensed.grips[side].mass != 0.0


def _short(angle: float) -> float:
    return float(np.round(angle, 4))


_Row = tuple[tuple[type[Act], ...], Callable[[Situation, Side], bool], Callable[[Side], Fact]]
_NOT_BEGUN: tuple[_Row, ...] = (
    (_ARMS, _off, lambda _: fact(Kind.BODY_OFF, MOST_OFF)),
    (_BY_JOINTS, _beside, lambda side: fact(Kind.ARM_OFF, side, MOST_BESIDE_M)),
    (_CHECKED, _unchecked, lambda side: fact(Kind.UNCHECKABLE, side)),
)
"""Which acts are not begun, when, and why."""

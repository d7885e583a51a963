"""The skill that hands over: hold still, feel for a steady pull, open once, and watch the thing
leave.

The hand opens for a pull that wrist and joints feel (velma.control.grip), and only while the thing
is not tilted over. It does not follow the thing. Nobody who pulls for a time: the hand keeps the
thing, and the plan says what comes next.
"""

from functools import partial

import numpy as np
import pinocchio as pin

from companion.languages import rc
from companion.languages.evidence import AnyClaim, Sense
from companion.languages.facts import Kind, fact
from companion.skills import motions
from companion.skills.loop_messages import GripReport, Open, Until
from companion.skills.situation import Held, Situation
from companion.skills.skill import (
    NotPossible,
    Sensed,
    Skill,
    SkillRow,
    Tells,
    despite_cancel,
    failed,
    replan,
)
from companion.tasks.hand_over.done import HandOver, HandOverClaim, HandOverKind
from velma.kinematics.frames import tilt
from velma.kinematics.tasks.carrying import CARRY_TILT

PULL_N, PULL_S = 5.0, 0.3  # issue: more than a touch, longer than a knock
LEAST_S = 0.5  # of waiting, so that each wait is longer than a pull (estimate)
OPEN_BY, OPEN_SPEED, WIDE_SPEED = 0.45, 2.0, 1.0
"""rad, rad/s, rad/s: half open in 0.25 s, so that the person does not pull in vain, then wide;
estimates.
"""
NARROW = 0.05  # rad: by less no finger is opened further (estimate)
# s before a look, and looks: a person takes a thing away in a second (estimate)
LEAVES_S, LOOKS = 0.4, 3
# from where it was held: nearer it is in the hand, lower it fell (estimates)
IN_HAND_M, BELOW_M = 0.05, 0.15


def hand_over(here: Situation, command: HandOver) -> Skill:
    """Hand it over. Raises replan if the hand does not hold it, failed if nobody pulls, lost if it
    is seen to fall.
    """
    side = command.side
    held = here.held.get(side)
    if held is None or held.object != command.object:
        raise replan(fact(Kind.HOLDS_NOT, side, command.object))
    until = here.time + command.wait
    while (left := until - here.time) > LEAST_S:
        at = here.robot.grip(here.q, side) * held.T_grip_object
        sensed = yield motions.still(
            here, command.key, watch=at.translation, until=Until.PULL, pull_side=str(side),
            pull_n=PULL_N,
            pull_s=PULL_S, settle_s=left,
        )  # fmt: skip
        if not sensed.grips.get(side, GripReport()).pull:
            break
        if _level(here, side, held, sensed):
            yield from _give(here, command, at)
            return
    raise failed(fact(HandOverKind.NOBODY_PULLED, side, command.object, command.wait))


def _level(here: Situation, side: str, held: Held, sensed: Sensed) -> bool:
    """Whether the thing is upright by the joints, and by the eyes where they see it: nothing would
    leave it.
    """
    poses = [here.robot.grip(sensed.measured, side) * held.T_grip_object]
    poses += [one.T_world_object for one in sensed.sights if one.name == held.object]
    return all(tilt(pose) < CARRY_TILT for pose in poses)


def _give(here: Situation, command: HandOver, at: pin.SE3) -> Skill:
    """Open the hand, once, and note by which senses the thing has left it; a cancel changes nothing
    any more.
    """
    side, name = command.side, command.object
    opened = motions.hand(side, Open(OPEN_BY, OPEN_SPEED)) | motions.payload(side)
    sensed = yield from despite_cancel(lambda: motions.still(here, command.key, **opened))
    here.lose(side)
    for _ in range(LOOKS):
        here.place(name, at)
        more = sensed.fingers.get(side, 0.0) - command.fingers
        # Open, since a finger that the thing bent on its way out need not come to an angle.
        wide = motions.hand(side, Open(more, WIDE_SPEED)) if more > NARROW else {}
        look = partial(
            motions.still, here, command.key, watch=at.translation, settle_s=LEAVES_S, **wide
        )
        sensed = yield from despite_cancel(look)
        here.set_fingers(side, sensed.fingers.get(side, command.fingers))
        here.noted = gone = _gone(here, command, sensed, at)
        if gone >= {Sense.WRIST, Sense.EYES}:
            break
    fell = next((one for one in sensed.sights if one.name == name), None)
    if fell is not None and fell.T_world_object.translation[2] < at.translation[2] - BELOW_M:
        raise NotPossible(rc.NotDoneKind.LOST, fact(Kind.LOST, side, name))
    here.forget(name)


def _gone(here: Situation, command: HandOver, sensed: Sensed, at: pin.SE3) -> frozenset[Sense]:
    """Which senses tell that the thing is not in the hand any more, where it was at a pose in the
    world.
    """
    told = set()
    felt = sensed.grips.get(command.side, GripReport())
    if not felt.wrong and felt.mass and felt.mass < command.mass / 2.0:
        told.add(Sense.WRIST)
    seen = next((one.T_world_object for one in sensed.sights if one.name == command.object), None)
    if seen is not None:
        away = bool(np.linalg.norm(seen.translation - at.translation) > IN_HAND_M)
    else:
        away = bool(sensed.sights) and not sensed.wrong and here.surely_seen(command.object, at)
    return frozenset(told | ({Sense.EYES} if away else set()))


def _noted_by(here: Situation, command: HandOver, sensed: Sensed, of: str, by: Sense) -> bool:
    return isinstance(here.noted, frozenset) and by in here.noted


TELLS: dict[tuple[AnyClaim, Sense], Tells] = {
    (HandOverClaim.GIVEN, sense): partial(_noted_by, by=sense)
    for sense in (Sense.WRIST, Sense.EYES)
}
SKILLS = (SkillRow(HandOver, hand_over, carries=True, checked=True, tells=TELLS),)

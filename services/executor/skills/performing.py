"""Runs the skill of a robot command to its outcome, and updates the situation after each motion.

What a hand does not feel, the act has not done: a hand that lost its thing, or never lifted it, is opened, and the
outcome says so.
"""

from collections.abc import Collection, Generator
from typing import Any

from msgspec.structs import replace

from companion.languages import rc, rs
from companion.languages.values import BodyPosture, Pose, Side
from services.executor.loop.program import Motion, Open, Phase
from services.executor.skills import SKILLS, motions
from services.executor.skills.situation import Situation
from services.executor.skills.skill import Cancelled, NotPossible, Sensed, Skill
from velma import names
from velma.control.grip import Grip
from velma.errors import MotionError
from velma.kinematics.frames import xyz_quat

OPEN_BY, OPEN_SPEED = 0.45, 2.0  # [rad], [rad/s]: half open within 0.25 s, so that it is told at once; estimates
_MOVES_A_THING = (rc.MoveJoint, rc.MoveCartesian, rc.Pour)
Names = Collection[str]
Performance = Generator[Motion, Sensed, rc.Done | rc.NotDone]


def perform(here: Situation, command: rc.Act) -> Performance:
    """Yield motions, take the Sensed of each, return the outcome."""
    began, sights, sensed = here.time, {}, None
    here.begin()
    skill: Skill = SKILLS[type(command)](here, command)
    try:
        motion = next(skill)
        while True:
            sensed = yield motion
            take(here, sensed)
            sights.update({s.name: s for s in sensed.sights})
            if sensed.ended == Phase.CANCELLED:
                motion = skill.throw(Cancelled())
            elif sensed.ended == Phase.SLIPPED:
                motion = skill.throw(NotPossible(Phase.SLIPPED, sensed.reason))
            elif sensed.ended == Phase.DONE:
                motion = skill.send(sensed)
            elif sensed.ended == Phase.LOST:
                return (
                    yield from _emptied(here, sights, command.key, Phase.LOST, _feeling(here, sensed, Grip.LOST), began)
                )
            else:
                return ended(here, sights, command.key, sensed.ended, sensed.reason, began)
    except StopIteration:
        if unfelt := _unfelt(here, command, sensed):
            return (yield from _emptied(here, sights, command.key, rc.NotDoneKind.EMPTY, unfelt, began))
        return _done(here, sights, command.key, began)
    except Cancelled:
        return ended(here, sights, command.key, rc.NotDoneKind.CANCELLED, "cancelled", began)
    except NotPossible as reason:
        if unfelt := _unfelt(here, command, sensed):
            return (yield from _emptied(here, sights, command.key, rc.NotDoneKind.EMPTY, unfelt, began))
        return ended(here, sights, command.key, reason.kind, reason.reason, began)
    except MotionError as wrong:
        return ended(here, sights, command.key, rc.NotDoneKind.FAILED, str(wrong), began)


def _unfelt(here: Situation, command: rc.Act, sensed: Sensed | None) -> list[str]:
    """Return the side of the hand that the command moved, if it does not feel what it should hold."""
    moved = command.side if isinstance(command, _MOVES_A_THING) else ""
    return [side for side in _feeling(here, sensed, Grip.UNSURE) if side == moved and _light(here, sensed, side)]


def _light(here: Situation, sensed: Sensed | None, side: str) -> bool:
    """Whether less than half of the thing's mass is in the hand; with more it is there, whatever touches it."""
    return sensed is not None and sensed.grips[side].mass < here.held[side].mass / 2.0


def _feeling(here: Situation, sensed: Sensed | None, felt: Grip) -> list[str]:
    """Return the sides that should hold something and feel this."""
    grips = {} if sensed is None else sensed.grips
    return [side for side in here.held if side in grips and grips[side].felt == felt]


def _emptied(here: Situation, sights: Names, key: str, kind: str, sides: list[str], began: float) -> Performance:
    """Open hands that do not hold what they should, so that they can move again, and return the outcome."""
    lost = {Side(side): here.lose(side) for side in sides}
    hands: dict[str, Any] = {}
    for side in sides:
        hands |= motions.hand(side, Open(OPEN_BY, OPEN_SPEED)) | motions.payload(side)
    sensed = yield motions.still(here, key, **hands)
    take(here, sensed)
    for side, name in lost.items():
        here.set_fingers(side, sensed.fingers[side])
        here.forget(name)  # it may have been seen while it fell
    words = "lost" if kind == Phase.LOST else "does not feel"
    reason = " and ".join(f"the {side} hand {words} {name}" for side, name in lost.items())
    return replace(ended(here, sights, key, kind, reason, began), lost=lost)


def take(here: Situation, sensed: Sensed) -> None:
    """Update the situation after a motion."""
    here.q, here.head, here.time = sensed.q.copy(), sensed.head, sensed.time
    here.see(sensed.sights)


def _done(here: Situation, sights: Names, key: str, began: float) -> rc.Done:
    """Return the outcome of an act that was done."""
    seen, placed = _seen_and_placed(here, sights)
    took, missing = here.time - began, tuple(sorted(here.missing))
    return rc.Done(key, posture(here), seen, held(here), took, here.weighed, placed, here.arrived, missing)


def ended(here: Situation, sights: Names, key: str, kind: str, reason: str, began: float) -> rc.NotDone:
    """Return the outcome of an act that was not done."""
    seen, placed = _seen_and_placed(here, sights)
    took, missing = here.time - began, tuple(sorted(here.missing))
    return rc.NotDone(key, kind, reason, posture(here), seen, held(here), took, placed=placed, missing=missing)


def _seen_and_placed(here: Situation, sights: Names) -> tuple[tuple[rs.Seen, ...], tuple[rs.Seen, ...]]:
    """Return what was seen in this act, and what a hand let go of and that was not seen since."""
    seen = (name for name in sights if name not in here.placed and (name in here.seen or here.holder(name)))
    placed = here.placed.items()
    return tuple(_at(here, name, here.time) for name in seen), tuple(_at(here, name, at) for name, at in placed)


def _at(here: Situation, name: str, time: float) -> rs.Seen:
    side = here.holder(name)
    pose = here.seen[name] if side is None else here.robot.grip(here.q, side) * here.held[side].T_grip_object
    content = here.contents[name] if name in here.looked_into else None
    uncertainty = here.uncertain.get(name) if side is None else None
    return rs.Seen(name, here.models[name], Pose(*xyz_quat(pose)), time, content, uncertainty)


def posture(here: Situation) -> BodyPosture:
    """Return the posture for a communicate."""
    right, left = (tuple(float(x) for x in here.q[names.ARM[side]]) for side in ("right", "left"))
    hands = {side: (angle, angle, angle, 0.0) for side, angle in here.fingers.items()}
    return BodyPosture(float(here.q[names.TORSO]), right, left, here.head, hands["right"], hands["left"])


def held(here: Situation) -> dict[Side, tuple[str, str, Pose]]:
    """Return what each hand holds, for a communicate."""
    return {Side(s): (h.object, h.grasp, Pose(*xyz_quat(h.T_grip_object))) for s, h in here.held.items()}

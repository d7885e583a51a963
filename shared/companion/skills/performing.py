"""Runs the skill of a robot command to its outcome, and updates the situation after each motion.

What a hand does not feel, the act has not done: a hand that lost its thing, or never lifted it, is
opened, and the outcome says so. But it is opened only if the joints or the eyes tell the same: the
wrist alone may be wrong. An act that no sense could check is not begun.
"""

from collections.abc import Collection, Generator
from typing import Any

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from companion import tasks
from companion.languages import rc, rs
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import BodyPosture, Pose, Side
from companion.skills import motions, moving, senses
from companion.skills.loop_messages import Motion, Open, Phase, refusal
from companion.skills.senses import MORE_LOOKS, evidence
from companion.skills.situation import Situation
from companion.skills.skill import Asked, Cancelled, NotPossible, Sensed, Skill, SkillRow
from velma import names
from velma.control.cartesian import GRAVITY, CartesianGains
from velma.control.grip import Grip
from velma.errors import MotionError
from velma.kinematics.frames import xyz_quat

SKILLS: dict[type[rc.Command], SkillRow] = {
    row.act: row for part in (moving, *tasks.parts("perform")) for row in part.SKILLS
}
"""Which skill performs which act: those of this toolkit, and those of the tasks."""
# [s] until a hand that was stopped hangs still: -0.4 mm with the jar, 1.3 mm without it (measured)
SAG_S = 0.3
# nearer to its place in the hand, a thing is in it (estimate: that place is known to 1 cm)
IN_HAND_M = 0.05
# [rad], [rad/s]: half open within 0.25 s, so that it is told at once; estimates
OPEN_BY, OPEN_SPEED = 0.45, 2.0
Names = Collection[str]
Performance = Generator[Asked, Sensed, rc.Done | rc.NotDone]


def perform(here: Situation, command: rc.Command) -> Performance:
    """Yield motions, take the Sensed of each, return the outcome."""
    here.begin()
    if why := senses.refused(here, command, SKILLS[type(command)]):
        return ended(here, (), command.key, rc.NotDoneKind.REFUSED, why, here.time)
    return (yield from _carried_out(here, command))


def _carried_out(here: Situation, command: rc.Command) -> Performance:
    began, sights, sensed, known = here.time, {}, None, {}
    skill = SKILLS[type(command)].skill(here, command)
    try:
        motion = next(skill)
        while True:
            known = {side: held.T_grip_object for side, held in here.held.items()}
            sensed = yield from _to_its_end(skill, motion)
            take(here, sensed)
            sights.update({s.name: s for s in sensed.sights})
            if sensed.ended == Phase.CANCELLED:
                motion = skill.throw(Cancelled())
            elif sensed.ended == Phase.SLIPPED:
                motion = skill.throw(NotPossible(Phase.SLIPPED, *sensed.why))
            elif sensed.ended == Phase.DONE:
                motion = skill.send(sensed)
            elif sensed.ended == Phase.LOST:
                felt = {side: sensed.grips[side].felt for side in here.held if side in sensed.grips}
                lost = [side for side, grip in felt.items() if grip == Grip.LOST]
                unfelt = {side: known[side] for side in lost}
                return (yield from _emptied(here, sights, command.key, Phase.LOST, unfelt, began))
            else:
                return ended(here, sights, command.key, sensed.ended, sensed.why, began)
    except StopIteration:
        kind, why = "", Facts()
    except Cancelled:
        return ended(
            here, sights, command.key, rc.NotDoneKind.CANCELLED, (fact(Kind.CANCELLED),), began
        )
    except NotPossible as hindered:
        kind, why = hindered.kind, hindered.why
    except MotionError as wrong:
        kind, why, here.refused = rc.NotDoneKind.FAILED, refusal(wrong).why, str(wrong)
    if sensed is not None and (sides := _unfelt(here, command, sensed)):
        unfelt = {side: known[side] for side in sides}
        return (yield from _emptied(here, sights, command.key, rc.NotDoneKind.EMPTY, unfelt, began))
    if not kind and (why := here.astray()):
        kind = rc.NotDoneKind.REPLAN
    return (
        ended(here, sights, command.key, kind, why, began)
        if kind
        else _done(here, sights, command, sensed, began)
    )


def _to_its_end(skill: Skill, motion: Asked) -> Generator[Asked, Sensed, Sensed]:
    """Run a motion of a skill, which answers the looks at it, and return what is sensed at its
    end.
    """
    sensed = yield motion
    while sensed.ended == Phase.RUNNING:
        sensed = yield skill.send(sensed)
    return sensed


def _unfelt(here: Situation, command: rc.Command, sensed: Sensed) -> list[str]:
    """The side of the hand that carried through the act, if it does not feel what it should hold.

    With half of the thing's mass or more in it, the thing is there, whatever touches it.
    """
    side = getattr(command, "side", "") if SKILLS[type(command)].carries else ""
    if side not in here.held or side not in sensed.grips:
        return []
    grip = sensed.grips[side]
    return [side] if grip.felt == Grip.UNSURE and grip.mass < here.held[side].mass / 2.0 else []


def _emptied(
    here: Situation, sights: Names, key: str, kind: str, unfelt: dict[str, pin.SE3], began: float
) -> Performance:
    """Open hands that do not hold what they should, so that they can move again, and return the
    outcome.

    `unfelt`: T_grip_object, as it was known before, of what each hand does not feel, by side. Where
    no other sense tells the same, the hand stays closed.
    """
    sides = []
    for side, known in unfelt.items():
        if (yield from _gone(here, key, side, known)):
            sides.append(side)
            continue
        held = here.held[side]
        name, mass, inside = held.object, held.mass, held.T_grip_object
        # felt from the beginning
        take(here, (yield motions.still(here, key, **motions.payload(side, mass, inside))))
        why = (fact(Kind.WRIST_DOUBTED, side, name),)
        return ended(here, sights, key, rc.NotDoneKind.REPLAN, why, began)
    lost = {Side(side): here.lose(side) for side in sides}
    hands: dict[str, Any] = {}
    for side in sides:
        hands |= motions.hand(side, Open(OPEN_BY, OPEN_SPEED)) | motions.payload(side)
    sensed = yield motions.still(here, key, **hands)
    take(here, sensed)
    for side, name in lost.items():
        here.set_fingers(side, sensed.fingers[side])
        here.forget(name)  # it may have been seen while it fell
    told = Kind.LOST if kind == Phase.LOST else Kind.FEELS_NOT
    gone = tuple(fact(told, side, name) for side, name in lost.items())
    return replace(ended(here, sights, key, kind, gone, began), lost=lost)


def _gone(here: Situation, key: str, side: str, inside: pin.SE3) -> Generator[Motion, Sensed, bool]:
    """Whether the joints or the eyes tell, too, that a hand has lost its thing, which was `inside`
    it.

    An arm without its load rises. A thing that is seen elsewhere is gone, and so is one that would
    surely be seen.
    """
    name = here.held[side].object
    for _ in range(MORE_LOOKS):
        at = here.robot.grip(here.q, side) * inside
        sensed = yield motions.still(here, key, watch=at.translation, settle_s=SAG_S)
        # what is seen may be in no hand
        here.stand(sensed.q, sensed.head, sensed.fingers, sensed.time)
        now, begun = (here.robot.grip(q, side).translation[2] for q in (sensed.measured, sensed.q))
        up = now - begun
        if up > here.held[side].mass * GRAVITY / CartesianGains().stiffness[0] / 2.0:
            # it is above its set-point as it is without its load, which is still fed forward
            return True
        sight = next((one for one in sensed.sights if one.name == name), None)
        if sight is not None:
            apart = np.linalg.norm(sight.T_world_object.translation - at.translation)
            return bool(apart > IN_HAND_M)
    return bool(sensed.sights) and here.surely_seen(name, at)


def take(here: Situation, sensed: Sensed) -> None:
    """Update the situation after a motion."""
    here.stand(sensed.q, sensed.head, sensed.fingers, sensed.time)
    senses.take(here, sensed)
    here.see(sensed.sights)
    here.ill = senses.faulty(here, sensed)


def _done(
    here: Situation, sights: Names, command: rc.Command, sensed: Sensed | None, began: float
) -> rc.Done:
    """The outcome of an act that was done; `sensed`: after its last motion."""
    seen, placed = _seen_and_placed(here, sights, began)
    took, missing = here.time - began, tuple(sorted(here.missing))
    row = SKILLS[type(command)]
    return rc.Done(
        command.key, posture(here), seen, held(here), took, placed=placed, missing=missing,
        ill=here.ill,
        evidence=evidence(here, command, sensed, row.tells), **row.done(here),
    )  # fmt: skip


def ended(
    here: Situation, sights: Names, key: str, kind: str, why: Facts, began: float
) -> rc.NotDone:
    """The outcome of an act that was not done."""
    seen, placed = _seen_and_placed(here, sights, began)
    took, missing = here.time - began, tuple(sorted(here.missing))
    return rc.NotDone(
        key, kind, why, posture(here), seen, held(here), took,
        placed=placed, missing=missing, ill=here.ill,
    )  # fmt: skip


def _seen_and_placed(
    here: Situation, sights: Names, began: float
) -> tuple[tuple[rs.Seen, ...], tuple[rs.Seen, ...]]:
    """What was seen in this act, and what a hand let go of in it and that was not seen since."""
    told = (name for name in sights if name not in here.placed)
    seen = (name for name in told if name in here.seen or here.holder(name))
    placed = ((name, at) for name, at in here.placed.items() if at >= began)
    put = tuple(_at(here, name, at) for name, at in placed)
    return tuple(_at(here, name, here.time) for name in seen), put


def _at(here: Situation, name: str, time: float) -> rs.Seen:
    side = here.holder(name)
    if side is None:
        pose = here.seen[name]
    else:
        pose = here.robot.grip(here.q, side) * here.held[side].T_grip_object
    content = here.contents[name] if name in here.looked_into else None
    uncertainty = here.uncertain.get(name) if side is None else None
    return rs.Seen(name, here.models[name], Pose(*xyz_quat(pose)), time, content, uncertainty)


def posture(here: Situation) -> BodyPosture:
    """The posture for a communicate."""
    right, left = (tuple(float(x) for x in here.q[names.ARM[side]]) for side in ("right", "left"))
    hands = {side: (angle, angle, angle, 0.0) for side, angle in here.fingers.items()}
    return BodyPosture(
        float(here.q[names.TORSO]), right, left, here.head, hands["right"], hands["left"]
    )


def held(here: Situation) -> dict[Side, tuple[str, str, Pose]]:
    """What each hand holds, for a communicate."""
    return {
        Side(s): (h.object, h.grasp, Pose(*xyz_quat(h.T_grip_object))) for s, h in here.held.items()
    }

"""Runs the skill of a robot command to its outcome, and updates the situation after each motion."""

from collections.abc import Generator

from companion.languages import rc, rs
from companion.languages.values import BodyPosture, Pose, Side
from services.executor.loop.program import Motion, Phase
from services.executor.skills import SKILLS
from services.executor.skills.situation import Situation
from services.executor.skills.skill import Cancelled, NotPossible, Sensed, Skill
from velma import names
from velma.kinematics.frames import xyz_quat

Performance = Generator[Motion, Sensed, rc.Done | rc.NotDone]


def perform(here: Situation, command: rc.Act) -> Performance:
    """Yield motions, take the Sensed of each, return the outcome."""
    began, sights = here.time, {}
    skill: Skill = SKILLS[type(command)](here, command)
    try:
        motion = next(skill)
        while True:
            sensed = yield motion
            take(here, sensed)
            sights.update({s.name: s for s in sensed.sights})
            if sensed.ended == Phase.CANCELLED:
                motion = skill.throw(Cancelled())
            elif sensed.ended == Phase.DONE:
                motion = skill.send(sensed)
            else:
                return ended(here, command.key, sensed.ended, sensed.reason, began)
    except StopIteration:
        seen = tuple(_seen(here, name) for name in sights)
        return rc.Done(command.key, posture(here), seen, held(here), here.time - began)
    except Cancelled:
        return ended(here, command.key, rc.NotDoneKind.CANCELLED, "cancelled", began)
    except NotPossible as reason:
        return ended(here, command.key, reason.kind, reason.reason, began)


def take(here: Situation, sensed: Sensed) -> None:
    """Update the situation after a motion."""
    here.q, here.head, here.time = sensed.q.copy(), sensed.head, sensed.time
    here.see(sensed.sights)


def ended(here: Situation, key: str, kind: str, reason: str, began: float) -> rc.NotDone:
    """Return the outcome of an act that was not done."""
    seen = tuple(_seen(here, name) for name in here.seen if here.holder(name) is None)
    return rc.NotDone(key, kind, reason, posture(here), seen, held(here), here.time - began)


def _seen(here: Situation, name: str) -> rs.Seen:
    side = here.holder(name)
    pose = here.seen[name] if side is None else here.robot.grip(here.q, side) * here.held[side].T_grip_object
    return rs.Seen(name, here.models[name], Pose(*xyz_quat(pose)), here.time)


def posture(here: Situation) -> BodyPosture:
    """Return the posture for a communicate."""
    right, left = (tuple(float(x) for x in here.q[names.ARM[side]]) for side in ("right", "left"))
    hands = {side: (angle, angle, angle, 0.0) for side, angle in here.fingers.items()}
    return BodyPosture(float(here.q[names.TORSO]), right, left, here.head, hands["right"], hands["left"])


def held(here: Situation) -> dict[Side, tuple[str, str, Pose]]:
    """Return what each hand holds, for a communicate."""
    return {Side(s): (h.object, h.grasp, Pose(*xyz_quat(h.T_grip_object))) for s, h in here.held.items()}

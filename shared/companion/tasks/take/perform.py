"""The skill that grasps: approach by the newest observation, close until touch, squeeze, lock, feed
weight forward.
"""

import numpy as np
import pinocchio as pin

from companion.languages import rc
from companion.languages.facts import Kind, fact
from companion.skills import motions, moving
from companion.skills.loop_messages import Close, Open, Until
from companion.skills.moving import joining, legs
from companion.skills.senses import missed, require
from companion.skills.situation import Held, Situation
from companion.skills.skill import Cancelled, NotPossible, Skill, SkillRow, empty, missing, replan
from velma import names
from velma.kinematics import ik
from velma.kinematics.frames import transform
from velma.kinematics.tasks import APPROACH_SPEED, attaching

# [rad] where a finger stops that touches nothing; one that holds: jar 1.47, bowl 1.66 (measured)
UPTO = 1.9
SETTLE_S = 0.3  # same runs
# [s] at rest, until the filters of the wrist have forgotten the motion (velma.control.grip)
TARE_S = 0.3
FINGERS_NEEDED = 3


def grasp(here: Situation, command: rc.Grasp) -> Skill:
    """Grasp. Raises replan if the object is unknown or the path not free, missing if it is not
    where it was.

    Raises empty if the hand closes on nothing, failed if no sense can check it.
    """
    if command.object not in here.seen:
        raise replan(fact(Kind.NOT_SEEN, command.object))
    side = command.side
    poses = [here.seen[command.object] * transform(point.at) for point in command.approach]
    first, rest = _approach(here, side, command, poses)
    watch = here.seen[command.object].translation
    sensed = yield motions.along(
        here, command.key, first, APPROACH_SPEED, watch=watch, settle_s=TARE_S,
        **motions.hand(side, motions.fingers(command.approach[0].fingers)),
    )  # fmt: skip
    if (yield from missed(here, command.key, command.object, sensed)):
        raise missing(fact(Kind.NOT_WHERE_IT_WAS, command.object))
    require(here, side)
    try:
        for leg, point in zip(rest, command.approach[1:], strict=True):
            options = motions.hand(side, motions.fingers(point.fingers))
            if point is command.approach[1]:
                options["tare"] = str(side)  # before it touches the object
            here.set_fingers(side, point.fingers)
            yield motions.along(here, command.key, leg, APPROACH_SPEED, **options)
        close = Close(squeeze=command.squeeze, upto=UPTO, speed=command.speed, settle_s=SETTLE_S)
        sensed = yield motions.still(
            here, command.key, until=Until.TOUCH, **motions.hand(side, close)
        )
        if sum(sensed.touched[side]) < FINGERS_NEEDED:
            touched = sum(sensed.touched[side])
            if not touched:
                here.give_up(command.object)  # the hand closed where it should be
            raise empty(fact(Kind.TOUCHED, side, command.object, touched))
    except (Cancelled, NotPossible):
        # Open the hand and go back along the path of the approach, so that the arm is free to move
        # again.
        way = [first[-1] if first else here.q, *(q for leg in rest for q in leg)]
        yield motions.still(here, command.key, **motions.hand(side, Open()))
        yield motions.still(
            here, command.key, **motions.hand(side, motions.fingers(command.approach[-1].fingers))
        )
        yield motions.along(here, command.key, moving.back(here, way), APPROACH_SPEED)
        raise
    # Until the object is seen in the hand, the planned grasp tells its pose there.
    T_grip_object = (
        here.robot.grip(here.q, side).inverse()
        * poses[-1]
        * transform(command.approach[-1].at).inverse()
    )
    here.take(side, Held(command.object, command.grasp, T_grip_object, command.mass))
    carried = motions.payload(side, command.mass, T_grip_object)
    yield motions.still(here, command.key, watch=watch, settle_s=0.1, **carried)


def _approach(
    here: Situation, side: str, command: rc.Grasp, poses: list[pin.SE3]
) -> tuple[list[np.ndarray], list[list[np.ndarray]]]:
    """The path to the first pose and one to each further pose, checked against what is seen now."""
    with attaching.allowed(here.world, (command.object, f"{side}_hand")):
        here.set_fingers(side, command.approach[-1].fingers)
        start = ik.solve(here.robot, side, poses[0], here.q, columns=names.ARM[side])
        if start is None:
            raise replan(fact(Kind.UNREACHED, side, command.object))
        first = joining(here, start)
        return first, legs(here, side, start, poses[1:])


SKILLS = (SkillRow(rc.Grasp, grasp, checked=True),)

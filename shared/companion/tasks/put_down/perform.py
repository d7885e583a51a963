"""The skill that puts down: move above the place, level the object, go down to contact, open,
retreat.

Where the object meets something above the place, what stands there is not known: the arm and the
object hide it. It is put down beside then.
"""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from companion import models
from companion.languages import rc
from companion.languages.facts import Fact, Kind, fact
from companion.languages.values import Vector
from companion.skills import emergency_place, motions, moving
from companion.skills.loop_messages import Open, Until
from companion.skills.moving import between, straight
from companion.skills.situation import Situation
from companion.skills.skill import (
    NotPossible,
    Skill,
    SkillRow,
    despite_cancel,
    despite_slips,
    failed,
    replan,
)
from velma import names
from velma.kinematics import backing, ik
from velma.kinematics.frames import shifted, transform
from velma.kinematics.shapes import Box
from velma.kinematics.tasks import DOWN_SPEED, LOADED_SPEED, RETREAT_SPEED, attaching
from velma.kinematics.tasks.carrying import CARRY_TILT
from velma.kinematics.tasks.placing import ABOVE_M, retreat_poses

# the descent aims this far below the place; contact ends it; task runs with the true robot model
BELOW_M = 0.02
# set-point below the hand that counts as contact (about 4.5 N at 1500 N/m), same runs
CONTACT_M = 0.003
# name and edge [m] of the box that stands for what was met: as wide as a bowl (estimate)
MET, MET_M = "met", 0.2
# above its place a thing is not let go, whatever the hand met: it would fall (estimate)
HIGH_M = 0.04
SETTLE_S = 0.3
# same runs (they waited 0.9 s in all)
OPEN_BY, OPEN_SPEED, OPEN_WAIT_S = math.radians(6.0), 0.15, 0.5
SPREAD_SPEED = 0.5  # [rad/s], same runs
# [rad] a joint may move on the way to above the place before a path is planned (estimate)
JOIN_LIMIT = 1.2


def release(here: Situation, command: rc.Release) -> Skill:
    """Put the object down; nothing if the hand does not hold it. Raises replan if the place cannot
    be reached.

    What slips on the way is all the more put down.
    """
    held = here.held.get(command.side)
    if held is None or held.object != command.object:
        return
    try:
        yield from despite_slips(
            lambda: _lower(here, command, *_place(here, command.side, command))
        )
    except _Met as met:
        yield from _beside(here, command, met)
    yield from _let_go(here, command.side, command)


class _Met(NotPossible):
    """The object met something `above` its place [m]."""

    def __init__(self, why: Fact, place: pin.SE3, above: float) -> None:
        super().__init__(rc.NotDoneKind.REPLAN, why)
        self.place, self.above = place, above


def _beside(here: Situation, command: rc.Release, met: _Met) -> Skill:
    """Go up again and put the object down on a free spot beside what it met. Raises `met` where
    none is found.
    """
    side, grip = command.side, here.robot.grip(here.q, command.side)
    up = straight(here, side, here.q, shifted(grip, np.array([0.0, 0.0, ABOVE_M])))
    yield motions.along(here, command.key, up, LOADED_SPEED)
    base = models.MODELS[here.models[command.object]].base.z
    middle = shifted(met.place, np.array([0.0, 0.0, base + met.above - MET_M / 2]))
    here.world.put(MET, [Box((MET_M, MET_M, MET_M))], middle)
    try:
        height = float(met.place.translation[2])
        found = emergency_place.free_spot(
            here, side, _retreat(command), tilts=(CARRY_TILT,), height=height
        )
        if found is None:
            raise met
        yield from _lower(here, command, *found)
    finally:
        here.world.remove(MET)


def _retreat(command: rc.Release) -> list[tuple[pin.SE3, float]]:
    """T_object_grip and finger angle of each point of the way back."""
    return [(transform(point.at), point.fingers) for point in command.retreat]


def _lower(here: Situation, command: rc.Release, place: pin.SE3, path: list[np.ndarray]) -> Skill:
    """Carry the object to above the place and go down to contact. Raises _Met if something stands
    there.
    """
    side = command.side
    if path:
        yield motions.along(
            here, command.key, path, LOADED_SPEED, watch=place.translation, settle_s=0.2
        )
    # The object was seen in the hand again: go down so that it arrives level.
    target = shifted(
        place * here.held[side].T_grip_object.inverse(), np.array([0.0, 0.0, -BELOW_M])
    )
    down = straight(here, side, here.q, target)
    yield motions.along(
        here, command.key, down, DOWN_SPEED, until=Until.CONTACT, contact_side=str(side),
        contact_m=CONTACT_M,
        settle_s=SETTLE_S,
    )  # fmt: skip
    held = here.robot.grip(here.q, side) * here.held[side].T_grip_object
    above = held.translation[2] - place.translation[2]
    if above > HIGH_M:
        raise _Met(fact(Kind.MET_SOMETHING, side, command.object, above), place, above)


def _place(here: Situation, side: str, command: rc.Release) -> tuple[pin.SE3, list[np.ndarray]]:
    """Where to put it, and the path to above that place.

    The first of: the place of the plan, right here, where it stood before, a free spot.
    """
    held = here.held[side]
    if command.place is not None:
        place = transform(command.place)
        through = command.way or ((0.0, 0.0, ABOVE_M),)
        return place, _through(here, side, place * held.T_grip_object.inverse(), through)
    standing = emergency_place.standing_here(here, side)
    if standing is not None:
        return standing, []
    back = emergency_place.back_in_place(here, side)
    if back is not None:
        return back
    found = emergency_place.free_spot(here, side, _retreat(command))
    if found is None:
        raise failed(fact(Kind.NO_FREE_PLACE, side, held.object))
    return found


def _let_go(here: Situation, side: str, command: rc.Release) -> Skill:
    """Open the hand and retreat, the head on the thing. A cancel changes nothing: a hand is not
    left half open.
    """
    grip, object_name = here.robot.grip(here.q, side), command.object
    unload = motions.payload(side)
    opening = {**unload, **motions.hand(side, Open(OPEN_BY, OPEN_SPEED))}
    yield from despite_cancel(
        lambda: motions.still(here, command.key, settle_s=OPEN_WAIT_S, **opening)
    )
    here.let_go(side)
    wide = command.retreat[0].fingers
    spread = motions.hand(side, motions.fingers(wide, SPREAD_SPEED))
    yield from despite_cancel(lambda: motions.still(here, command.key, **spread))
    here.set_fingers(side, wide)
    with attaching.allowed(here.world, (object_name, f"{side}_hand")):
        path = backing.way_out(
            here.robot, here.world, side, here.q, retreat_poses(grip, _retreat(command))
        )
    way, watch = moving.rest(here, path), here.put[object_name].translation
    here.leave(object_name)
    yield from despite_cancel(
        lambda: motions.along(here, command.key, way, RETREAT_SPEED, watch=watch)
    )


def _through(here: Situation, side: str, grip: pin.SE3, way: Sequence[Vector]) -> list[np.ndarray]:
    """The checked path to the first of the offsets from `grip`, then straight on. Raises replan for
    none.
    """
    first, *others = (shifted(grip, np.array(offset)) for offset in way)
    q = ik.solve(here.robot, side, first, here.q, columns=names.ARM[side])
    if q is None or np.abs(q - here.q).max() > JOIN_LIMIT:
        raise replan(fact(Kind.NOT_ABOVE_ITS_PLACE, side))
    path = between(here, q)
    if not all(here.world.free(x) for x in path):
        raise replan(fact(Kind.NO_PATH_TO_ITS_PLACE, side))
    for pose in others:
        path += straight(here, side, path[-1] if path else here.q, pose, here.world.free)
    return path


SKILLS = (
    # The hand goes by where the thing is seen in it.
    SkillRow(rc.Release, release, by_joints=False, checked=True),
)

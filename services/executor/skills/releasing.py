"""The skill that puts down: move above the place, level the object, go down to contact, open, retreat, look at it.

Where the object meets something above the place, what stands there is not known: the arm and the object hide it. It is
put down beside then. A thing that falls over as the hand lets go of it, or rolls away, was not put down.
"""

import math
from collections.abc import Generator, Sequence
from contextlib import suppress

import numpy as np
import pinocchio as pin

from companion import models
from companion.languages import rc
from companion.languages.values import Vector
from services.executor.loop.program import Motion, Open, Until
from services.executor.skills import emergency_place, motions, own_paths
from services.executor.skills.looking import look
from services.executor.skills.moving import straight
from services.executor.skills.situation import Situation
from services.executor.skills.skill import (
    Cancelled,
    NotPossible,
    Sensed,
    Skill,
    despite_cancel,
    despite_slips,
    failed,
    missing,
    replan,
)
from velma import names
from velma.kinematics import backing, ik
from velma.kinematics.frames import shifted, transform
from velma.kinematics.shapes import Box
from velma.kinematics.tasks import attaching
from velma.kinematics.tasks.carrying import CARRY_TILT
from velma.kinematics.tasks.placing import ABOVE_M, retreat_poses
from velma.kinematics.tasks.speeds import DOWN_SPEED, LOADED_SPEED, RETREAT_SPEED

BELOW_M = 0.02  # the descent aims this far below the place; contact ends it; task runs with the true robot model
CONTACT_M = 0.003  # set-point below the hand that counts as contact (about 4.5 N at 1500 N/m), same runs
MET, MET_M = "met", 0.2  # name and edge [m] of the box that stands for what was met: as wide as a bowl (estimate)
HIGH_M = 0.04  # above its place a thing is not let go, whatever the hand met: it would fall (estimate)
SETTLE_S = 0.3
OPEN_BY, OPEN_SPEED, OPEN_WAIT_S = math.radians(6.0), 0.15, 0.5  # same runs (they waited 0.9 s in all)
SPREAD_SPEED = 0.5  # [rad/s], same runs
FALLEN, ASIDE_M = math.radians(20.0), 0.05
"""From here on a thing fell over, or is not where it was put. Estimates: one that stands is seen within 2 degrees and
20 mm of where the hand left them (tests/executor/skills/test_placed.py)."""
ROLLS, ROLL_S, AT_REST_M = 10, 0.3, 0.005  # looks until a thing that rolls is at rest (estimates)
JOIN_LIMIT = 1.2  # [rad] a joint may move on the way to above the place before a path is planned (estimate)


def release(here: Situation, command: rc.Release) -> Skill:
    """Put the object down; nothing if the hand does not hold it. Raises replan if the place cannot be reached.

    What slips on the way is all the more put down.
    """
    held = here.held.get(command.side)
    if held is None or held.object != command.object:
        return
    try:
        yield from despite_slips(lambda: _lower(here, command, *_place(here, command.side, command)))
    except _Met as met:
        yield from _beside(here, command, met)
    sensed = yield from _let_go(here, command.side, command)
    with suppress(Cancelled):  # it was put down
        yield from _confirm(here, command, here.put[command.object], sensed)


class _Met(NotPossible):
    """The object met something `above` its place [m]."""

    def __init__(self, reason: str, place: pin.SE3, above: float) -> None:
        super().__init__(rc.NotDoneKind.REPLAN, reason)
        self.place, self.above = place, above


def _beside(here: Situation, command: rc.Release, met: _Met) -> Skill:
    """Go up again and put the object down on a free spot beside what it met. Raises `met` where none is found."""
    side, grip = command.side, here.robot.grip(here.q, command.side)
    up = straight(here, side, here.q, shifted(grip, np.array([0.0, 0.0, ABOVE_M])))
    yield motions.along(here, command.key, up, LOADED_SPEED)
    base = models.MODELS[here.models[command.object]].base.z
    middle = shifted(met.place, np.array([0.0, 0.0, base + met.above - MET_M / 2]))
    here.world.put(MET, [Box((MET_M, MET_M, MET_M))], middle)
    try:
        height = float(met.place.translation[2])
        found = emergency_place.free_spot(here, side, _retreat(command), largest=CARRY_TILT, height=height)
        if found is None:
            raise met
        yield from _lower(here, command, *found)
    finally:
        here.world.remove(MET)


def _retreat(command: rc.Release) -> list[tuple[pin.SE3, float]]:
    """Return T_object_grip and finger angle of each point of the way back."""
    return [(transform(point.at), point.fingers) for point in command.retreat]


def _lower(here: Situation, command: rc.Release, place: pin.SE3, path: list[np.ndarray]) -> Skill:
    """Carry the object to above the place and go down to contact. Raises _Met if something stands there."""
    side = command.side
    if path:
        yield motions.along(here, command.key, path, LOADED_SPEED, watch=place.translation, settle_s=0.2)
    # The object was seen in the hand again: go down so that it arrives level.
    target = shifted(place * here.held[side].T_grip_object.inverse(), np.array([0.0, 0.0, -BELOW_M]))
    down = straight(here, side, here.q, target)
    yield motions.along(
        here, command.key, down, DOWN_SPEED, until=Until.CONTACT, contact_side=str(side), contact_m=CONTACT_M,
        settle_s=SETTLE_S,
    )  # fmt: skip
    above = (here.robot.grip(here.q, side) * here.held[side].T_grip_object).translation[2] - place.translation[2]
    if above > HIGH_M:
        raise _Met(f"the {side} hand met something {above:.2f} m above the place of {command.object}", place, above)


def _place(here: Situation, side: str, command: rc.Release) -> tuple[pin.SE3, list[np.ndarray]]:
    """Return where to put it, and the path to above that place.

    The first of: the place of the plan, right here, where it stood before, a free spot.
    """
    held = here.held[side]
    if command.place is not None:
        place = transform(command.place)
        return place, _through(here, side, place * held.T_grip_object.inverse(), command.way or ((0.0, 0.0, ABOVE_M),))
    standing = emergency_place.standing_here(here, side)
    if standing is not None:
        return standing, []
    back = emergency_place.back_in_place(here, side)
    if back is not None:
        return back
    found = emergency_place.free_spot(here, side, _retreat(command))
    if found is None:
        raise failed(f"the {side} hand finds no free place for {held.object}")
    return found


def _let_go(here: Situation, side: str, command: rc.Release) -> Generator[Motion, Sensed, Sensed]:
    """Open the hand and retreat, and return what is sensed then.

    A cancel changes nothing: a hand is not left half open around a thing.
    """
    grip, object_name = here.robot.grip(here.q, side), command.object
    unload = motions.payload(side)
    yield from despite_cancel(
        lambda: motions.still(
            here, command.key, settle_s=OPEN_WAIT_S, **unload, **motions.hand(side, Open(OPEN_BY, OPEN_SPEED))
        )
    )
    here.let_go(side)
    wide = command.retreat[0].fingers
    spread = motions.hand(side, motions.fingers(wide, SPREAD_SPEED))
    yield from despite_cancel(lambda: motions.still(here, command.key, **spread))
    here.set_fingers(side, wide)
    with attaching.allowed(here.world, (object_name, f"{side}_hand")):
        path = backing.way_out(here.robot, here.world, side, here.q, retreat_poses(grip, _retreat(command)))
    way, watch = own_paths.rest(here, path), here.put[object_name].translation
    return (yield from despite_cancel(lambda: motions.along(here, command.key, way, RETREAT_SPEED, watch=watch)))


def _confirm(here: Situation, command: rc.Release, put: pin.SE3, sensed: Sensed) -> Skill:
    """Look at the thing, `put` where the hand let go of it, until it is seen at rest; hidden, it stays unseen.

    Raises replan if it is seen to have fallen over or to be elsewhere, missing if it is surely not there.
    """
    name = command.object
    if name not in {sight.name for sight in sensed.sights}:
        yield from look(here, rc.Look(command.key, (_point(put),)))
    for _ in range(ROLLS):
        if name in here.missing:
            raise missing(f"{name} is not where the {command.side} hand let go of it")
        if name in here.placed:
            return
        seen = here.seen[name]
        turned = math.acos(float(np.clip(seen.rotation[:, 2] @ put.rotation[:, 2], -1.0, 1.0)))
        aside = float(np.linalg.norm(seen.translation - put.translation))
        if turned < FALLEN and aside < ASIDE_M:
            return
        yield motions.still(here, command.key, watch=seen.translation, settle_s=ROLL_S)
        if name in here.seen and np.linalg.norm(here.seen[name].translation - seen.translation) < AT_REST_M:
            break
    fell = "fell over" if turned >= FALLEN else f"is {aside:.2f} m from where it was put"
    raise replan(f"{name} {fell} as the {command.side} hand let go of it")


def _point(pose: pin.SE3) -> Vector:
    x, y, z = (float(v) for v in pose.translation)
    return x, y, z


def _through(here: Situation, side: str, grip: pin.SE3, way: Sequence[Vector]) -> list[np.ndarray]:
    """Return the checked path to the first of the offsets from `grip`, then straight on. Raises replan for none."""
    first, *others = (shifted(grip, np.array(offset)) for offset in way)
    path = _to(here, side, first)
    for pose in others:
        path += straight(here, side, path[-1] if path else here.q, pose, here.world.free)
    return path


def _to(here: Situation, side: str, target: pin.SE3) -> list[np.ndarray]:
    """Return the short, checked path from the set-point to `target`. Raises replan if there is none."""
    q = ik.solve(here.robot, side, target, here.q, columns=names.ARM[side])
    if q is None or np.abs(q - here.q).max() > JOIN_LIMIT:
        raise replan(f"the {side} hand is not near the place where it should put down")
    steps = max(1, int(np.ceil(np.abs(q - here.q).max() / 0.05)))
    path = [here.q + (q - here.q) * k / steps for k in range(1, steps + 1)]
    if not all(here.world.free(x) for x in path):
        raise replan(f"the {side} hand has no free path to the place where it should put down")
    return path

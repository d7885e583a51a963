"""The skill that puts down: above the place, level by what is seen in the hand, down to contact, open, retreat."""

import math

import numpy as np
import pinocchio as pin

from companion.languages import rc
from services.executor.loop.program import Open, Payload, Until
from services.executor.skills import aside, motions
from services.executor.skills.moving import straight
from services.executor.skills.situation import Situation
from services.executor.skills.skill import Skill, failed, replan
from velma import names
from velma.kinematics import ik
from velma.kinematics.frames import shifted, transform
from velma.kinematics.tasks.placing import ABOVE_M, retreat_poses

DOWN_SPEED, RETREAT_SPEED, LOADED_SPEED = 0.04, 0.15, 0.25  # [m/s], task runs with the true robot model
BELOW_M = 0.02  # the descent aims so far below the place and is ended by contact, same runs
CONTACT_M = 0.003  # set-point below the hand that counts as contact (about 4.5 N at 1500 N/m), same runs
SETTLE_S = 0.3
OPEN_BY, OPEN_SPEED, OPEN_WAIT_S = math.radians(6.0), 0.15, 0.5  # same runs (they waited 0.9 s in all)
SPREAD_SPEED = 0.5  # [rad/s], same runs
JOIN_LIMIT = 1.2  # [rad] a joint may move on the way to above the place before a path is planned (estimate)


def release(here: Situation, command: rc.Release) -> Skill:
    """An empty hand does nothing. Raises replan where the place cannot be reached."""
    side = command.side
    held = here.held.get(side)
    if held is None or held.object != command.object:
        return
    place, path = _place(here, side, command)
    if path:
        yield motions.along(here, command.key, path, LOADED_SPEED, watch=place.translation, settle_s=0.2)
    # The object in the hand has been seen again from here: go down so that it comes level.
    target = shifted(place * held.T_grip_object.inverse(), np.array([0.0, 0.0, -BELOW_M]))
    down = straight(here, side, here.q, target)
    sensed = yield motions.along(
        here, command.key, down, DOWN_SPEED, until=Until.CONTACT, contact_side=str(side), contact_m=CONTACT_M,
        settle_s=SETTLE_S,
    )  # fmt: skip
    yield from _open(here, side, command, sensed.q)


def _place(here: Situation, side: str, command: rc.Release) -> tuple[pin.SE3, list[np.ndarray]]:
    """Where to put it and the way to above that place: the plan's place, else right here, else a spot aside."""
    held = here.held[side]
    if command.place is not None:
        place = transform(command.place)
        above = shifted(place * held.T_grip_object.inverse(), np.array([0.0, 0.0, ABOVE_M]))
        return place, _to(here, side, above)
    standing = aside.standing_here(here, side)
    if standing is not None:
        return standing, []
    found = aside.way_aside(here, side, [(transform(p.at), p.fingers) for p in command.retreat])
    if found is None:
        raise failed(f"the {side} hand finds no free place for {held.object}")
    return found


def _open(here: Situation, side: str, command: rc.Release, q: np.ndarray) -> Skill:
    grip = here.robot.grip(q, side)
    unload = {f"payload_{side}": Payload()}
    yield motions.still(
        here, command.key, settle_s=OPEN_WAIT_S, **unload, **motions.hand(side, Open(OPEN_BY, OPEN_SPEED))
    )
    here.let_go(side)
    wide = command.retreat[0].fingers
    yield motions.still(here, command.key, **motions.hand(side, motions.fingers(wide, SPREAD_SPEED)))
    here.set_fingers(side, wide)
    poses = retreat_poses(grip, [(transform(p.at), p.fingers) for p in command.retreat])
    path: list[np.ndarray] = []
    for pose in poses:
        path += straight(here, side, path[-1] if path else here.q, pose)
    yield motions.along(here, command.key, path, RETREAT_SPEED)


def _to(here: Situation, side: str, target: pin.SE3) -> list[np.ndarray]:
    """The short checked way from the set-point to `target`; raises replan where there is none."""
    q = ik.solve(here.robot, side, target, here.q, columns=names.ARM[side])
    if q is None or np.abs(q - here.q).max() > JOIN_LIMIT:
        raise replan(f"the {side} hand is not near the place where it should put down")
    steps = max(1, int(np.ceil(np.abs(q - here.q).max() / 0.05)))
    path = [here.q + (q - here.q) * k / steps for k in range(1, steps + 1)]
    if not all(here.world.free(x) for x in path):
        raise replan(f"the {side} hand has no free way to the place where it should put down")
    return path

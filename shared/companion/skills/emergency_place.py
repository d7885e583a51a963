"""Places to put something down at once: right here, where it stood before, else on a free spot of a
surface.

Used when a plan is cancelled. ex knows the furniture that it has seen, and plans the path itself.
"""

from collections.abc import Iterator, Sequence
from itertools import islice, product

import numpy as np
import pinocchio as pin

from companion import models
from companion.languages.values import Side
from companion.skills import moving
from companion.skills.situation import Situation
from velma.kinematics import backing, motion
from velma.kinematics.frames import heading, level, standing, tilt
from velma.kinematics.shapes import Cylinder
from velma.kinematics.tasks import LOADED_SPEED, attaching
from velma.kinematics.tasks.carrying import CARRY_TILT, upright
from velma.kinematics.tasks.placing import FROM_ABOVE, placings, points_on, turned, within

HERE_M = 0.06  # estimate: an object this close above a surface was not taken out yet
SAG_M = 0.02  # estimate: it may hang a little lower in the hand than it stood
BACK_WITHIN_M = 0.32  # estimate: grasped things are pulled out by 0.28
UPRIGHT = 0.1  # [rad] of a thing that may be put back as it stood (estimate)
TILTS = (CARRY_TILT, 1.05)
"""The most that a thing tilts on the way [rad], tried in turn. A tilted one may go upright on it;
beyond 40 degrees a bowl may slip in the fingers (companion.planning.placing).
"""
SPACING_M, MARGIN_M = 0.06, 0.05  # of the spots tried on a surface, and from its edge (estimates)
SAME_M = 0.02  # of heights of one table, as seen (estimate)
TRIES, WAYS = 120, 4


def standing_here(here: Situation, side: str) -> pin.SE3 | None:
    """The place under the held object if a surface is close below it, else None."""
    held = here.held[side]
    pose = held_pose(here, side)
    base = models.MODELS[here.models[held.object]].base
    bottom = pose.translation + pose.rotation @ np.array([0.0, 0.0, base.z])
    for _, frame, size in surfaces(here):
        local = frame.inverse().act(bottom)
        if abs(local[2]) < HERE_M and all(
            abs(local[k]) < size[k] / 2 - base.radius for k in (0, 1)
        ):
            down = level(pose)
            down.translation[2] = frame.translation[2] - base.z
            return down
    return None


def back_in_place(here: Situation, side: str) -> tuple[pin.SE3, list[np.ndarray]] | None:
    """Where the held object stood before it was taken, and the straight path to just above; None if
    far away.

    For an object half out of a cabinet, only the path it came by is known to be free.
    """
    held = here.held[side]
    stood, pose = here.seen.get(held.object), held_pose(here, side)
    if stood is None or not 0.0 < pose.translation[2] - stood.translation[2] + SAG_M < HERE_M:
        return None
    if (
        np.linalg.norm(pose.translation - stood.translation) > BACK_WITHIN_M
        or tilt(stood) > UPRIGHT
    ):
        return None
    place = standing(stood.translation, heading(pose.rotation[:, 0]))
    over = standing(
        np.array([*stood.translation[:2], pose.translation[2]]), heading(pose.rotation[:, 0])
    )
    path, whole = backing.furthest(
        here.robot, here.world, side, here.q, over * held.T_grip_object.inverse()
    )
    return (place, path) if whole else None


def held_pose(here: Situation, side: str) -> pin.SE3:
    """The pose of the held object."""
    return here.robot.grip(here.q, side) * here.held[side].T_grip_object


def surfaces(here: Situation) -> Iterator[tuple[str, pin.SE3, tuple[float, float]]]:
    """Yield owner, frame and edge lengths [m] of each flat surface of the furniture seen."""
    for name, pose in here.seen.items():
        model = models.MODELS[here.models[name]]
        for flat in () if model.moveable else model.surfaces:
            frame = pose * standing(np.array([flat.x, flat.y, flat.z]))
            yield name, frame, (flat.along_x, flat.along_y)


def free_spot(
    here: Situation,
    side: str,
    retreat: list[tuple[pin.SE3, float]],
    *,
    tilts: Sequence[float] = TILTS,
    height: float | None = None,
) -> tuple[pin.SE3, list[np.ndarray]] | None:
    """A free place, where the eyes can look into the thing if there is one, and the joint path to
    above it; None if none was found.

    The object tilts on the way by at most the first of `tilts` [rad] with which there is a way, or
    as it is. `height`: of its origin at the place [m]; None: any.
    """
    held, rng = here.held[side], np.random.default_rng(0)
    base = models.MODELS[here.models[held.object]].base
    low: list[tuple[str, np.ndarray]] = []
    high: list[tuple[str, np.ndarray]] = []
    for name, spot in _spots(here, base.radius, side):
        origin = spot - np.array([0.0, 0.0, base.z])
        if height is None or abs(origin[2] - height) < SAME_M:
            (low if models.looked_into(*np.add(spot, (0.0, 0.0, models.TALL_M))) else high).append(
                (name, origin)
            )
    now = tilt(held_pose(here, side)) + 0.1
    for most, spots, margin in product(tilts, filter(None, (low, high)), moving.ROOM_M):
        keep = upright(here.robot, side, held.T_grip_object, max(most, now))
        with attaching.room(here.world, margin):
            found = placings(
                here.robot,
                here.world,
                side,
                here.q,
                held.object,
                held.T_grip_object,
                spots,
                retreat,
                rng,
                tries=TRIES,
            )
            for placing in islice(found, WAYS):
                way = motion.plan(
                    here.robot, here.world, side, here.q, placing.above, keep=keep,
                    tool_speed=LOADED_SPEED,
                    attempts=moving.ATTEMPTS,
                )  # fmt: skip
                if way is not None:
                    return placing.place, way.path
    return None


def _spots(here: Situation, radius: float, side: str) -> list[tuple[str, np.ndarray]]:
    """Spots (3,) that are free by what was seen, within reach; so far as the hand is now it
    reaches, too.
    """
    at, reach = held_pose(here, side).translation, models.REACH[Side(side)]
    shoulders = turned(reach.shoulders)
    far = max(reach.far, min(float(np.linalg.norm(at - one)) for one in shoulders) + SPACING_M)
    room = Cylinder(FROM_ABOVE.radius, FROM_ABOVE.height)
    return [
        (name, spot)
        for name, frame, size in surfaces(here)
        for spot in points_on(frame, size, radius, margin=MARGIN_M, spacing=SPACING_M)
        if within(spot, shoulders, reach.near, far)
        and not here.world.inside(room, standing(np.array(FROM_ABOVE.centre(spot))))
    ]

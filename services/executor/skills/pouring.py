"""The skill that pours: the tilt is solved again for the poses of jar and bowl as they are seen now."""

import numpy as np

from companion import models
from companion.languages import rc
from services.executor.skills import motions
from services.executor.skills.moving import joining
from services.executor.skills.situation import Situation
from services.executor.skills.skill import Cancelled, Skill, failed, replan
from velma import names
from velma.kinematics import ik
from velma.kinematics.tasks.pouring import Stream, follow
from velma.kinematics.tasks.speeds import BACK_SPEED, TILT_SPEED


def pour(here: Situation, command: rc.Pour) -> Skill:
    """Pour. Raises replan if the source is not held, the destination not seen, or the tilt impossible."""
    held = here.held.get(command.side)
    if held is None or held.object != command.source:
        raise replan(f"the {command.side} hand does not hold {command.source}")
    if command.destination not in here.seen:
        raise replan(f"{command.destination} has not been seen")
    flow = _stream(here, command)
    first = flow.source(command.tilts[0], command.azimuth, command.spin) * held.T_grip_object.inverse()
    q = ik.solve(here.robot, command.side, first, here.q, columns=names.ARM[command.side])
    tilt = None if q is None else _tilt(here, command, flow, q)
    if q is None or tilt is None:
        raise replan(f"{command.source} cannot be tilted over {command.destination} from here")
    rim = flow.rim
    way = [*joining(here, q), *tilt[1:]]
    try:
        yield motions.along(here, command.key, way, TILT_SPEED, watch=rim, settle_s=command.hold)
    except Cancelled:
        reached = int(np.argmin([np.abs(x - here.q).max() for x in tilt]))
        yield motions.along(here, command.key, tilt[: reached + 1][::-1], BACK_SPEED, watch=rim)
        raise
    empty = motions.payload(command.side, command.empty_mass, held.T_grip_object)
    # A cancel from here on changes nothing: the jar goes upright either way.
    yield motions.along(here, command.key, tilt[::-1][1:], BACK_SPEED, watch=rim, **empty)


def _stream(here: Situation, command: rc.Pour) -> Stream:
    rim = models.MODELS[here.models[command.destination]].hole
    opening = models.MODELS[here.models[command.source]].hole
    if rim is None or opening is None:
        closed = command.destination if rim is None else command.source
        raise failed(f"{closed} has no opening")
    return Stream(here.seen[command.destination].act(np.array(rim.centre)), rim.radius, opening.centre[2])


def _tilt(here: Situation, command: rc.Pour, flow: Stream, q: np.ndarray) -> list[np.ndarray] | None:
    T_grip_object = here.held[command.side].T_grip_object
    return follow(
        here.robot, here.world, command.side, q, T_grip_object, flow, command.azimuth, command.spin, command.tilts
    )

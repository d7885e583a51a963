"""The primitive task that pours, and the one that looks."""

import math
from itertools import islice

import numpy as np

from companion.languages import rc, wm
from companion.languages.values import Side
from services.planner.search.steps import LOADED_SPEED, Geometry, Step, arrived, move
from velma.kinematics.frames import transform
from velma.kinematics.tasks.pouring import FIRST_TILT, LAST_TILT, Stream, tiltings

HELD_TILT = math.radians(40.0)  # task runs with the true robot model
TILTINGS = 8  # estimate: the quickest way of so many is chosen
HOLD_S = 2.0  # same runs
BACK_SPEED = 0.35  # [m/s], same runs
LOOK_S = 2.0  # estimate, only for the expected duration


def stream(geometry: Geometry, state: str, source: str, destination: str) -> Stream:
    """What the tilt is made of, from km."""
    rim = geometry.ask(wm.ObjectHole(state=state, object=destination), wm.Hole)
    pose = transform(geometry.ask(wm.ObjectPose(state=state, object=destination), wm.PoseOf).pose)
    opening = geometry.ask(wm.ObjectHole(state=state, object=source), wm.Hole)
    return Stream(pose.act(np.array(rim.centre)), rim.radius, opening.centre[2])


def pour(geometry: Geometry, state: str, source: str, destination: str, side: Side) -> Step | None:
    """Move the held source beside the destination, tilt it, hold, and turn it back."""
    here = geometry.at(state)
    held = here.held[side]
    model = geometry.ask(wm.ObjectModel(state=state, object=source), wm.ModelOf)
    flow = stream(geometry, state, source, destination)
    found = tiltings(
        geometry.robot, here.world, side, here.q, held.T_grip_object, flow, geometry.rng("pour", source, destination)
    )
    while some := list(islice(found, TILTINGS)):
        reached = geometry.free_motion(here, side, [t.path[0] for t in some], largest_tilt=HELD_TILT)
        if reached is None:
            continue
        tilting, path = some[reached[0]], reached[1]
        command = rc.Pour(
            key="",
            side=side,
            source=source,
            destination=destination,
            azimuth=tilting.azimuth,
            spin=tilting.spin,
            tilts=(FIRST_TILT, LAST_TILT),
            hold=HOLD_S,
            empty_mass=model.mass,
        )
        changes = (wm.Poured(source=source, destination=destination), *arrived(side, tilting.path[0]))
        duration = (
            geometry.duration(path, LOADED_SPEED)
            + geometry.duration(tilting.path, LOADED_SPEED)
            + HOLD_S
            + geometry.duration(tilting.path, BACK_SPEED)
        )
        return Step(f"pour {source} into {destination}", (move(side, path, LOADED_SPEED), command), changes, duration)
    geometry.failed(f"no posture of the {side} arm pours {source} into {destination}")
    return None


def look(geometry: Geometry, state: str, name: str) -> Step:
    """Turn the head to where the object should be."""
    pose = transform(geometry.ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).pose)
    x, y, z = (float(v) for v in pose.translation)
    return Step(f"look at {name}", (rc.Look(key="", at=((x, y, z),)),), (), LOOK_S)

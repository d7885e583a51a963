"""The primitive task that pours."""

import math
from itertools import islice

import numpy as np

from companion.languages import rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from services.planner.search.situation import configured
from services.planner.search.steps import Geometry, Step, move
from velma.kinematics.motion import Motion
from velma.kinematics.tasks.pouring import FIRST_TILT, LAST_TILT, Stream, Tilting, tiltings
from velma.kinematics.tasks.speeds import BACK_SPEED, LOADED_SPEED, TILT_SPEED

HELD_TILT = math.radians(40.0)  # task runs with the true robot model
TILTINGS = 8  # estimate: the quickest of this number of tilts is chosen
HOLD_S = 2.0  # same runs


def pour(geometry: Geometry, state: str, source: str, destination: str, side: Side) -> Step | None:
    """Return the step that moves the held source beside the destination, tilts it, holds, and turns it back."""
    here = geometry.at(state)
    found = tiltings(
        geometry.robot,
        here.world,
        side,
        here.q,
        here.held[side].T_grip_object,
        stream(geometry, state, source, destination),
        geometry.rng("pour", source, destination),
    )
    while some := list(islice(found, TILTINGS)):
        reached = geometry.free_motion(here, side, [t.path[0] for t in some], largest_tilt=HELD_TILT)
        if reached is not None:
            mass = geometry.model(state, source).mass
            return _pouring(geometry, side, source, destination, mass, some[reached[0]], reached[1])
    geometry.failed(fact(Kind.NO_POUR, side, source, destination))
    return None


def stream(geometry: Geometry, state: str, source: str, destination: str) -> Stream:
    """Return the geometry of the tilt, from km."""
    rim = geometry.ask(wm.ObjectHole(state=state, object=destination), wm.Hole)
    opening = geometry.ask(wm.ObjectHole(state=state, object=source), wm.Hole)
    return Stream(geometry.pose(state, destination).act(np.array(rim.centre)), rim.radius, opening.centre[2])


def _pouring(
    geometry: Geometry, side: Side, source: str, destination: str, mass: float, tilting: Tilting, way: Motion
) -> Step:
    """Return the step of a solved tilt; `way` leads to its start, `mass` of the empty source [kg]."""
    command = rc.Pour(
        key="",
        side=side,
        source=source,
        destination=destination,
        azimuth=tilting.azimuth,
        spin=tilting.spin,
        tilts=(FIRST_TILT, LAST_TILT),
        hold=HOLD_S,
        empty_mass=mass,
    )
    changes = (wm.Poured(source=source, destination=destination), *configured(side, tilting.path[0]))
    duration = (
        way.duration
        + geometry.duration(tilting.path, TILT_SPEED)
        + HOLD_S
        + geometry.duration(tilting.path, BACK_SPEED)
    )
    return Step(f"pour {source} into {destination}", (move(side, way, LOADED_SPEED), command), changes, duration)

"""Places for a held object: a posture above, straight down, and the retreat of the open hand.

The whole retreat is checked when the place is chosen: runs that found no path home had a hand that
could not retreat, or that ended against its own forearm.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.frames import shifted, standing
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import attaching

ABOVE_M = 0.10  # task runs with the true robot model
CLEARANCE_M = 0.008  # same runs: the planned end of the descent stays this much above the surface
BACK_M = 0.05  # same runs: the last part of the retreat, against the approach axis ...
UP_M = 0.06  # ... and up


# [rad] angles of the torso for which reach is computed (estimate)
TURNED = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)
# height above the surface where the volume starts that has to be free (estimate)
FREE_FROM_M = 0.01


@dataclass(frozen=True)
class Volume:
    """An upright cylinder above a spot [m]."""

    radius: float
    height: float

    def centre(self, spot: np.ndarray) -> tuple[float, float, float]:
        """Return its centre above a spot (3,) [m]."""
        x, y, z = (float(v) for v in spot)
        return x, y, z + FREE_FROM_M + self.height / 2


# estimate: the bowl (0.10) and a finger beside it; a jar (0.20) that comes down from 0.10 above, so
# no shelf
FROM_ABOVE = Volume(0.14, 0.35)


@dataclass(frozen=True)
class Placing:
    """A solved place: object pose in the world, what it stands on, q above it, ways down and back
    (lists of (15,)).

    `retreat`: of the hand, T_release_grip and finger angle [rad], nearest first.
    """

    place: pin.SE3
    support: str
    above: np.ndarray
    way_down: list[np.ndarray]
    way_back: list[np.ndarray]
    retreat: Sequence[tuple[pin.SE3, float]]


def placings(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    name: str,
    T_grip_object: pin.SE3,
    spots: Sequence[tuple[str, np.ndarray]],
    retreat: Sequence[tuple[pin.SE3, float]],
    rng: np.random.Generator,
    *,
    tries: int = 500,
) -> Iterator[Placing]:
    """Yield solved places of the object attached to the hand, its origin on one of `spots`
    (support, point (3,) [m]).

    `retreat`: T_release_grip and finger angle, nearest first. The object is attached again after
    each.
    """
    for _ in range(tries):
        support, spot = spots[int(rng.integers(len(spots)))]
        place = standing(np.add(spot, (0.0, 0.0, CLEARANCE_M)), rng.uniform(-np.pi, np.pi))
        grip = place * T_grip_object.inverse()
        over, first = shifted(grip, np.array([0.0, 0.0, ABOVE_M])), world.first_free
        above = ik.sample(robot, side, over, q, rng, torso=(-1.2, 1.2), first=first)
        if above is None:
            continue
        try:
            with attaching.allowed(world, (name, support)):
                way_down = ik.line(robot, side, above, grip, accept=world.free)
        except ik.PathBlocked:
            continue
        if not ik.comfortable(robot, way_down[-1], side):
            continue
        way_back = _retreat(robot, world, side, way_down[-1], name, place, retreat)
        if way_back is not None:
            yield Placing(place, support, above, way_down, way_back, retreat)


def turned(shoulders: Iterable[Sequence[float]]) -> list[np.ndarray]:
    """Return where shoulders (3,) are with the torso straight and turned to either side [m]."""
    return [
        standing((0.0, 0.0, 0.0), torso).act(np.array(one)) for one in shoulders for torso in TURNED
    ]


def within(at: np.ndarray, shoulders: Iterable[np.ndarray], near: float, far: float) -> bool:
    """Whether a point (3,) is in reach from the nearest of the shoulders (3,), all in [m]."""
    return bool(near < min(np.linalg.norm(at - one) for one in shoulders) < far)


def points_on(
    frame: pin.SE3, size: Sequence[float], foot: float, *, margin: float, spacing: float
) -> Iterator[np.ndarray]:
    """Yield points (3,) on a horizontal rectangle for a thing that stands on a disc of radius
    `foot`, all in [m].

    `frame` is in its middle, `size` its edges along x and y. The disc stays `margin` away from each
    edge.
    """
    half = [s / 2 - foot - margin for s in size]
    for x in np.arange(-half[0], half[0] + 1e-9, spacing):
        for y in np.arange(-half[1], half[1] + 1e-9, spacing):
            yield frame.act(np.array([x, y, 0.0]))


def backwards(approach: Sequence[tuple[pin.SE3, float]]) -> list[tuple[pin.SE3, float]]:
    """Return the retreat that reverses an approach (T_object_grip and finger angle, the grasp
    last).

    As T_release_grip, nearest first: relative to the releasing grip, so the pose of the object in
    the hand does not matter.
    """
    grasp = approach[-1][0].inverse()
    return [(grasp * pose, fingers) for pose, fingers in approach[-2::-1]]


def retreat_poses(grip: pin.SE3, retreat: Sequence[tuple[pin.SE3, float]]) -> list[pin.SE3]:
    """Return grip poses in the world of a retreat that begins at `grip`; then back and up."""
    poses = [grip * T_release_grip for T_release_grip, _ in retreat]
    last = poses[-1] if poses else grip
    return [*poses, shifted(last, np.array([0.0, 0.0, UP_M]) - last.rotation[:, 2] * BACK_M)]


def _retreat(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    name: str,
    place: pin.SE3,
    retreat: Sequence[tuple[pin.SE3, float]],
) -> list[np.ndarray] | None:
    poses = retreat_poses(robot.grip(q, side), retreat)
    with (
        attaching.stood(world, name, place, side),
        attaching.allowed(world, (name, f"{side}_hand")),
    ):
        world.fingers(side, retreat[0][1])
        path = ik.lines(robot, side, q, poses, world.free)
    if path is None or not ik.comfortable(robot, path[-1], side):
        return None
    with attaching.stood(world, name, place, side):
        return path if world.free(path[-1]) else None

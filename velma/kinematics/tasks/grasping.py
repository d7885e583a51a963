"""Grasps: approach an object, lift it, pull it out, with the torso at rest.

Numbers of the sequence: bench and task runs with the true robot model (approach 0.15 m in front,
lift 0.03 m, jar pulled out by 0.28 m and bowl by 0.22 m), grasps of proghtn-backstream@019fd34.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.frames import heading, lies, shifted, standing
from velma.kinematics.robot import Robot
from velma.kinematics.tasks import attaching

LIFT_M = 0.03  # task runs with the true robot model; the published planner lifts by 0.02
# [rad], standard deviation of the approach direction about the open side; same runs: 0.35-0.4
AZIMUTH_SPREAD = 0.35


@dataclass(frozen=True)
class GraspWay:
    """A known grasp: poses T_grip_object with the finger angle [rad] there, outermost first, the
    grasp last.
    """

    name: str
    steps: tuple[tuple[pin.SE3, float], ...]


@dataclass(frozen=True)
class Approach:
    """A solved grasp. `steps`: T_object_grip and finger angle, outermost first. `way_in`: q from
    the outermost step to the grasp. `way_out`: q from the grasp up and out. `score`: larger is more
    comfortable.
    """

    grasp: str
    steps: tuple[tuple[pin.SE3, float], ...]
    way_in: list[np.ndarray]
    way_out: list[np.ndarray]
    score: float


@dataclass(frozen=True)
class Target:
    """An object to grasp: name in the collision world, pose, direction (3,) out of its place,
    distance out [m].
    """

    name: str
    pose: pin.SE3
    symmetric: bool
    out: np.ndarray
    distance: float


def approaches(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    target: Target,
    ways: Sequence[GraspWay],
    rng: np.random.Generator,
    *,
    torso: tuple[float, float] = (-0.9, 0.9),
    wanted: int = 4,
    tries: int = 400,
) -> list[Approach]:
    """Return up to `wanted` solved grasps, most comfortable first; empty if `tries` candidates gave
    none.

    q (15,): the other arm keeps its joints. The object stands in `world` under its name, and is
    there again afterwards.
    """
    found: list[Approach] = []
    for way, azimuth in _candidates(ways, rng, tries):
        solved = _solve(robot, world, side, q, target, way, azimuth, rng, torso)
        if solved is not None:
            found.append(solved)
        if len(found) >= wanted:
            break
    return sorted(found, key=lambda a: -a.score)


def _candidates(
    ways: Sequence[GraspWay], rng: np.random.Generator, tries: int
) -> Iterator[tuple[GraspWay, float]]:
    for _ in range(tries):
        yield ways[int(rng.integers(len(ways)))], float(rng.normal(0.0, AZIMUTH_SPREAD))


def grips(target: Target, way: GraspWay, azimuth: float) -> list[pin.SE3] | None:
    """Return the grip poses in the world for each step of `way`, the object turned so that the hand
    approaches against `target.out` turned by `azimuth` [rad]; to one that lies, from above. None
    for an object that is not symmetric and turned too far from that.
    """
    T_object_grip = [pose.inverse() for pose, _ in way.steps]
    if lies(target.pose):
        down = target.pose.rotation.T @ np.array([0.0, 0.0, -1.0])
        about = heading(down) - heading(T_object_grip[-1].rotation[:, 2]) + azimuth
        return [target.pose * standing(np.zeros(3), about) * t for t in T_object_grip]
    wanted = heading(-target.out) + azimuth
    if target.symmetric:
        about = wanted - heading(T_object_grip[-1].rotation[:, 2])
        turned = standing(target.pose.translation, about)
        return [turned * t for t in T_object_grip]
    own = heading((target.pose * T_object_grip[-1]).rotation[:, 2])
    if abs(math.remainder(own - heading(-target.out), math.tau)) > 2 * AZIMUTH_SPREAD:
        return None
    return [target.pose * t for t in T_object_grip]


def _solve(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    target: Target,
    way: GraspWay,
    azimuth: float,
    rng: np.random.Generator,
    torso: tuple[float, float],
) -> Approach | None:
    poses = grips(target, way, azimuth)
    if poses is None:
        return None
    with attaching.allowed(world, (target.name, f"{side}_hand")):
        world.fingers(side, way.steps[-1][1])
        grasp = ik.sample(
            robot, side, poses[-1], q, rng, torso=torso, first=world.first_free, best=True
        )
        if grasp is None:
            return None
        way_in = ik.lines(robot, side, grasp, poses[-2::-1], world.free)
    if way_in is None:
        return None
    way_out = _pull(robot, world, side, grasp, target, poses[-1])
    if way_out is None:
        return None
    if not all(ik.comfortable(robot, q, side) for q in (way_in[-1], way_out[-1])):
        return None
    pairs = zip(poses, way.steps, strict=True)
    steps = tuple((target.pose.inverse() * pose, fingers) for pose, (_, fingers) in pairs)
    score = _comfort(robot, side, (way_in[-1], grasp, way_out[-1])) - 0.2 * abs(azimuth)
    return Approach(way.name, steps, way_in[::-1], way_out, score)


def _pull(
    robot: Robot, world: World, side: str, grasp: np.ndarray, target: Target, grip: pin.SE3
) -> list[np.ndarray] | None:
    """Return the lift, of which only the end is free (the object stands on its support), and the
    path out with it.
    """
    up = shifted(grip, np.array([0.0, 0.0, LIFT_M]))
    with attaching.held(world, target.name, side, grip.inverse() * target.pose):
        try:
            path = ik.line(robot, side, grasp, up)
            if not world.free(path[-1]):
                return None
            end = shifted(up, target.out * target.distance)
            return path + ik.line(robot, side, path[-1], end, accept=world.free)[1:]
        except ik.PathBlocked:
            return None


def _comfort(robot: Robot, side: str, postures: Sequence[np.ndarray]) -> float:
    margins = [ik.margin(robot, q, side) for q in postures]
    limit, singular = min(m[0] for m in margins), min(m[1] for m in margins)
    return limit + 0.5 * min(singular, 0.3) - 0.25 * abs(float(postures[1][0]))

"""The tilt of a held jar over a bowl: its opening beside the rim, lower as it tilts more.

Geometry of the published waypoints (proghtn-backstream@019fd34): opening 0.02 outside the rim, 0.25
above it at 45 degrees, 0.15 from 90 degrees on, end at 135 degrees.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from velma.kinematics import ik
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.names import ARM

BESIDE_RIM_M = 0.02
HIGH_M, LOW_M = 0.25, 0.15  # above the rim, up to 45 degrees and from 90 degrees on
# samples of a tilt; estimate: beside a box before the bowl 5 of them were tilts (env2, seed 113)
TRIES = 1500
FIRST_TILT, LAST_TILT = math.radians(20.0), math.radians(135.0)
# where the inverse kinematics is sampled; task runs with the true robot model
SEED_TILT = math.radians(80.0)
STEP = 0.07  # [rad] of tilt between two solved postures; same runs
LARGEST_STEP = 0.3  # [rad] a joint may move between two of them; same runs
ROOM = 0.06
"""Distance of a planned tilt from the arm's limits [rad], twice that of any solved posture. The
tilt is solved again for the jar as it is in the hand, which moved joints by up to 0.02 (one pour;
the rest is an estimate).
"""


@dataclass(frozen=True)
class Stream:
    """Geometry of a tilt: centre (3,) and radius of the rim of the bowl, jar's opening above its
    origin [m].
    """

    rim: np.ndarray
    rim_radius: float
    opening: float

    def source(self, tilt: float, azimuth: float, spin: float) -> pin.SE3:
        """Pose of the jar at `tilt`, its opening moving down towards `azimuth`, turned by `spin`
        about itself [rad].
        """
        towards = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        axis = np.array([-towards[1], towards[0], 0.0])
        rotation = pin.exp3(axis * tilt) @ pin.exp3(np.array([0.0, 0.0, spin]))
        part = min(1.0, max(0.0, (tilt - math.pi / 4) / (math.pi / 4)))
        height = HIGH_M + (LOW_M - HIGH_M) * part
        beside = self.rim - towards * (self.rim_radius + BESIDE_RIM_M)
        opening = beside + np.array([0.0, 0.0, height])
        return pin.SE3(rotation, opening - rotation @ np.array([0.0, 0.0, self.opening]))


def stream(
    T_world_bowl: pin.SE3, rim: Sequence[float], rim_radius: float, opening: Sequence[float]
) -> Stream:
    """Return the geometry of a tilt over a bowl that stands there. `rim`, `opening`: centres (3,)
    in the frames of bowl and jar [m].
    """
    return Stream(T_world_bowl.act(np.array(rim)), rim_radius, opening[2])


@dataclass(frozen=True)
class Tilting:
    """A solved tilt: directions [rad] and the postures from the first tilt to the last (lists of
    (15,)).
    """

    azimuth: float
    spin: float
    path: list[np.ndarray]


def tiltings(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    T_grip_object: pin.SE3,
    stream: Stream,
    rng: np.random.Generator,
    *,
    tries: int = TRIES,
) -> Iterator[Tilting]:
    """Yield solved tilts; the jar is attached to the hand in `world`, the torso is at rest in
    each.
    """
    for _ in range(tries):
        azimuth, spin = rng.uniform(-np.pi, np.pi, 2)
        start = stream.source(SEED_TILT, azimuth, spin) * T_grip_object.inverse()
        first = world.first_free
        seed = ik.sample(robot, side, start, q, rng, torso=(-1.25, 1.25), first=first)
        if seed is None:
            continue
        held = robot, world, side, seed, T_grip_object, stream, azimuth, spin
        path = follow(*held, (SEED_TILT, LAST_TILT))
        back = path and follow(*held, (SEED_TILT, FIRST_TILT))
        if path and back and all(ik.margin(robot, one, side)[0] >= ROOM for one in (*back, *path)):
            yield Tilting(float(azimuth), float(spin), back[::-1] + path[1:])


def follow(
    robot: Robot,
    world: World,
    side: str,
    q: np.ndarray,
    T_grip_object: pin.SE3,
    stream: Stream,
    azimuth: float,
    spin: float,
    tilts: tuple[float, float],
) -> list[np.ndarray] | None:
    """Return postures that tilt from one angle to the other [rad], beginning at q (15,); None where
    one is blocked.
    """
    held = T_grip_object.inverse()
    path = [q]
    for tilt in np.linspace(*tilts, max(2, int(abs(tilts[1] - tilts[0]) / STEP)))[1:]:
        target = stream.source(float(tilt), azimuth, spin) * held
        following = ik.solve(robot, side, target, path[-1], columns=ARM[side], iterations=20)
        if following is None or np.abs(following - path[-1]).max() > LARGEST_STEP:
            return None
        if not world.free(following):
            return None
        path.append(following)
    return path

"""Timing of a path: as fast as the limits of joints and tool allow, at rest at both ends.

toppra finds the fastest motion along the path. Its accelerations jump, so a moving average in time smooths them. The
average keeps the limits of speed and acceleration, and leaves the path only where that bends. Knows no scene.
"""

import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from velma import names
from velma.errors import VelmaError
from velma.kinematics.robot import Robot
from velma.names import Array

PERIOD_S = 0.01  # between knots; the loop interpolates
JOINT_FRACTION = 0.5  # of the joints' speed limits (trial runs: 0.26 rad/s torso, 0.96-1.57 arms)
_ARM_ACCELERATION = (1.2, 1.2, 1.5, 1.5, 2.0, 2.0, 2.0)
ACCELERATION = np.array([0.4, *_ARM_ACCELERATION, *_ARM_ACCELERATION])  # rad/s^2, trial runs: the load stays put
_AVERAGED = 8  # periods: 80 ms, trial runs
_DENSE = 0.05  # rad between the points of the spline, so that it stays on the path
_SAME = 1e-7  # rad: points nearer than this are one
_STILL = 1e-9  # m or rad per unit of path: slower limits no speed


class NotTimed(VelmaError):
    """No speed profile was found for a path."""

    def __init__(self, points: int, length: float) -> None:
        self.points, self.length = points, length
        super().__init__(
            f"toppra found no speeds for a path of {points} points and {length:.3f} rad; are they in order?"
        )


@dataclass(frozen=True)
class Trajectory:
    """q (n, 15) [rad] and v (n, 15) [rad/s] at the times 0, dt, 2 dt, ...; at rest at both ends."""

    dt: float
    q: Array
    v: Array

    @property
    def duration(self) -> float:
        """Time [s] of the last knot."""
        return self.dt * (len(self.q) - 1)

    def at(self, t: float) -> tuple[Array, Array]:
        """Return q (15,) and v (15,) at t [s], between knots interpolated, before and after at rest at the ends."""
        place = min(max(t / self.dt, 0.0), len(self.q) - 1.0)
        k = min(int(place), max(len(self.q) - 2, 0))
        share, following = place - k, min(k + 1, len(self.q) - 1)
        return (
            (1 - share) * self.q[k] + share * self.q[following],
            (1 - share) * self.v[k] + share * self.v[following],
        )


@cache
def loaded() -> ModuleType:
    """Return toppra, imported at first use: with scipy it takes longer than all the rest (0.7 s of processor time).

    May be called before it is needed.
    """
    with _without_pictures(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # toppra 0.6.10: invalid escape sequences in docstrings
        import toppra
    toppra.setup_logging("ERROR")
    return toppra  # type: ignore[no-any-return]


@contextmanager
def _without_pictures() -> Iterator[None]:
    """Put an empty matplotlib in place for toppra, which imports it for drawing: the real one doubles its time."""
    names_had = {name: sys.modules.get(name) for name in ("matplotlib", "matplotlib.pyplot")}
    sys.modules.update({name: ModuleType(name) for name in names_had})
    sys.modules["matplotlib"].__dict__["pyplot"] = sys.modules["matplotlib.pyplot"]
    try:
        yield
    finally:
        for name, had in names_had.items():
            del sys.modules[name]
            if had is not None:
                sys.modules[name] = had


def dense(path: Sequence[Array] | Array, step: float = _DENSE) -> Array:
    """Return the points (n, 15) of a joint path, with more between those over `step` [rad] apart, no repetitions."""
    points = np.asarray(path, dtype=np.float64)
    ways = points[1:] - points[:-1]
    lengths = np.abs(ways).max(axis=1, initial=0.0)
    counts = np.where(lengths > _SAME, np.ceil(lengths / step), 0.0).astype(np.int64)
    of = np.repeat(np.arange(len(ways)), counts)
    number = np.arange(1, len(of) + 1) - (np.cumsum(counts) - counts)[of]
    return np.concatenate((points[:1], points[of] + (number / counts[of])[:, None] * ways[of]))


def timed(
    robot: Robot, path: Sequence[Array], *, tool_speed: float, joint_fraction: float = JOINT_FRACTION
) -> Trajectory:
    """Return the timed path [(15,) each, rad]: both grips at most at `tool_speed` [m/s], joints within limits.

    Limits are `joint_fraction` of the joints' speeds, and `ACCELERATION`. Raises `NotTimed`.
    """
    points = dense(path)
    goal = np.asarray(path[-1], dtype=np.float64)
    if len(points) == 1:
        return Trajectory(PERIOD_S, goal[None].copy(), np.zeros((1, 15)))
    q, v = _fastest(robot, points, tool_speed, joint_fraction * robot.speed)
    q, v = _averaged(q, points[0], goal), _averaged(v, np.zeros(15), np.zeros(15))
    q[0], q[-1] = points[0], goal
    return Trajectory(PERIOD_S, q, v)


def _fastest(robot: Robot, points: Array, tool_speed: float, speed: Array) -> tuple[Array, Array]:
    """Return toppra's fastest motion along a spline through the points (n, 15), n > 1: q and v, `PERIOD_S` apart."""
    toppra = loaded()
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    spline = toppra.SplineInterpolator(along, points)
    grid = np.linspace(0.0, along[-1], max(4 * len(points), 50))
    constraints = [
        _path_speeds(_speeds(robot, spline, grid, tool_speed, speed)),
        toppra.constraint.JointAccelerationConstraint(np.stack((-ACCELERATION, ACCELERATION), axis=1)),
    ]
    _, speeds, *_ = toppra.algorithm.TOPPRA(constraints, spline, gridpoints=grid).compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all():
        raise NotTimed(len(points), float(along[-1]))
    s, ds = _in_time(grid, speeds)
    return spline(s), spline(s, 1) * ds[:, None]


def _path_speeds(largest: Array) -> Any:
    """Return toppra's constraint for the largest path speeds at the grid (n,)."""
    toppra = loaded()

    class PathSpeeds(toppra.constraint.LinearConstraint):  # type: ignore[misc,name-defined]
        def compute_constraint_params(self, path: Any, gridpoints: Array) -> tuple[Array | None, ...]:
            return *(None,) * 6, np.stack((np.zeros_like(largest), largest**2), axis=1)

    constraint = PathSpeeds()
    constraint.dof = len(names.BODY)
    return constraint


def _in_time(grid: Array, speeds: Array) -> tuple[Array, Array]:
    """Return place on the path and path speed, `PERIOD_S` apart, from speeds (n,) at the grid (n,), evenly changed."""
    lengths = np.diff(grid)
    begins = np.concatenate(([0.0], np.cumsum(2.0 * lengths / (speeds[:-1] + speeds[1:]))))
    changes = 0.5 * np.diff(speeds**2) / lengths
    times = np.arange(0.0, begins[-1], PERIOD_S)
    k = np.searchsorted(begins[:-1], times, side="right") - 1
    t = times - begins[k]
    return grid[k] + t * speeds[k] + 0.5 * t**2 * changes[k], speeds[k] + t * changes[k]


def _speeds(robot: Robot, spline: Any, grid: Array, tool_speed: float, speed: Array) -> Array:
    """Return the largest path speeds (n,) at the grid: no joint and no grip is faster than allowed."""
    postures, tangents = spline(grid), np.abs(spline(grid, 1))
    reach = np.zeros(len(grid))  # metres of the faster grip per unit of path
    for side in names.SIDES:
        per_unit = np.linalg.norm(np.diff(robot.track(postures, side), axis=0), axis=1) / np.diff(grid)
        reach[:-1] = np.maximum(reach[:-1], per_unit)
        reach[1:] = np.maximum(reach[1:], per_unit)
    joints = (speed / np.maximum(tangents, _STILL)).min(axis=1)
    return np.asarray(np.minimum(tool_speed / np.maximum(reach, _STILL), joints))


def _averaged(samples: Array, before: Array, after: Array) -> Array:
    """Return moving average (n + 10, 15) of samples (n, 15) with constant values before and after."""
    whole = np.concatenate((np.tile(before, (_AVERAGED + 1, 1)), samples, np.tile(after, (_AVERAGED + 1, 1))))
    sums = np.cumsum(np.concatenate((np.zeros((1, whole.shape[1])), whole)), axis=0)
    return np.asarray((sums[_AVERAGED + 1 :] - sums[: -_AVERAGED - 1]) / (_AVERAGED + 1))

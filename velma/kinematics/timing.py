"""Timing of a path: as fast as the limits of joints and tool allow, at rest at both ends.

TOPP-RA finds the fastest motion along the path. Its accelerations jump, so a moving average in time
smooths them. The average keeps the limits of speed and acceleration, and leaves the path only where
that bends. Knows no scene.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from velma import names, ranges
from velma.compiled import library
from velma.errors import MotionError
from velma.kinematics.robot import Robot
from velma.names import Array

# --- A cubic spline through points: continuous up to the second derivative, and up to the third at
# the outermost knots
# ("not-a-knot", C. de Boor, A Practical Guide to Splines, chapter IV). Knows no robot.


class Spline:
    """A curve through points (n, m) at increasing places (n,), n > 1; a straight line for two, a
    parabola for three.
    """

    def __init__(self, places: Array, points: Array) -> None:
        self._places = places
        lengths = np.diff(places)
        slopes = np.diff(points, axis=0) / lengths[:, None]
        speeds = _speeds(lengths, slopes)
        bend = (speeds[:-1] + speeds[1:] - 2.0 * slopes) / lengths[:, None]
        quadratic, cubic = (slopes - speeds[:-1]) / lengths[:, None] - bend, bend / lengths[:, None]
        # of each piece, in powers of the way from its start
        self._parts = points[:-1], speeds[:-1], quadratic, cubic

    def at(self, places: Array) -> tuple[Array, Array, Array]:
        """Return value, first and second derivative, (k, m) each, at `places` (k,)."""
        piece = np.searchsorted(self._places[1:-1], places, side="right")
        t = (places - self._places[piece])[:, None]
        constant, linear, quadratic, cubic = (part[piece] for part in self._parts)
        return (
            ((cubic * t + quadratic) * t + linear) * t + constant,
            (3.0 * cubic * t + 2.0 * quadratic) * t + linear,
            6.0 * cubic * t + 2.0 * quadratic,
        )


def _speeds(lengths: Array, slopes: Array) -> Array:
    """Return the first derivatives (n, m) at the places, from lengths (n - 1,) and slopes (n - 1,
    m) of the pieces.
    """
    n = len(slopes) + 1
    if n == 2:
        return np.repeat(slopes, 2, axis=0)
    # A tridiagonal system: lower, diagonal and upper (n,), right (n, m).
    lower = np.zeros(n)
    diagonal = np.zeros(n)
    upper = np.zeros(n)
    right = np.zeros((n, slopes.shape[1]))
    lower[1:-1], upper[1:-1] = lengths[1:], lengths[:-1]
    diagonal[1:-1] = 2.0 * (lengths[:-1] + lengths[1:])
    right[1:-1] = 3.0 * (lengths[1:, None] * slopes[:-1] + lengths[:-1, None] * slopes[1:])
    if n == 3:
        diagonal[[0, -1]] = upper[0] = lower[-1] = 1.0
        right[0], right[-1] = 2.0 * slopes[0], 2.0 * slopes[-1]
    else:
        diagonal[0], upper[0] = lengths[1], lengths[0] + lengths[1]
        right[0] = _end(lengths[0], lengths[1], slopes[0], slopes[1])
        diagonal[-1], lower[-1] = lengths[-2], lengths[-1] + lengths[-2]
        right[-1] = _end(lengths[-1], lengths[-2], slopes[-1], slopes[-2])
    return _tridiagonal(lower, diagonal, upper, right)


def _end(outer: float, inner: float, slope: Array, inner_slope: Array) -> Array:
    """Return the right side at an end: the third derivative does not change at the knot next to
    it.
    """
    both = outer + inner
    return np.asarray(((outer + 2.0 * both) * inner * slope + outer**2 * inner_slope) / both)


def _tridiagonal(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Return the solution (n, m) by elimination without pivots, which the systems above do not
    need.
    """
    n, ratios, found = len(diagonal), np.empty(len(diagonal)), np.empty_like(right)
    ratios[0], found[0] = upper[0] / diagonal[0], right[0] / diagonal[0]
    for k in range(1, n):
        pivot = diagonal[k] - lower[k] * ratios[k - 1]
        ratios[k], found[k] = upper[k] / pivot, (right[k] - lower[k] * found[k - 1]) / pivot
    for k in range(n - 2, -1, -1):
        found[k] -= ratios[k] * found[k + 1]
    return found


# --- Timing of a path -----------------------------------------------------------------------------


PERIOD_S = 0.01  # between knots; the loop interpolates
JOINT_FRACTION = 0.5  # of the joints' speed limits (trial runs: 0.26 rad/s torso, 0.96-1.57 arms)
_ARM_ACCELERATION = (1.2, 1.2, 1.5, 1.5, 2.0, 2.0, 2.0)
# rad/s^2, trial runs: the load stays put
ACCELERATION = np.array([0.4, *_ARM_ACCELERATION, *_ARM_ACCELERATION])
_AVERAGED = 8  # periods: 80 ms, trial runs
_DENSE = 0.05  # rad between the points of the spline, so that it stays on the path
_SAME = 1e-7  # rad: points nearer than this are one
_STILL = 1e-9  # m or rad per unit of path: slower limits no speed and no acceleration


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
        """Return q (15,) and v (15,) at t [s], between knots interpolated, before and after at rest
        at the ends.
        """
        place = min(max(t / self.dt, 0.0), len(self.q) - 1.0)
        k = min(int(place), max(len(self.q) - 2, 0))
        share, following = place - k, min(k + 1, len(self.q) - 1)
        q, v = ((1 - share) * rows[k] + share * rows[following] for rows in (self.q, self.v))
        return q, v


def dense(path: Sequence[Array] | Array, step: float = _DENSE) -> Array:
    """Return the points (n, 15) of a joint path, with more between those over `step` [rad] apart,
    no repetitions.
    """
    points = np.asarray(path, dtype=np.float64)
    ways = points[1:] - points[:-1]
    lengths = np.abs(ways).max(axis=1, initial=0.0)
    counts = np.where(lengths > _SAME, np.ceil(lengths / step), 0.0).astype(np.int64)
    of = np.repeat(np.arange(len(ways)), counts)
    number = np.arange(1, len(of) + 1) - (np.cumsum(counts) - counts)[of]
    return np.concatenate((points[:1], points[of] + (number / counts[of])[:, None] * ways[of]))


def timed(
    robot: Robot,
    path: Sequence[Array],
    *,
    tool_speed: float,
) -> Trajectory:
    """Return the timed path [(15,) each, rad]: both grips at most at `tool_speed` [m/s], joints
    within limits.

    Limits are `JOINT_FRACTION` of the joints' speeds, and `ACCELERATION`. Raises MotionError for a
    path beyond limits of joints (or farther beyond than its start), a speed out of its range, and a
    motion of more than LONGEST_S.
    """
    ranges.number("tool_speed", tool_speed, ranges.SLOWEST_TOOL, ranges.FASTEST_TOOL)
    whole = ranges.joints("path", path)
    speed = JOINT_FRACTION * robot.speed
    _check_duration(float((np.abs(np.diff(whole, axis=0)) / speed).max(axis=1, initial=0.0).sum()))
    points, goal = dense(whole), whole[-1]
    if len(points) == 1:
        return Trajectory(PERIOD_S, goal[None].copy(), np.zeros((1, 15)))
    q, v = _fastest(robot, points, tool_speed, speed)
    q, v = _averaged(q, points[0], goal), _averaged(v, np.zeros(15), np.zeros(15))
    q[0], q[-1] = points[0], goal
    return Trajectory(PERIOD_S, q, v)


def _check_duration(seconds: float) -> None:
    if not seconds <= ranges.LONGEST_S:
        most = f"at most {ranges.LONGEST_S:g} s: make it shorter or faster"
        raise MotionError("path", f"of {seconds:.0f} s", most)


def _fastest(robot: Robot, points: Array, tool_speed: float, speed: Array) -> tuple[Array, Array]:
    """Return the fastest motion along a spline through the points (n, 15), n > 1: q and v,
    `PERIOD_S` apart.
    """
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    spline = Spline(along, points)
    grid = np.linspace(0.0, along[-1], max(4 * len(points), 50))
    postures, first, second = spline.at(grid)
    largest = _largest_speeds(robot, grid, postures, np.abs(first), tool_speed, speed)
    squared = path_speeds(first, second, ACCELERATION, np.diff(grid), largest**2)
    s, ds = _in_time(grid, np.sqrt(squared))
    q, tangent, _ = spline.at(s)
    return q, tangent * ds[:, None]


def path_speeds(first: Array, second: Array, limit: Array, length: Array, largest: Array) -> Array:
    """Return the squared path speeds (n,) of the fastest motion along a path, at rest at both ends.

    `first`, `second` (n, joints): the path's derivatives at the grid points [rad per unit of path];
    `limit` (joints,): largest accelerations [rad/s^2]; `length` (n - 1,): between grid points;
    `largest` (n,): bounds of the result. The algorithm is TOPP-RA (IEEE Transactions on Robotics
    34(3), 2018); velma/compiled/speeds.c explains a, b, h, x.
    """
    built, x = library(), np.array(largest, dtype=np.float64)
    if built is not None:
        arrays = (first, second, limit, length)
        given = [np.ascontiguousarray(array, dtype=np.float64) for array in arrays]
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*given, x)]
        built.path_speeds(ctypes.c_int(len(x)), ctypes.c_int(len(limit)), *pointers)
        return x
    twice = 2.0 * length
    a = np.concatenate((first[:-1], first[1:] + twice[:, None] * second[1:]), axis=1)
    b = np.concatenate((second[:-1], second[1:]), axis=1) * np.where(a < 0.0, -1.0, 1.0)
    a, h = np.abs(a), np.tile(limit, 2)
    # what bounds nothing is inf, or nan, which fmin passes over
    with np.errstate(divide="ignore", invalid="ignore"):
        _backward_pass(a, b, h, twice, x)
        _forward_pass(a, b, h, twice, x)
    return x


def _backward_pass(a: Array, b: Array, h: Array, twice: Array, x: Array) -> None:
    """Lower x (n,), from the last grid point to the first, to what can still brake to the next
    point's x.
    """
    x[-1] = 0.0
    slope = a - twice[:, None] * b
    for i in range(len(x) - 2, -1, -1):
        room = twice[i] * h + np.where(slope[i] > 0.0, x[i + 1] * a[i], 0.0)
        pairs = (h[:, None] * a[i] + h * a[i][:, None]) / np.abs(
            b[i][:, None] * a[i] - b[i] * a[i][:, None]
        )
        x[i] = min(x[i], np.fmin.reduce(room / np.abs(slope[i])), np.fmin.reduce(pairs, axis=None))


def _forward_pass(a: Array, b: Array, h: Array, twice: Array, x: Array) -> None:
    """Lower x (n,), from the first grid point to the last, to what the largest acceleration
    reaches.
    """
    x[0] = 0.0
    for i in range(len(x) - 1):
        moves = a[i] > _STILL
        reached = x[i] + twice[i] * ((h[moves] - b[i, moves] * x[i]) / a[i, moves])
        x[i + 1] = max(min(x[i + 1], reached.min(initial=np.inf)), 0.0)


def _in_time(grid: Array, speeds: Array) -> tuple[Array, Array]:
    """Return place on the path and path speed, `PERIOD_S` apart, from speeds (n,) at the grid (n,),
    evenly changed.
    """
    lengths = np.diff(grid)
    begins = np.concatenate(([0.0], np.cumsum(2.0 * lengths / (speeds[:-1] + speeds[1:]))))
    _check_duration(float(begins[-1]))
    changes = 0.5 * np.diff(speeds**2) / lengths
    times = np.arange(0.0, begins[-1], PERIOD_S)
    k = np.searchsorted(begins[:-1], times, side="right") - 1
    t = times - begins[k]
    return grid[k] + t * speeds[k] + 0.5 * t**2 * changes[k], speeds[k] + t * changes[k]


def _largest_speeds(
    robot: Robot, grid: Array, postures: Array, tangents: Array, tool_speed: float, speed: Array
) -> Array:
    """Return the largest path speeds (n,) at the grid: no joint and no grip is faster than
    allowed.
    """
    reach = np.zeros(len(grid))  # metres of the faster grip per unit of path
    for side in names.SIDES:
        way = np.linalg.norm(np.diff(robot.chain[side].track(postures), axis=0), axis=1)
        per_unit = way / np.diff(grid)
        reach[:-1] = np.maximum(reach[:-1], per_unit)
        reach[1:] = np.maximum(reach[1:], per_unit)
    joints = (speed / np.maximum(tangents, _STILL)).min(axis=1)
    return np.asarray(np.minimum(tool_speed / np.maximum(reach, _STILL), joints))


def _averaged(samples: Array, before: Array, after: Array) -> Array:
    """Return moving average (n + 10, 15) of samples (n, 15) with constant values before and
    after.
    """
    begin, end = (np.tile(one, (_AVERAGED + 1, 1)) for one in (before, after))
    whole = np.concatenate((begin, samples, end))
    sums = np.cumsum(np.concatenate((np.zeros((1, whole.shape[1])), whole)), axis=0)
    return np.asarray((sums[_AVERAGED + 1 :] - sums[: -_AVERAGED - 1]) / (_AVERAGED + 1))

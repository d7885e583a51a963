"""Inverse kinematics of a grip: iterative from a posture, in closed form from a pose, and measures of comfort.

`solve` and `line` start at a posture, so their results are continuous. `sample` returns postures comfortable enough
to end a motion in, whatever the present one. Sides are "left" and "right", poses T_world_grip, q (15,) [rad].
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import eigenpy
import numpy as np
import pinocchio as pin

from velma import names
from velma.kinematics.arm import ArmGeometry, Wanted
from velma.kinematics.chain import Limits
from velma.kinematics.robot import Robot, between
from velma.names import Array, Columns

Accept = Callable[[Array], bool]
First = Callable[[Array], int | None]
"""Of postures (n, 15), in order: the number of the first that is accepted."""

TORSO_END = 1.3  # rad: distance of end postures from the torso's limit of 1.57 (trial runs: turning back needs room)
END_MARGIN = 0.08  # rad from every limit of the arm at the end of a motion (trial runs)
_STAY_INSIDE = 0.03  # rad: iterations are clipped this far inside the limits
_DAMPING = 1e-4  # of J J^T; small enough to reach 0.5 mm, large enough to pass the elbow's singularity
_LARGEST_TURN = 0.35  # rad a joint may move in one iteration
_LARGEST_ERROR = 0.25  # m and rad: targets farther away are approached in parts
_A_SECOND = 0.04  # comfort per second of travel: 8 s outweigh a third of a radian from a limit (estimate)
_TOLERANCE = (5e-4, 2e-3)  # m and rad, of each axis
_ON_A_LINE = 15  # iterations from one pose of a line to the next
_JUMP = 0.25  # rad between neighbours of a line: more means that the elbow flipped


class PathBlocked(Exception):
    """A straight line of the grip cannot be followed to its end; `q` is the first configuration that failed."""

    def __init__(self, reason: str, q: Array, fraction: float) -> None:
        self.reason, self.q, self.fraction = reason, q, fraction
        super().__init__(f"the line of the grip ends at {100 * fraction:.0f} % of its length: {reason}")


def _step(jacobian: Array, error: Array) -> Array:
    """Damped least squares: J^T (J J^T + damping)^-1 error, shortened to `_LARGEST_TURN`."""
    square = jacobian @ jacobian.T
    square.ravel()[::7] += _DAMPING
    change = eigenpy.LLT(square).solve(error) @ jacobian
    largest = max(change.max(), -change.min())
    return np.asarray(change if largest <= _LARGEST_TURN else change * (_LARGEST_TURN / largest))


def solve(
    robot: Robot,
    side: str,
    target: Any,
    q: Array,
    *,
    columns: Columns | None = None,
    iterations: int = 45,
    tolerance: tuple[float, float] = _TOLERANCE,
) -> Array | None:
    """Return q with the grip of `side` at `target`, reached from q by moving only `columns` (torso + arm by default).

    Tolerance is per axis in m and rad; the result is a new array at least 0.03 rad inside the limits, or None.
    """
    columns = names.COLUMNS[side] if columns is None else columns
    if not all(map(math.isfinite, q.tolist())):
        return None
    compiled = robot.chain[side]
    if compiled is not None:
        return compiled.solve(target, q, _limits(robot, tuple(columns), iterations, tolerance))
    lower, upper = robot.lower[columns] + _STAY_INSIDE, robot.upper[columns] - _STAY_INSIDE
    model, data, frame = robot.model, robot.data, robot.frame[side]
    near, turned = tolerance
    goal, goal_rotation = target.translation, target.rotation
    error, q = np.empty(6), q.copy()
    for _ in range(iterations):
        pin.computeJointJacobians(model, data, q)
        here = pin.updateFramePlacement(model, data, frame)
        error[:3] = goal - here.translation
        error[3:] = pin.log3(goal_rotation @ here.rotation.T)
        size = np.abs(error)
        if size[:3].max() < near and size[3:].max() < turned:
            return q
        jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED).take(columns, 1)
        change = _step(jacobian, np.minimum(np.maximum(error, -_LARGEST_ERROR), _LARGEST_ERROR))
        q[columns] = np.minimum(np.maximum(q.take(columns) + change, lower), upper)
    return None


@lru_cache(maxsize=64)
def _limits(robot: Robot, columns: tuple[int, ...], iterations: int, tolerance: tuple[float, float]) -> Limits:
    numbers = (iterations, *tolerance, _DAMPING, _LARGEST_TURN, _LARGEST_ERROR)
    return Limits(numbers, robot.lower + _STAY_INSIDE, robot.upper - _STAY_INSIDE, list(columns))


def line(
    robot: Robot,
    side: str,
    q: Array,
    target: Any,
    *,
    step: float = 0.015,
    accept: Accept | None = None,
    columns: Columns | None = None,
) -> list[Array]:
    """Configurations, q first, whose grip goes straight to `target`, at most `step` [m] and 0.06 rad apart.

    Only `columns` move (the 7 joints of the arm by default). Raises `PathBlocked` with the reason "reach" (no
    solution), "jump" (a joint would move over 0.25 rad in one step) or "collision" (`accept` said no).
    """
    columns = names.ARM[side] if columns is None else columns
    start = robot.grip(q, side)
    length = float(np.linalg.norm(target.translation - start.translation))
    turn = float(np.linalg.norm(pin.log3(target.rotation @ start.rotation.T)))
    count = max(2, int(max(length / step, turn / 0.06)))
    compiled = robot.chain[side]
    if compiled is not None:
        limits = _limits(robot, tuple(columns.tolist()), _ON_A_LINE, _TOLERANCE)
        solved, jumps = compiled.line(start, target, count, q, limits, _JUMP)
    else:
        solved, jumps = _solved_line(robot, side, between(start, target, count), q, columns)
    path = [q]
    for following in solved[: len(solved) - jumps]:
        if accept is not None and not accept(following):
            raise PathBlocked("collision", following, (len(path) - 1) / count)
        path.append(following)
    if jumps:
        raise PathBlocked("jump", solved[-1], (len(path) - 1) / count)
    if len(path) <= count:
        raise PathBlocked("reach", path[-1], (len(path) - 1) / count)
    return path


def _solved_line(robot: Robot, side: str, poses: list[Any], q: Array, columns: Columns) -> tuple[list[Array], bool]:
    """Return a posture for each pose, up to one that is not found, or jumps from the one before; whether one does."""
    path = [q]
    for pose in poses:
        following = solve(robot, side, pose, path[-1], columns=columns, iterations=_ON_A_LINE)
        if following is None:
            break
        path.append(following)
        if np.abs(following - path[-2]).max() > _JUMP:
            return path[1:], True
    return path[1:], False


def _inside(polygon: Array, x: Array, y: Array) -> Any:
    """Return which points (n,) are inside the polygon (corners, 2): an odd number of edges is to the right of each."""
    x0, y0 = polygon.T[:, :, None]
    x1, y1 = np.concatenate((polygon[1:], polygon[:1])).T[:, :, None]
    crosses = (y0 > y) != (y1 > y)
    at = (x1 - x0) * (y - y0) / (y1 - y0) + x0
    return np.count_nonzero(crosses & (x < at), axis=0) % 2 == 1


def _to_limit(robot: Robot, arm: Array, side: str) -> Array:
    """Distance [rad] of arms (n, 7) to the nearest limit, (n,)."""
    columns = names.ARM[side]
    return np.asarray(np.minimum(arm - robot.lower[columns], robot.upper[columns] - arm).min(axis=1))


def _to_singular(arm: Array) -> Array:
    """Distance [rad] of arms (n, 7) to the nearest straight shoulder, elbow or wrist, (n,)."""
    return np.asarray(np.abs(arm[:, 1::2]).min(axis=1))


def margin(robot: Robot, q: Array, side: str) -> tuple[float, float]:
    """Return distance [rad] of the arm to its nearest limit, and of joints 1, 3, 5 to zero, where they are singular."""
    arm = q[None, names.ARM[side]]
    return float(_to_limit(robot, arm, side)[0]), float(_to_singular(arm)[0])


def _comfortable(robot: Robot, arm: Array, torso: Array, side: str) -> Any:
    fits = (_to_limit(robot, arm, side) >= END_MARGIN) & (np.abs(torso) <= TORSO_END)
    fits[fits] = _inside(names.WRIST_POLYGON[side], *arm[fits, 5:].T)  # of few: the polygon takes longest
    return fits


def comfortable(robot: Robot, q: Array, side: str) -> bool:
    """Whether a motion may end in q: 0.08 rad from limits, wrist pair allowed, torso within 1.3 rad."""
    return bool(_comfortable(robot, q[None, names.ARM[side]], q[None, names.TORSO], side)[0])


def comfort(robot: Robot, q: Array, side: str) -> Array:
    """Return the comfort of configurations (n, 15), larger is better: far from limits and singularities, torso ahead.

    The weights are those that chose grasps in the trial runs.
    """
    arm = q[:, names.ARM[side]]
    to_limit, to_singular = _to_limit(robot, arm, side), _to_singular(arm)
    return np.minimum(to_limit, 0.5) + 0.5 * np.minimum(to_singular, 0.4) - 0.25 * np.abs(q[:, names.TORSO])


def travel(robot: Robot, side: str, q: Array, goals: Array) -> Array:
    """Return the least time (n,) [s] of torso and arm from q to each of `goals` (n, 15), at half their speed limits."""
    columns = names.COLUMNS[side]
    return np.asarray((np.abs(goals[:, columns] - q[columns]) / (0.5 * robot.speed[columns])).max(axis=1))


@lru_cache(maxsize=8)
def geometry(robot: Robot, side: str) -> ArmGeometry:
    """Return the closed form of one arm, computed once per robot."""
    return ArmGeometry(robot, side)


def postures(
    robot: Robot,
    side: str,
    target: Any,
    q: Array,
    rng: np.random.Generator,
    *,
    starts: int = 24,
    torso: tuple[float, float] | float = (-0.9, 0.9),
) -> Array:
    """Return comfortable configurations (m, 15) with the grip at `target`, of `starts` random torsos and elbows.

    The other arm keeps its joints of q. `torso` [rad] is a range, or one angle to keep. Collisions are not checked.
    """
    turned = np.full(starts, torso) if isinstance(torso, (int, float)) else rng.uniform(*torso, starts)
    swivel = rng.uniform(-np.pi, np.pi, starts)
    ended = geometry(robot, side).comfortable(target, turned, swivel, _wanted(robot, side), q)
    if ended is not None:
        return ended
    found, _ = geometry(robot, side).postures(target, turned, swivel)
    found = found[_comfortable(robot, found[:, 1:], found[:, 0], side)]
    whole = np.tile(q, (len(found), 1))
    whole[:, names.COLUMNS[side]] = found
    return whole


@lru_cache(maxsize=8)
def _wanted(robot: Robot, side: str) -> Wanted:
    """Return what `_comfortable` asks, for the library."""
    columns = names.ARM[side]
    limits = robot.lower[columns], robot.upper[columns]
    return Wanted(*limits, END_MARGIN, TORSO_END, names.WRIST_POLYGON[side], int(columns[0]))


def reachable(robot: Robot, side: str, target: Any, rng: np.random.Generator, *, starts: int = 200) -> bool:
    """Whether the grip can be at `target` at all, within the limits of `solve`, for one of `starts` torsos and elbows.

    Where a fiftieth of all torsos and elbows does, one in fifty is missed. Collisions are not checked.
    """
    columns = names.COLUMNS[side]
    lower, upper = robot.lower[columns] + _STAY_INSIDE, robot.upper[columns] - _STAY_INSIDE
    torso, swivel = rng.uniform(lower[0], upper[0], starts), rng.uniform(-np.pi, np.pi, starts)
    found, _ = geometry(robot, side).postures(target, torso, swivel)
    return bool(((found >= lower) & (found <= upper)).all(axis=1).any())


def sample(
    robot: Robot,
    side: str,
    target: Any,
    q: Array,
    rng: np.random.Generator,
    *,
    starts: int = 24,
    torso: tuple[float, float] | float = (-0.9, 0.9),
    first: First | None = None,
    best: bool = False,
) -> Array | None:
    """Return the first configuration of `postures` that `first` accepts, or None.

    They are tried in order of travel time from q; if `best`, comfort counts as well.
    """
    found = postures(robot, side, target, q, rng, starts=starts, torso=torso)
    value = -_A_SECOND * travel(robot, side, q, found)
    if best:
        value += comfort(robot, found, side)
    ordered = found[np.argsort(-value, kind="stable")]
    chosen = first(ordered) if first is not None else 0
    return np.array(ordered[chosen]) if chosen is not None and len(ordered) else None

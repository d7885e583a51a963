"""Inverse kinematics of a grip: iterative from a posture, in closed form from a pose, and measures
of comfort.

`solve` and `line` start at a posture, so their results are continuous. `sample` returns postures
comfortable enough to end a motion in, whatever the present one. Sides are "left" and "right", poses
T_world_grip, q (15,) [rad].
"""

import ctypes
import math
from collections.abc import Callable, Iterable
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from velma import names
from velma.compiled import fields, library
from velma.kinematics.robot import Limits, Robot
from velma.names import Array, Columns

# --- Inverse kinematics of Velma's arm in closed form: all postures of a grip pose, for many elbows
# and torsos at once The arm (KUKA LWR) has a spherical shoulder, a hinge at the elbow and a
# spherical wrist. The elbow may turn about the line from shoulder to wrist (the swivel angle), and
# each of the three parts has two solutions: 8 postures per swivel. Lengths and placement are read
# from the model; NotSuchAnArm for another kind of arm.
#
#     shoulder R(q0, q1, q2) = Rz Ry Rz,  elbow Ry(-q3),  wrist R(q4, q5, q6) = Rz Ry Rz


# Signs of elbow, shoulder and wrist: one row for each branch.
BRANCHES = np.array(list(product((1.0, -1.0), repeat=3)))


class NotSuchAnArm(ValueError):
    """The arm of the model is not spherical, hinge, spherical along one line, so the closed form
    does not hold.
    """

    def __init__(self, side: str, joint: str, found: Any) -> None:
        self.side, self.joint, self.found = side, joint, found
        super().__init__(
            f"the {side} arm has {joint} at {found}, expected on the z axis of the link before,"
            " unturned"
        )


def _zyz(rotation: Array, sign: Array) -> tuple[Array, Array, Array]:
    """Return angles with Rz(a) Ry(b) Rz(c) = rotation (n, 3, 3), b of the given sign (n,)."""
    b = sign * np.arccos(np.clip(rotation[:, 2, 2], -1.0, 1.0))
    a = np.arctan2(sign * rotation[:, 1, 2], sign * rotation[:, 0, 2])
    c = np.arctan2(sign * rotation[:, 2, 1], -sign * rotation[:, 2, 0])
    return a, b, c


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (n, 3); numpy's own takes twice as long for some dozens of them
    (measured).
    """
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=1)


class _Arm(ctypes.Structure):
    """As in arm.c."""

    _fields_ = fields((ctypes.c_double, "upper fore"), (ctypes.c_double * 12, "shoulder"))


class _Wanted(ctypes.Structure):
    """As in arm.c."""

    _fields_ = fields(
        (ctypes.c_void_p, "lower upper"),
        (ctypes.c_double, "margin torso"),
        (ctypes.c_int, "corners column"),
        (ctypes.c_void_p, "polygon"),
    )


class Wanted:
    """In which postures a motion may end: `margin` [rad] inside the limits (7,), the last two
    joints in `polygon` (corners, 2), the torso within `torso` [rad] of ahead; `column`: the first
    of the arm in a posture (15,).
    """

    def __init__(
        self, lower: Array, upper: Array, margin: float, torso: float, polygon: Array, column: int
    ) -> None:
        self._arrays = [np.array(one, dtype=np.float64) for one in (lower, upper, polygon)]
        least, most, corners = (array.ctypes.data for array in self._arrays)
        self.itself = _Wanted(least, most, margin, torso, len(polygon), column, corners)


def _numbers(pose: Any) -> Any:
    """A pose as arm.c takes it."""
    return (ctypes.c_double * 12)(*pose.rotation.ravel(), *pose.translation)


class ArmGeometry:
    """Lengths and frames of one arm, and the postures that bring its grip to a pose."""

    def __init__(self, robot: Robot, side: str) -> None:
        model = robot.model
        first = int(names.ARM[side][0]) + 1
        for k in range(first + 1, first + 7):
            placed = model.jointPlacements[k]
            off_axis = (
                np.abs(placed.translation[:2]).max() + np.abs(placed.rotation - np.eye(3)).max()
            )
            if off_axis > 1e-6:
                raise NotSuchAnArm(side, model.names[k], placed)
        z = [model.jointPlacements[k].translation[2] for k in range(first, first + 7)]
        self.upper, self.fore = z[2] + z[3], z[4] + z[5]  # shoulder to elbow, elbow to wrist [m]
        self.T_torso_shoulder = model.jointPlacements[first] * pin.SE3(
            np.eye(3), np.array([0.0, 0.0, z[1]])
        )
        self.T_world_torso = model.jointPlacements[1]
        hand = model.frames[robot.frame[side]].placement  # last joint to grip
        self.T_grip_wrist = hand.inverse() * pin.SE3(np.eye(3), np.array([0.0, 0.0, -z[6]]))
        built = library()
        self._comfortable: Any = built.arm_comfortable if built is not None else None
        self._arm = _Arm(self.upper, self.fore, _numbers(self.T_torso_shoulder))

    def postures(self, target: Any, torso: Array, swivel: Array) -> Array:
        """The 8 postures of each pair (torso, swivel), (n,) [rad] each, the grip at `target`
        (T_world_grip).

        Torso + arm angles (m, 8), in the order of the pairs; pairs out of reach have none. Limits
        are not checked.
        """
        wrist = self.T_world_torso.inverse() * target * self.T_grip_wrist
        cos, sin = np.cos(torso), np.sin(torso)
        unturn = np.zeros((len(torso), 3, 3))
        unturn[:, 0, 0] = cos
        unturn[:, 0, 1] = sin
        unturn[:, 1, 0] = -sin
        unturn[:, 1, 1] = cos
        unturn[:, 2, 2] = 1.0
        to_shoulder = self.T_torso_shoulder.rotation.T
        way = (unturn @ wrist.translation - self.T_torso_shoulder.translation) @ to_shoulder.T
        goal = to_shoulder @ unturn @ wrist.rotation
        reach = np.linalg.norm(way, axis=1)
        ok = np.flatnonzero(
            (reach < self.upper + self.fore - 1e-6) & (reach > abs(self.upper - self.fore) + 1e-6)
        )
        index = np.repeat(ok, len(BRANCHES))
        elbow, shoulder_sign, wrist_sign = np.tile(BRANCHES, (len(ok), 1)).T
        upper_axis, fore_axis, q3 = self._elbow(way[ok], reach[ok], swivel[ok])
        upper_axis, fore_axis, q3 = (
            np.repeat(x, len(BRANCHES), axis=0) for x in (upper_axis, fore_axis, q3)
        )
        q3 = q3 * elbow
        x_axis = (np.cos(q3)[:, None] * upper_axis - fore_axis) / np.sin(q3)[:, None]
        upper_frame = np.stack((x_axis, _cross(upper_axis, x_axis), upper_axis), axis=2)
        y_axis = upper_frame[:, :, 1]
        fore_frame = np.stack((_cross(y_axis, fore_axis), y_axis, fore_axis), axis=2)
        q0, q1, q2 = _zyz(upper_frame, shoulder_sign)
        q4, q5, q6 = _zyz(fore_frame.transpose(0, 2, 1) @ goal[index], wrist_sign)
        return np.stack((torso[index], q0, q1, q2, q3, q4, q5, q6), axis=1)

    def comfortable(
        self, target: Any, torso: Array, swivel: Array, wanted: Wanted, q: Array
    ) -> Array | None:
        """Return the postures (m, 15) of `postures` in which a motion may end, else as q; None
        without a library.
        """
        if self._comfortable is None:
            return None
        wrist = self.T_world_torso.inverse() * target * self.T_grip_wrist
        given = np.array((torso, swivel), dtype=np.float64), np.array(q, dtype=np.float64)
        found = np.empty((len(BRANCHES) * len(torso), len(q)))
        (torsos, swivels), other = given
        arrays = [ctypes.c_void_p(array.ctypes.data) for array in (torsos, swivels, other, found)]
        which = ctypes.byref(self._arm), ctypes.byref(wanted.itself)
        return found[
            : self._comfortable(*which, _numbers(wrist), ctypes.c_int(len(torso)), *arrays)
        ]

    def _elbow(self, way: Array, reach: Array, swivel: Array) -> tuple[Array, Array, Array]:
        """Return directions of upper arm and forearm (n, 3) in the shoulder frame, and elbow angle
        (n,), positive.
        """
        a, b = self.upper, self.fore
        along = way / reach[:, None]
        side = _cross(along, np.array([[0.0, 0.0, 1.0]]))
        # wrist straight above the shoulder: any reference will do
        thin = np.linalg.norm(side, axis=1) < 1e-6
        side[thin] = np.array([1.0, 0.0, 0.0])
        side /= np.linalg.norm(side, axis=1)[:, None]
        outwards = np.cos(swivel)[:, None] * side + np.sin(swivel)[:, None] * _cross(along, side)
        cos = (a * a + reach * reach - b * b) / (2.0 * a * reach)
        upper_axis = cos[:, None] * along + np.sqrt(1.0 - cos * cos)[:, None] * outwards
        fore_axis = (way - a * upper_axis) / b
        return upper_axis, fore_axis, np.arccos((reach * reach - a * a - b * b) / (2.0 * a * b))


# --- Inverse kinematics of a grip -----------------------------------------------------------------


Accept = Callable[[Array], bool]
First = Callable[[Array], int | None]
"""Of postures (n, 15), in order: the number of the first that is accepted."""

# rad: distance of end postures from the torso's limit of 1.57 (trial runs: turning back needs room)
TORSO_END = 1.3
END_MARGIN = 0.08  # rad from every limit of the arm at the end of a motion (trial runs)
_STAY_INSIDE = 0.03  # rad: iterations are clipped this far inside the limits
# of J J^T; small enough to reach 0.5 mm, large enough to pass the elbow's singularity
_DAMPING = 1e-4
_LARGEST_TURN = 0.35  # rad a joint may move in one iteration
_LARGEST_ERROR = 0.25  # m and rad: targets farther away are approached in parts
# comfort per second of travel: 8 s outweigh a third of a radian from a limit (estimate)
_A_SECOND = 0.04
_TOLERANCE = (5e-4, 2e-3)  # m and rad, of each axis
_ON_A_LINE = 15  # iterations from one pose of a line to the next
_TRIED = 200  # torsos and elbows, until a pose counts as out of reach (estimate)
_JUMP = 0.25  # rad between neighbours of a line: more means that the elbow flipped


class PathBlocked(Exception):
    """A straight line of the grip cannot be followed to its end; `q` is the first configuration
    that failed.
    """

    def __init__(self, reason: str, q: Array, fraction: float) -> None:
        self.reason, self.q, self.fraction = reason, q, fraction
        super().__init__(
            f"the line of the grip ends at {100 * fraction:.0f} % of its length: {reason}"
        )


def solve(
    robot: Robot,
    side: str,
    target: Any,
    q: Array,
    *,
    columns: Columns | None = None,
    iterations: int = 45,
) -> Array | None:
    """Return q with the grip of `side` at `target`, reached from q by moving only `columns` (torso
    + arm by default).

    The result is a new array at least 0.03 rad inside the
    limits, or None.
    """
    columns = names.COLUMNS[side] if columns is None else columns
    if not all(map(math.isfinite, q.tolist())):
        return None
    return robot.chain[side].solve(target, q, _limits(robot, tuple(columns), iterations))


@lru_cache(maxsize=64)
def _limits(robot: Robot, columns: tuple[int, ...], iterations: int) -> Limits:
    numbers = (iterations, *_TOLERANCE, _DAMPING, _LARGEST_TURN, _LARGEST_ERROR)
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
    """Configurations, q first, whose grip goes straight to `target`, at most `step` [m] and 0.06
    rad apart.

    Only `columns` move (the 7 joints of the arm by default). Raises `PathBlocked` with the reason
    "reach" (no solution), "jump" (a joint would move over 0.25 rad in one step) or "collision"
    (`accept` said no).
    """
    columns = names.ARM[side] if columns is None else columns
    start = robot.grip(q, side)
    length = float(np.linalg.norm(target.translation - start.translation))
    turn = float(np.linalg.norm(pin.log3(target.rotation @ start.rotation.T)))
    count = max(2, int(max(length / step, turn / 0.06)))
    limits = _limits(robot, tuple(columns.tolist()), _ON_A_LINE)
    solved, jumps = robot.chain[side].line(start, target, count, q, limits, _JUMP)
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


def lines(
    robot: Robot, side: str, q: Array, poses: Iterable[Any], accept: Accept
) -> list[Array] | None:
    """Return q and the configurations after it on straight `line`s through grip poses; None if one
    is blocked.
    """
    path = [q]
    try:
        for pose in poses:
            path += line(robot, side, path[-1], pose, accept=accept)[1:]
    except PathBlocked:
        return None
    return path


def _inside(polygon: Array, x: Array, y: Array) -> Any:
    """Return which points (n,) are inside the polygon (corners, 2): an odd number of edges is to
    the right of each.
    """
    x0, y0 = polygon.T[:, :, None]
    x1, y1 = np.concatenate((polygon[1:], polygon[:1])).T[:, :, None]
    crosses = (y0 > y) != (y1 > y)
    at = (x1 - x0) * (y - y0) / (y1 - y0) + x0
    return np.count_nonzero(crosses & (x < at), axis=0) % 2 == 1


def _to_limit(robot: Robot, arm: Array, side: str) -> Array:
    """Distance [rad] of arms (n, 7) to the nearest limit, (n,)."""
    columns = names.ARM[side]
    return np.asarray(
        np.minimum(arm - robot.lower[columns], robot.upper[columns] - arm).min(axis=1)
    )


def _to_singular(arm: Array) -> Array:
    """Distance [rad] of arms (n, 7) to the nearest straight shoulder, elbow or wrist, (n,)."""
    return np.asarray(np.abs(arm[:, 1::2]).min(axis=1))


def margin(robot: Robot, q: Array, side: str) -> tuple[float, float]:
    """Return distance [rad] of the arm to its nearest limit, and of joints 1, 3, 5 to zero, where
    they are singular.
    """
    arm = q[None, names.ARM[side]]
    return float(_to_limit(robot, arm, side)[0]), float(_to_singular(arm)[0])


def _comfortable(robot: Robot, arm: Array, torso: Array, side: str) -> Any:
    fits = (_to_limit(robot, arm, side) >= END_MARGIN) & (np.abs(torso) <= TORSO_END)
    # of few: the polygon takes longest
    fits[fits] = _inside(names.WRIST_POLYGON[side], *arm[fits, 5:].T)
    return fits


def comfortable(robot: Robot, q: Array, side: str) -> bool:
    """Whether a motion may end in q: 0.08 rad from limits, wrist pair allowed, torso within 1.3
    rad.
    """
    return bool(_comfortable(robot, q[None, names.ARM[side]], q[None, names.TORSO], side)[0])


def comfort(robot: Robot, q: Array, side: str) -> Array:
    """Return the comfort of configurations (n, 15), larger is better: far from limits and
    singularities, torso ahead.

    The weights are those that chose grasps in the trial runs.
    """
    arm = q[:, names.ARM[side]]
    to_limit, to_singular = _to_limit(robot, arm, side), _to_singular(arm)
    return (
        np.minimum(to_limit, 0.5)
        + 0.5 * np.minimum(to_singular, 0.4)
        - 0.25 * np.abs(q[:, names.TORSO])
    )


def travel(robot: Robot, side: str, q: Array, goals: Array) -> Array:
    """Return the least time (n,) [s] of torso and arm from q to each of `goals` (n, 15), at half
    their speed limits.
    """
    columns = names.COLUMNS[side]
    return np.asarray(
        (np.abs(goals[:, columns] - q[columns]) / (0.5 * robot.speed[columns])).max(axis=1)
    )


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
    """Return comfortable configurations (m, 15) with the grip at `target`, of `starts` random
    torsos and elbows.

    The other arm keeps its joints of q. `torso` [rad] is a range, or one angle to keep. Collisions
    are not checked.
    """
    turned = (
        np.full(starts, torso) if isinstance(torso, (int, float)) else rng.uniform(*torso, starts)
    )
    swivel = rng.uniform(-np.pi, np.pi, starts)
    ended = geometry(robot, side).comfortable(target, turned, swivel, _wanted(robot, side), q)
    if ended is not None:
        return ended
    found = geometry(robot, side).postures(target, turned, swivel)
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


def reachable(robot: Robot, side: str, target: Any, rng: np.random.Generator) -> bool:
    """Whether the grip can be at `target` at all, within the limits of `solve`, for one of
    `_TRIED` torsos and elbows.

    Where a fiftieth of all torsos and elbows does, one in fifty is missed. Collisions are not
    checked.
    """
    columns = names.COLUMNS[side]
    lower, upper = robot.lower[columns] + _STAY_INSIDE, robot.upper[columns] - _STAY_INSIDE
    torso, swivel = rng.uniform(lower[0], upper[0], _TRIED), rng.uniform(-np.pi, np.pi, _TRIED)
    found = geometry(robot, side).postures(target, torso, swivel)
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

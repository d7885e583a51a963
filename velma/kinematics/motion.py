"""Free motions of one arm and the torso: from a posture to another without contact.

A straight line of the joints if that is free, else random trees (OMPL) between the ends drawn back.
The path is shortened, rounded, timed, and checked again as timed: a smoothed path that was not once
hooked an arm at the cabinet. Iterations are counted and random numbers seeded, so equal arguments
give equal results.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from velma import names, ranges
from velma.kinematics.backing import drawn_back, out_of_touch
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.kinematics.timing import JOINT_FRACTION, Trajectory, dense, timed
from velma.names import Array

# --- Search of a path between two postures by OMPL's RRTConnect, limited by iterations and
# repeatable by its seed
# Knows neither robot nor scene: only bounds, and whether a posture is allowed.


# also silences "changing seed": samples after `setSeed` follow the new seed
ou.setLogLevel(ou.LOG_NONE)

RANGE = 0.6  # rad that one extension of the tree may go (trial runs)
# rad between states that are checked on an edge; whole motions are checked more finely later
CHECKED = 0.1


class _Counted:
    """Makes the planner stop after a number of calls."""

    def __init__(self, iterations: int) -> None:
        self.left = iterations

    def __call__(self) -> bool:
        self.left -= 1
        return self.left < 0


def grow(
    allowed: Callable[[Array], bool],
    start: Array,
    goal: Array,
    lower: Array,
    upper: Array,
    *,
    iterations: int,
    seed: int,
) -> list[Array] | None:
    """Return postures from `start` to `goal`, all (n,) within bounds, whose straight connections
    are allowed, or None.

    Equal arguments give equal results, whatever was planned before.
    """
    ou.RNG.setSeed(1 + seed % (2**31 - 2))  # 0 would mean a seed from the clock
    space = ob.RealVectorStateSpace(len(start))
    space.setBounds(_tree_bounds(lower, upper))
    information = ob.SpaceInformation(space)
    dimensions = range(len(start))
    information.setStateValidityChecker(
        lambda state: bool(allowed(np.array([state[i] for i in dimensions])))
    )
    information.setStateValidityCheckingResolution(CHECKED / space.getMaximumExtent())
    information.setup()
    problem = ob.ProblemDefinition(information)
    problem.setStartAndGoalStates(_state(space, start), _state(space, goal))
    planner = og.RRTConnect(information)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(ob.PlannerTerminationCondition(_Counted(iterations)))
    if not problem.hasExactSolution():
        return None
    path = problem.getSolutionPath()
    states = [path.getState(k) for k in range(path.getStateCount())]
    return [np.array([state[i] for i in dimensions]) for state in states]


def _tree_bounds(lower: Array, upper: Array) -> Any:
    bounds = ob.RealVectorBounds(len(lower))
    for k, (low, high) in enumerate(zip(lower, upper, strict=True)):
        bounds.setLow(k, float(low))
        bounds.setHigh(k, float(high))
    return bounds


def _state(space: Any, values: Array) -> Any:
    state = space.allocState()
    for k, value in enumerate(values):
        state[k] = float(value)
    return state


# --- A path made shorter and rounder: shortcuts of all joints or of one, then moving averages along
# the path
# A path is an array (n, m) of postures, neighbours at most `STEP` apart. Condition, cost and random
# generator are arguments.


Allowed = Callable[
    [Array], bool
]  # of postures (n, m), in the order in which they are looked at: whether all are allowed
Cost = Callable[[Array], Array]  # of postures (n, m): what each of the n - 1 steps costs

STEP = 0.05  # rad between checked states
_TRIES, _PATIENCE = 200, 50  # shortcuts tried, and failures in a row after which to stop
_GAIN = 1e-3  # s: the least gain that counts
# share of shortcuts that straighten a single joint, such as a torso that turns back and forth
_ONE_JOINT = 0.5
_WINDOWS = (17, 9, 5)  # points of 0.05 rad averaged, widest first


@lru_cache(maxsize=512)
def halving(count: int) -> names.Columns:
    """Return 0 .. count - 1, the middle first, then those of the halves, so that a blocked path is
    found early.
    """
    ranges: list[tuple[int, int]] = [(0, count)]
    order: list[int] = []
    for low, high in ranges:
        if low < high:
            middle = (low + high) // 2
            order.append(middle)
            ranges += [(low, middle), (middle + 1, high)]
    return np.array(order, dtype=np.intp)


def clear(allowed: Allowed, states: Array) -> bool:
    """Whether all states (n, m) are allowed."""
    return allowed(states[halving(len(states))])


def shortened(path: Array, allowed: Allowed, cost: Cost, rng: np.random.Generator) -> Array:
    """Return the path with all random shortcuts that reduce its cost."""
    costs, vain = cost(path), 0
    for _ in range(_TRIES):
        if len(path) < 3 or vain >= _PATIENCE:
            break
        first, last = (int(k) for k in np.sort(rng.integers(len(path), size=2)))
        vain += 1
        if last - first < 2:
            continue
        piece = path[first : last + 1]
        alone = rng.random() < _ONE_JOINT
        straight = _one_joint(piece, rng) if alone else dense(piece[[0, -1]], STEP)
        new = cost(straight)
        if new.sum() < costs[first:last].sum() - _GAIN and clear(allowed, straight[1:-1]):
            path = np.concatenate((path[:first], straight, path[last + 1 :]))
            costs, vain = np.concatenate((costs[:first], new, costs[last:])), 0
    return dense(path, STEP)


def _one_joint(piece: Array, rng: np.random.Generator) -> Array:
    """Return the piece with one joint moving evenly from first to last value: often the first
    joint, the slowest.
    """
    joint = 0 if rng.random() < 0.3 else int(rng.integers(piece.shape[1]))
    changed = piece.copy()
    changed[:, joint] = np.linspace(piece[0, joint], piece[-1, joint], len(piece))
    return changed


def rounder(path: Array) -> Iterator[Array]:
    """Yield the path with its corners rounded, less and less, at last unchanged; ends stay."""
    for window in _WINDOWS:
        half = window // 2
        ends = (np.tile(path[:1], (half, 1)), path, np.tile(path[-1:], (half, 1)))
        sums = np.cumsum(np.concatenate((np.zeros((1, path.shape[1])), *ends)), axis=0)
        averaged = (sums[window:] - sums[:-window]) / window
        averaged[0], averaged[-1] = path[0], path[-1]
        yield averaged
    yield path


# --- Free motions of one arm and the torso --------------------------------------------------------


Keep = Callable[[Array], Array]
"""Of postures (n, 15): whether each fulfils a condition (n,)."""

# of a tree; half of those that succeed need 50, all under 3500 (task of benchmarks/kinematics.py)
ITERATIONS = 4000
ATTEMPTS = 4  # trees; the quickest path is kept (trial runs)
PATIENCE = 10_000  # collision checks after which the search ends, if there is a path
TOOL_SPEED = 0.25  # m/s: tool speed for comparing the times of motions
GOOD_ENOUGH = 1.2  # times the duration of the straight line: good enough to stop (trial runs)
CHECK_S = 0.04  # between checked states of the timed motion (trial runs)
SPARE_M = 0.002  # additional distance during the search, used up by rounding (estimate)
_INSIDE = 0.02  # rad: trees stay this far inside the limits
_TORSO = 1.3  # rad: trees keep the torso away from its limit
# rad: how far beyond its ends first trees turn the torso, which is four times slower than an arm
# (estimate)
_WANDER = 0.4


@dataclass(frozen=True)
class Motion:
    """A free motion: postures (15,) [rad], at most 0.05 rad apart, and the time [s] that it
    takes.
    """

    path: list[Array]
    duration: float


@dataclass(frozen=True)
class _Task:
    """Torso + one arm between two postures; vectors of 8 stand for q with all other joints as at
    the start.
    """

    robot: Robot
    world: World
    side: str
    start: Array
    goal: Array
    keep: Keep | None
    tool_speed: float
    columns: names.Columns

    def whole(self, joints: Array) -> Array:
        """Return q (15,) of torso + arm (8,)."""
        q = self.start.copy()
        q[self.columns] = joints
        return q

    def accepts(self, q: Array) -> bool:
        """Whether a posture (15,) is allowed."""
        return (self.keep is None or bool(self.keep(q[None])[0])) and self.world.free(q)

    def accepts_all(self, postures: Array) -> bool:
        """Whether all postures (n, 15) are allowed; none is looked at after one that is not."""
        if self.keep is None:
            return self.world.all_free(postures)
        kept = self.keep(postures)
        upto = len(kept) if kept.all() else int(kept.argmin())
        return self.world.all_free(postures[:upto]) and upto == len(kept)

    def allowed(self, joints: Array) -> bool:
        """Whether torso + arm (8,) may be there."""
        return self.accepts(self.whole(joints))

    def all_allowed(self, path: Array) -> bool:
        """Whether torso + arm may be at all places (n, 8), as `accepts_all` says."""
        return self.accepts_all(self.wholes(path))

    def wholes(self, path: Array) -> Array:
        """Return the postures (n, 15) of torso + arm (n, 8)."""
        postures = np.tile(self.start, (len(path), 1))
        postures[:, self.columns] = path
        return postures

    def cost(self, path: Array) -> Array:
        """Return seconds (n - 1,) that joints and tool need for each step of a path (n, 8), without
        accelerations.
        """
        speed = JOINT_FRACTION * self.robot.speed[self.columns]
        chain = self.robot.chain[self.side]
        return chain.times(self.start, path, self.columns, self.tool_speed, speed)

    def timed(self, path: Array) -> Trajectory:
        """Return the timed motion along a path (n, 8)."""
        return timed(self.robot, list(self.wholes(path)), tool_speed=self.tool_speed)

    def free_in_time(self, trajectory: Trajectory) -> bool:
        """Whether all states of a motion are allowed, `CHECK_S` apart."""
        every = max(1, round(CHECK_S / trajectory.dt))
        return clear(self.accepts_all, trajectory.q[::every])


def plan(
    robot: Robot,
    world: World,
    side: str,
    start: Array,
    goal: Array,
    *,
    keep: Keep | None = None,
    iterations: int = ITERATIONS,
    seed: int = 0,
    attempts: int = ATTEMPTS,
    tool_speed: float = TOOL_SPEED,
) -> Motion | None:
    """Return a motion from `start` to `goal`, postures (15,) [rad], or None if no path was found.

    Torso and the arm of `side` move, all else stays as at `start`; `keep` holds on the whole path.
    The path timed with `tool_speed` [m/s] and the usual limits is free of collisions, except for
    its start if that is in contact: a straight line leads out of it. Each tree has `iterations`; of
    up to `attempts` trees the quickest path is returned. Equal arguments and worlds give equal
    paths. Raises MotionError for a goal beyond limits of joints, or farther beyond than the start,
    and for a speed out of its range.
    """
    columns = names.COLUMNS[side]
    ranges.number("tool_speed", tool_speed, ranges.SLOWEST_TOOL, ranges.FASTEST_TOOL)
    begin = ranges.joints("start", [start])[0]
    goal = ranges.joints("goal", [goal], start=begin)[0]
    aside = out_of_touch(robot, world, side, begin.copy())
    last = aside[-1].copy()
    last[columns] = goal[columns]
    task = _Task(robot, world, side, aside[-1], last, keep, tool_speed, columns)
    found = _way(task, iterations, seed, attempts)
    if found is None:
        return None
    way, duration = found
    out = dense([q[columns] for q in aside], STEP)[:-1]
    if len(out):
        way = np.concatenate((out, way))
        duration = task.timed(way).duration
    return Motion(list(task.wholes(way)), duration)


def _way(task: _Task, iterations: int, seed: int, attempts: int) -> tuple[Array, float] | None:
    """Return a path (n, 8) between two free postures, and its duration [s]: straight, or the
    quickest of some trees.
    """
    first, last, columns = task.start, task.goal, task.columns
    if not (task.accepts(first) and task.accepts(last)):
        return None
    straight = dense([first[columns], last[columns]], STEP)
    if clear(task.all_allowed, straight[1:-1]):
        through = task.timed(straight)
        if task.free_in_time(through):
            return straight, through.duration
    return _quickest(task, iterations, seed, attempts, straight)


def _quickest(
    task: _Task, iterations: int, seed: int, attempts: int, straight: Array
) -> tuple[Array, float] | None:
    """Return the quickest of some paths (n, 8), and its duration; enough is one hardly slower than
    a straight one.
    """
    margin, begun = task.world.margin, task.world.checks
    best, enough = None, None
    try:
        task.world.margin = margin + SPARE_M
        if not (task.accepts(task.start) and task.accepts(task.goal)):
            task.world.margin = margin
        spared = task.world.margin
        for number, way in enumerate(_ways(task, iterations, seed, attempts)):
            rng = np.random.default_rng([seed, number])
            short = shortened(way, task.all_allowed, task.cost, rng)
            task.world.margin = margin
            found = _in_time(task, short)
            task.world.margin = spared
            if found is not None and (best is None or found[1] < best[1]):
                best = found
            if best is None:
                continue
            if enough is None:
                enough = GOOD_ENOUGH * task.timed(straight).duration
            if best[1] <= enough or task.world.checks - begun > PATIENCE:
                break
    finally:
        task.world.margin = margin
    return best


def _in_time(task: _Task, way: Array) -> tuple[Array, float] | None:
    """Return the path as round as is free when timed, with its duration [s]."""
    for path in rounder(way):
        if not clear(task.all_allowed, path[1:-1]):
            continue
        trajectory = task.timed(path)
        if task.free_in_time(trajectory):
            return dense(path, STEP), trajectory.duration
    return None


def _ways(task: _Task, iterations: int, seed: int, attempts: int) -> Iterator[Array]:
    """Yield allowed paths (n, 8) by trees between the ends with the hand drawn back."""
    columns = task.columns
    out = np.array(drawn_back(task.robot, task.side, task.start, task.accepts))[:, columns]
    into = np.array(drawn_back(task.robot, task.side, task.goal, task.accepts))[::-1, columns]
    ends = np.array([out[-1], into[0]])
    for attempt in range(attempts):
        number = 64 * seed + attempt
        for wander in (_WANDER, 2 * _TORSO):
            lower, upper = _bounds(task, ends, wander)
            found = grow(
                task.allowed, out[-1], into[0], lower, upper, iterations=iterations, seed=number
            )
            if found is not None:
                yield dense([*out[:-1], *found, *into[1:]], STEP)
                break
        else:
            return  # another tree of the same size would hardly be better


def _bounds(task: _Task, ends: Array, wander: float) -> tuple[Array, Array]:
    """Return the bounds of the trees: inside the limits, the torso `wander` beyond the ends (2,
    8).
    """
    lower = task.robot.lower[task.columns] + _INSIDE
    upper = task.robot.upper[task.columns] - _INSIDE
    lower[0] = max(-_TORSO, ends[:, 0].min() - wander)
    upper[0] = min(_TORSO, ends[:, 0].max() + wander)
    return np.minimum(lower, ends.min(axis=0)), np.maximum(upper, ends.max(axis=0))

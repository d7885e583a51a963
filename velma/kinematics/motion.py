"""Free motions of one arm and the torso: from a posture to another without touching anything.

Straight in the joints where that is free, else by random trees (OMPL) between the ends drawn back. What comes out has
been shortened, rounded, put in time and checked in time: a smoothed path that was only checked as a path once hooked an
arm at the cabinet. All is counted and seeded, so the same question has the same answer.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from velma import names
from velma.kinematics.backing import drawn_back, out_of_touch
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.kinematics.shortening import STEP, clear, rounder, shortened
from velma.kinematics.timing import JOINT_FRACTION, NotTimed, Trajectory, dense, timed
from velma.kinematics.tree import grow
from velma.names import Array

Keep = Callable[[Array], bool]

ITERATIONS = 4000  # of a tree; half of those that arrive need 50, all under 3500 (task of benchmarks/kinematics.py)
ATTEMPTS = 4  # trees, the quickest way is kept (trial runs)
PATIENCE = 10_000  # collision checks after which no further way is looked for, once there is one
TOOL_SPEED = 0.25  # m/s: what a motion's time is judged by
GOOD_ENOUGH = 1.2  # times as long as straight through everything: no further attempt (trial runs)
CHECK_S = 0.04  # between checked states of the timed motion (trial runs)
SPARE_M = 0.002  # more distance while a way is looked for, lost again where it is rounded (estimate)
_INSIDE = 0.02  # rad: trees stay this far inside the limits
_TORSO = 1.3  # rad: trees keep the torso away from its limit
_WANDER = 0.4  # rad: first trees turn the torso, four times slower than an arm, so far beyond its ends (estimate)


@dataclass(frozen=True)
class _Task:
    """Torso + one arm between two postures; vectors of 8 stand for q with all other joints as at the start."""

    robot: Robot
    world: World
    side: str
    start: Array
    goal: Array
    keep: Keep | None
    tool_speed: float
    columns: names.Columns

    def whole(self, joints: Array) -> Array:
        """q (15,) of torso + arm (8,)."""
        q = self.start.copy()
        q[self.columns] = joints
        return q

    def accepts(self, q: Array) -> bool:
        """The condition first: it is cheaper than a collision check."""
        return (self.keep is None or self.keep(q)) and self.world.free(q)

    def allowed(self, joints: Array) -> bool:
        """Whether torso + arm (8,) may be there."""
        return self.accepts(self.whole(joints))

    def cost(self, path: Array) -> Array:
        """Seconds (n - 1,) that joints and tool need for each step of a path (n, 8), without accelerations."""
        postures = np.tile(self.start, (len(path), 1))
        postures[:, self.columns] = path
        moved = np.linalg.norm(np.diff(self.robot.track(postures, self.side), axis=0), axis=1) / self.tool_speed
        turned = np.abs(np.diff(path, axis=0)) / (JOINT_FRACTION * self.robot.speed[self.columns])
        return np.asarray(np.maximum(moved, turned.max(axis=1)))

    def timed(self, path: Array) -> Trajectory | None:
        """The motion along a path (n, 8), if it has one."""
        try:
            return timed(self.robot, [self.whole(v) for v in path], tool_speed=self.tool_speed)
        except NotTimed:
            return None

    def free_in_time(self, trajectory: Trajectory | None) -> bool:
        """Whether all states of a motion are allowed, `CHECK_S` apart."""
        if trajectory is None:
            return False
        every = max(1, round(CHECK_S / trajectory.dt))
        return clear(self.accepts, trajectory.q[::every])


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
) -> list[Array] | None:
    """Postures (15,) [rad] from `start` to `goal`, at most 0.05 rad apart, or None where no way was found.

    Torso and the arm of `side` move, all else stays as at `start`; `keep(q)` has to hold all the way. The way timed
    with `tool_speed` [m/s] and the usual limits is free of collisions, but for its beginning where the start is not:
    that is a straight line out of touch. Each tree is given `iterations`, and of up to `attempts` trees the quickest
    way is returned; the same arguments and world give the same way.
    """
    columns = names.COLUMNS[side]
    aside = out_of_touch(robot, world, side, np.array(start, dtype=np.float64))
    last = aside[-1].copy()
    last[columns] = goal[columns]
    task = _Task(robot, world, side, aside[-1], last, keep, tool_speed, columns)
    way = _way(task, iterations, seed, attempts)
    if way is None:
        return None
    out = dense([q[columns] for q in aside], STEP)[:-1]
    return [task.whole(v) for v in (*out, *way)]


def _way(task: _Task, iterations: int, seed: int, attempts: int) -> Array | None:
    """A way (n, 8) between two free postures: straight, or the quickest of some trees."""
    first, last, columns = task.start, task.goal, task.columns
    if not (task.accepts(first) and task.accepts(last)):
        return None
    straight = dense([first[columns], last[columns]], STEP)
    through = task.timed(straight)
    if task.free_in_time(through):
        return straight
    enough = GOOD_ENOUGH * through.duration if through is not None else 0.0
    return _quickest(task, iterations, seed, attempts, enough)


def _quickest(task: _Task, iterations: int, seed: int, attempts: int, enough: float) -> Array | None:
    """The quickest of some ways (n, 8); no more are looked at once one takes at most `enough` [s]."""
    margin, begun = task.world.margin, task.world.checks
    best, shortest = None, np.inf
    try:
        task.world.margin = margin + SPARE_M
        if not (task.accepts(task.start) and task.accepts(task.goal)):
            task.world.margin = margin
        spared = task.world.margin
        for number, way in enumerate(_ways(task, iterations, seed, attempts)):
            short = shortened(way, task.allowed, task.cost, np.random.default_rng([seed, number]))
            task.world.margin = margin
            found = _in_time(task, short)
            task.world.margin = spared
            if found is not None and found[1] < shortest:
                best, shortest = found
            if shortest <= enough or (best is not None and task.world.checks - begun > PATIENCE):
                break
    finally:
        task.world.margin = margin
    return best


def _in_time(task: _Task, way: Array) -> tuple[Array, float] | None:
    """A way as round as is free in time, with its duration [s]."""
    for path in rounder(way):
        trajectory = task.timed(path)
        if trajectory is not None and task.free_in_time(trajectory):
            return dense(path, STEP), trajectory.duration
    return None


def _ways(task: _Task, iterations: int, seed: int, attempts: int) -> Iterator[Array]:
    """Allowed ways (n, 8) by trees between the ends with the hand drawn back."""
    columns = task.columns
    out = np.array(drawn_back(task.robot, task.side, task.start, task.accepts))[:, columns]
    into = np.array(drawn_back(task.robot, task.side, task.goal, task.accepts))[::-1, columns]
    ends = np.array([out[-1], into[0]])
    for attempt in range(attempts):
        number = 64 * seed + attempt
        for wander in (_WANDER, 2 * _TORSO):
            lower, upper = _bounds(task, ends, wander)
            found = grow(task.allowed, out[-1], into[0], lower, upper, iterations=iterations, seed=number)
            if found is not None:
                yield dense([*out[:-1], *found, *into[1:]], STEP)
                break
        else:
            return  # another tree of the same size would hardly do better


def _bounds(task: _Task, ends: Array, wander: float) -> tuple[Array, Array]:
    """Where trees may grow: inside the limits, the torso `wander` beyond the ends (2, 8), which are always inside."""
    lower, upper = task.robot.lower[task.columns] + _INSIDE, task.robot.upper[task.columns] - _INSIDE
    lower[0], upper[0] = max(-_TORSO, ends[:, 0].min() - wander), min(_TORSO, ends[:, 0].max() + wander)
    return np.minimum(lower, ends.min(axis=0)), np.maximum(upper, ends.max(axis=0))

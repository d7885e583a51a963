"""Free motions of one arm and the torso: from a posture to another without touching anything.

Straight in the joints where that is free; else over a posture that often helps; else by a random tree (OMPL). What
comes out has been shortened, rounded, put in time and checked in time: a smoothed path that was only checked as a path
once hooked an arm at the cabinet. All is counted and seeded, so the same question has the same answer.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from velma import names
from velma.kinematics.collision import World
from velma.kinematics.robot import Robot
from velma.kinematics.shortening import STEP, clear, rounder, shortened
from velma.kinematics.timing import JOINT_FRACTION, NotTimed, Trajectory, dense, timed
from velma.kinematics.tree import grow
from velma.names import Array

Keep = Callable[[Array], bool]

ITERATIONS = 4000  # of a tree; it needs 50 to 500 where there is a way (benchmarks/kinematics.py)
ATTEMPTS = 4  # trees grown, the quickest motion is kept (trial runs)
TOOL_SPEED = 0.25  # m/s: what a motion's time is judged by
GOOD_ENOUGH = 1.2  # times as long as straight through everything: no further attempt (trial runs)
CHECK_S = 0.04  # between checked states of the timed motion (trial runs)
_INSIDE = 0.02  # rad: trees stay this far inside the limits
_TORSO = 1.3  # rad: trees keep the torso away from its limit
_SLOWEST = 2.0  # largest scale: the torso counts at most twice as much as a joint of the arm
_KEPT_RANGE = 0.3  # scaled rad: shorter branches where a condition leaves little room


@dataclass(frozen=True)
class _Task:
    """Torso + one arm between two postures; vectors of 8 stand for q with all other joints as at the start."""

    robot: Robot
    world: World
    side: str
    start: Array
    keep: Keep | None
    tool_speed: float

    def whole(self, joints: Array) -> Array:
        """q (15,) of torso + arm (8,)."""
        q = self.start.copy()
        q[names.COLUMNS[self.side]] = joints
        return q

    def allowed(self, joints: Array) -> bool:
        """The condition first: it is cheaper than a collision check."""
        q = self.whole(joints)
        return (self.keep is None or self.keep(q)) and self.world.free(q)

    def cost(self, path: Array) -> Array:
        """Seconds (n - 1,) that joints and tool need for each step of a path (n, 8), without accelerations."""
        joints = JOINT_FRACTION * self.robot.speed[names.COLUMNS[self.side]]
        places = np.array([self.robot.grip(self.whole(v), self.side).translation for v in path])
        moved = np.linalg.norm(np.diff(places, axis=0), axis=1) / self.tool_speed
        return np.maximum(moved, (np.abs(np.diff(path, axis=0)) / joints).max(axis=1))

    def in_time(self, path: Array) -> Trajectory | None:
        """The timed motion along a path (n, 8), if it is free all the time."""
        try:
            trajectory = timed(self.robot, [self.whole(v) for v in path], tool_speed=self.tool_speed)
        except NotTimed:
            return None
        every = max(1, round(CHECK_S / trajectory.dt))
        free = clear(self.allowed, trajectory.q[::every, names.COLUMNS[self.side]])
        return trajectory if free else None


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
    with `tool_speed` [m/s] and the usual limits is free of collisions. Each of up to `attempts` trees is given
    `iterations`; the same arguments and world give the same way.
    """
    columns = names.COLUMNS[side]
    task = _Task(robot, world, side, np.array(start), keep, tool_speed)
    first, last = np.array(start)[columns], np.array(goal)[columns]
    if not (task.allowed(first) and task.allowed(last)):
        return None
    straight = dense([first, last], STEP)
    if clear(task.allowed, straight[1:-1]) and task.in_time(straight) is not None:
        return [task.whole(v) for v in straight]
    enough = GOOD_ENOUGH * task.cost(straight).sum()
    best, shortest = None, np.inf
    for number, way in enumerate(_ways(task, first, last, iterations, seed, attempts)):
        found = _finished(task, way, np.random.default_rng([seed, number]))
        if found is not None and found[1] < shortest:
            best, shortest = found
        if shortest < enough:
            break
    return None if best is None else [task.whole(v) for v in best]


def _finished(task: _Task, way: Array, rng: np.random.Generator) -> tuple[Array, float] | None:
    """A way shortened and as round as is free in time, with its duration [s]."""
    for path in rounder(shortened(way, task.allowed, task.cost, rng)):
        trajectory = task.in_time(path)
        if trajectory is not None:
            return dense(path, STEP), trajectory.duration
    return None


def _ways(task: _Task, first: Array, last: Array, iterations: int, seed: int, attempts: int) -> Iterator[Array]:
    """Allowed ways (n, 8): one over helpful postures, if there is, then trees."""
    for over in _helpful(task, first, last):
        way = dense([first, *over, last], STEP)
        if clear(task.allowed, way[1:-1]):
            yield way
            break
    columns = names.COLUMNS[task.side]
    lower, upper = task.robot.lower[columns] + _INSIDE, task.robot.upper[columns] - _INSIDE
    lower[0], upper[0] = max(lower[0], -_TORSO), min(upper[0], _TORSO)
    ends = np.array([first, last])
    lower, upper = np.minimum(lower, ends.min(axis=0)), np.maximum(upper, ends.max(axis=0))
    speed = task.robot.speed[columns]
    scale = np.minimum(speed[1:].mean() / speed, _SLOWEST)
    reach = {} if task.keep is None else {"reach": _KEPT_RANGE}
    for attempt in range(attempts):
        found = grow(
            task.allowed, first, last, lower, upper, scale, iterations=iterations, seed=seed * 64 + attempt, **reach
        )
        if found is None:
            return  # another tree of the same size would hardly do better
        yield dense(found, STEP)


def _helpful(task: _Task, first: Array, last: Array) -> Iterator[Sequence[Array]]:
    """Postures to go over: torso before arm, arm before torso, or with the arm down."""
    rest = names.START[names.ARM[task.side]]
    yield ([np.concatenate((last[:1], first[1:]))])
    yield ([np.concatenate((first[:1], last[1:]))])
    for torso in (last[0], first[0], (first[0] + last[0]) / 2):
        yield ([np.array([torso, *rest])])
    yield ([np.array([first[0], *rest]), np.array([last[0], *rest])])

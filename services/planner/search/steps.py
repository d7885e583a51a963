"""What the primitive tasks of the domain come to: robot commands, the changes they make, and the time they take.

Each step asks km for what it needs in the state it begins in, computes the geometry, and returns a Step; None where
no geometry was found, with the reason noted in `why`. Speeds and distances: task runs with the true robot model.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from companion.languages import rc, wm
from companion.languages.values import Side
from services.planner.search.asking import Asking
from services.planner.search.situation import Situation, configured, on_wire, situation
from velma import names
from velma.kinematics import motion
from velma.kinematics.frames import transform
from velma.kinematics.robot import Robot
from velma.kinematics.tasks.carrying import upright
from velma.kinematics.timing import JOINT_FRACTION, timed

EMPTY_SPEED, LOADED_SPEED = 0.35, 0.25  # [m/s] of the tool in free motions
APPROACH_SPEED, LIFT_SPEED, DOWN_SPEED, RETREAT_SPEED = 0.2, 0.1, 0.04, 0.15  # [m/s]
TRIED, ENOUGH = 8, 3  # estimate: more goals make motions little quicker and planning slower
# Iterations of a tree: most ways are found in some hundreds (benchmarks/kinematics.py), so all goals get few before any
# gets many; trees grown for a goal.
QUICK, EFFORTS, ATTEMPTS = (500,), (500, 4000), 2
CLOSE_S, OPEN_S = 4.0, 2.5  # [s] a hand takes to close by touch and to open; only for the expected duration


@dataclass(frozen=True)
class Step:
    """Commands of one primitive task (their keys still empty), changes to the state, expected duration [s]."""

    name: str
    commands: tuple[rc.Act, ...]
    changes: tuple[wm.AnyChange, ...]
    duration: float


@dataclass
class Geometry:
    """What every step computes with: the robot, the way to ask km, seeded chance, and why the last attempts failed."""

    robot: Robot
    ask: Asking
    seed: int
    why: list[str] = field(default_factory=list)

    def rng(self, *words: str) -> np.random.Generator:
        """Chance that depends on the request's seed and on what is attempted, not on the order of attempts."""
        return np.random.default_rng([self.seed, *(int.from_bytes(w.encode()[:24], "little") % 2**63 for w in words)])

    def at(self, state: str) -> Situation:
        """The situation in a state of km."""
        return situation(self.ask, self.robot, state)

    def failed(self, reason: str) -> None:
        """Note why this attempt gave nothing."""
        self.why.append(reason)

    def free_motion(
        self,
        here: Situation,
        side: Side,
        goals: Sequence[np.ndarray],
        *,
        largest_tilt: float | None = None,
        tried: int = TRIED,
        enough: int = ENOUGH,
        efforts: Sequence[int] = EFFORTS,
    ) -> tuple[int, list[np.ndarray]] | None:
        """Index of a goal and the joint path to it: the quickest of the first `enough` found among the `tried` nearest.

        A held object stays within `largest_tilt` [rad] of the vertical.
        """
        keep: Callable[[np.ndarray], bool] | None = None
        if largest_tilt is not None and side in here.held:
            keep = upright(self.robot, side, here.held[side].T_grip_object, largest_tilt)
        speed = LOADED_SPEED if here.loaded() else EMPTY_SPEED
        least = [least_time(here.q, goal) for goal in goals]
        for effort in efforts:
            found: list[tuple[float, int, list[np.ndarray]]] = []
            for index in np.argsort(least, kind="stable")[:tried]:
                if found and least[index] > min(f[0] for f in found):
                    break
                path = motion.plan(
                    self.robot, here.world, side, here.q, goals[index],
                    keep=keep, seed=self.seed, tool_speed=speed, iterations=effort, attempts=ATTEMPTS,
                )  # fmt: skip
                if path is not None:
                    found.append((self.duration(path, speed), int(index), path))
                if len(found) == enough:
                    break
            if found:
                return min(found, key=lambda f: f[0])[1:]
        return None

    def duration(self, path: list[np.ndarray], speed: float) -> float:
        """Time [s] of a joint path at a tool speed [m/s]."""
        return float(timed(self.robot, path, tool_speed=speed).duration) if len(path) > 1 else 0.0


def least_time(start: np.ndarray, goal: np.ndarray) -> float:
    """Time [s] below which no motion from start to goal (15,) can be, at half the joints' speed limits."""
    return float((np.abs(goal - start) / names.SPEED).max() / JOINT_FRACTION)


def along(side: Side, path: list[np.ndarray]) -> tuple[tuple[float, ...], ...]:
    """A joint path as RC says it: torso and one arm."""
    return tuple(tuple(float(x) for x in q[names.COLUMNS[side]]) for q in path)


def move(side: Side, path: list[np.ndarray], speed: float, fingers: float | None = None) -> rc.MoveJoint:
    """The command of a free motion."""
    return rc.MoveJoint(key="", side=side, path=along(side, path), speed=speed, fingers=fingers)


def approach_points(steps: Iterable[tuple[pin.SE3, float]]) -> tuple[rc.ApproachPoint, ...]:
    """Grip poses with finger angles, as RC says it."""
    return tuple(rc.ApproachPoint(on_wire(pose), fingers) for pose, fingers in steps)


def arrived(side: Side, q: np.ndarray, fingers: float | None = None) -> tuple[wm.AnyChange, ...]:
    """The changes a motion of one arm makes."""
    return configured(side, q, fingers)


def object_pose(ask: Asking, state: str, name: str) -> pin.SE3:
    """Where km says it is (in that state)."""
    return transform(ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).pose)

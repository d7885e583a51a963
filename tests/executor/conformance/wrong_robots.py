"""Back-ends that are wrong on purpose: a mistake, the check that must find it, how it is made."""

import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from doubles import RobotDouble, copied
from msgspec.structs import replace

from velma.sim.mock_backend import MockBackend

DEG = 180.0 / np.pi
Make = Callable[[], MockBackend]


def _changed(changes: dict[str, Callable[[Any], Any]]) -> Callable[..., Any]:
    """A hook that makes fields of a state or a command anew."""
    return lambda _, one: replace(one, **{k: to(getattr(one, k)) for k, to in changes.items()})


def telling(**changes: Callable[[Any], Any]) -> Make:
    """A robot that tells some fields otherwise than it measures them."""
    return partial(RobotDouble, observed=_changed(changes))


def obeying(**changes: Callable[[Any], Any]) -> Make:
    """A robot whose drives get some fields of a command otherwise than they were asked."""
    return partial(RobotDouble, asked=_changed(changes))


def moving(change: Callable[..., object]) -> Make:
    """A robot in which a step ends differently."""
    return partial(RobotDouble, moved=change)


def other(**attributes: Any) -> Make:
    """A robot whose class has other attributes."""
    return type("Other", (RobotDouble,), attributes)


def stale() -> MockBackend:
    """Readings of six cycles ago."""
    old = deque(maxlen=7)

    def tell(_, state):
        return replace(state, q=old[0].q, v=old[0].v) if old else state

    return RobotDouble(tell, moved=lambda robot, *_: old.append(copied(robot._state)))


def frozen() -> MockBackend:
    """Positions of the beginning."""
    first = MockBackend().observe().q
    return RobotDouble(lambda _, state: replace(state, q=first.copy()))


def latched() -> MockBackend:
    """A drive that keeps the largest torque it was given."""
    largest = np.zeros(15)

    def ask(_, command):
        np.copyto(largest, command.tau, where=np.abs(command.tau) > np.abs(largest))
        return replace(command, tau=largest)

    return RobotDouble(asked=ask)


def drops_out(_, state):
    """A sensor that drops out once."""
    if 0.5 < state.time < 0.51:
        state.v[6] = np.nan
    return state


def coasting(robot, before, command):
    """Drives that let go when they are told less: nothing brakes."""
    against = command.tau * before.v < 0
    robot._state.v[against] = before.v[against]


def endless(robot, before, command):
    """Joints without ends."""
    state = robot._state
    state.q[:] = before.q + robot.period_s * np.where(state.v == 0.0, np.sign(command.tau), state.v)


def set_back(robot, *_):
    """A clock that is set once."""
    robot._state.time -= 0.1 * (abs(robot._state.time - 0.3) < 1e-9)


def looking(robot, _):
    """Every look lets a period pass."""
    robot._state.time += robot.period_s
    return copied(robot._state)


def hanging(robot, *_):
    """A step that waits for an answer that does not come."""
    if robot._state.time > 0.2:
        time.sleep(1.5)


def gone(robot, command):
    """After one drive failure it never answers again, and says old things."""
    if np.abs(command.tau).any() and robot._state.time > 0.4:
        raise ConnectionError("the drives are gone")
    return command


def paid_back(robot, _, command):
    """Braking is taken off the bill."""
    robot._work += 2 * robot.period_s * min(0.0, float((command.tau * robot._state.v).sum()))


MISTAKES: dict[str, tuple[str, Make]] = {
    "readings of six cycles ago": ("fresh", stale),
    "positions of the beginning": ("own-joint", frozen),
    "positions in degrees": ("ranges", telling(q=lambda q: q * DEG)),
    "speeds in degrees": ("agreement", telling(v=lambda v: v * DEG)),
    "speeds of the wrong sign": ("agreement", telling(v=np.negative)),
    "one drive counts the other way": (
        "own-joint",
        obeying(tau=lambda tau: tau * np.where(np.arange(15) == 4, -1.0, 1.0)),
    ),
    "arms are swapped": (
        "own-joint",
        obeying(tau=lambda tau: np.append(tau[0], np.roll(tau[1:], 7))),
    ),
    "a sensor drops out once": ("numbers", partial(RobotDouble, drops_out)),
    "joints without ends": ("joint-ends", moving(endless)),
    "fingers without ends": (
        "servo-ends",
        moving(lambda robot, _, command: np.copyto(robot._state.proximal, command.proximal)),
    ),
    "a drive keeps the largest torque": ("stop-rest", latched),
    "drives let go when they are told less": ("stop-way", moving(coasting)),
    "gravity is not held": ("rest", obeying(tau=lambda tau: tau + 3.0)),
    "a clock is set back once": ("time-passes", moving(set_back)),
    "ticks instead of seconds": (
        "time-keeps-pace",
        moving(lambda robot, *_: setattr(robot._state, "time", robot._state.time + 0.998)),
    ),
    "steps of 1 ms": ("period", other(period_s=0.001)),
    "looking takes time": ("looking", partial(RobotDouble, looking)),
    "a step does not come back": ("step-returns", moving(hanging)),
    "a step takes a period": ("step-cost", moving(lambda robot, *_: time.sleep(robot.period_s))),
    "it keeps a history": ("memory", RobotDouble),
    "single precision": ("form", telling(q=lambda q: q.astype(np.float32))),
    "rows left, right": ("hands", telling(proximal=lambda angles: angles[::-1].copy())),
    "tilt before pan": ("head", telling(head=lambda angles: angles[::-1].copy())),
    "locked fingers go on": ("locks", obeying(locked=np.zeros_like)),
    "braking is taken off the bill": ("work", moving(paid_back)),
    "more coordinates than the slot has room for": (
        "room",
        other(configuration=lambda self: np.zeros(5000)),
    ),
    "a thing more each second": (
        "numbers",
        other(configuration=lambda self: np.zeros(int(self._state.time))),
    ),
    "it never answers again": ("safe-rest", partial(RobotDouble, asked=gone)),
}

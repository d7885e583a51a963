"""Telemetry of ex and the simulation's true state in a recorded run, each with the time at which it
was heard; and the simulation's clock, read off them.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import msgspec
import numpy as np

from companion.telemetry import Picture, RobotState, TrueState, decoded
from operate.recording.history import History

T = TypeVar("T")
DECODERS: dict[str, Callable[[bytes], Any]] = {
    "telemetry": decoded,
    "truth": msgspec.msgpack.Decoder(TrueState).decode,
}
"""Kind of a signal -> what stands on it; raises msgspec.MsgspecError for anything else."""
Timed = tuple[tuple[float, T], ...]


def robot(history: History) -> Timed[RobotState]:
    """The measured robot."""
    return history.once(_robot)


def pictures(history: History) -> Timed[Picture]:
    """The pictures of the head camera."""
    return _of(history, Picture)


def truth(history: History) -> Timed[TrueState]:
    """The true states of the simulation."""
    return history.once(_truth)


def paced(history: History) -> bool | None:
    """Whether the loop kept a clock (speed 1); None where nobody tells. Without one there is no
    lateness at all.
    """
    if history.setting is not None:
        return history.setting.speed != "max"
    states = robot(history)
    return states[-1][1].lateness_us.max > 0 if states else None


def _robot(history: History) -> Timed[RobotState]:
    return _of(history, RobotState)


def _truth(history: History) -> Timed[TrueState]:
    return _of(history, TrueState)


def _of(history: History, kind: type[T]) -> Timed[T]:
    return tuple((at, one) for at, one in history.told if isinstance(one, kind))


LOOSE_S = 1.0
"""Further than this from any telemetry a simulated time is a guess, and not given; telemetry comes
at 20 Hz.
"""


class Clock:
    """Simulated seconds by unix seconds."""

    def __init__(self, history: History) -> None:
        pairs = [(at, state.sim_time_s) for at, state in robot(history)] or [
            (at, t.time_s) for at, t in truth(history)
        ]
        self._wall = np.array([at for at, _ in pairs])
        self._sim = np.array([sim for _, sim in pairs])

    def sim(self, wall: float) -> float | None:
        """Simulated time at `wall`; None where nothing says."""
        behind = int(np.searchsorted(self._wall, wall))
        near = self._wall[max(0, behind - 1) : behind + 1]
        if not len(near) or np.abs(near - wall).min() > LOOSE_S:
            return None
        return float(np.interp(wall, self._wall, self._sim))

    def spent(self, spans: list[tuple[float, float]]) -> float | None:
        """Simulated time in the union of spans of wall time; None where a span's end is not
        known.
        """
        total, until = 0.0, -np.inf
        for start, end in sorted(spans):
            a, b = self.sim(max(start, until)), self.sim(end)
            if a is None or b is None:
                return None
            total += max(0.0, b - a)
            until = max(until, end)
        return total

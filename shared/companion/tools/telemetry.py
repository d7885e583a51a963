"""Telemetry of ex and the simulation's true state in a recorded run, each with the time at which it
was heard; and the simulation's clock, read off them.
"""

import math
from collections.abc import Callable, Iterator
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
KINDS: dict[type, str] = {RobotState: "telemetry", Picture: "telemetry", TrueState: "truth"}
PICTURE_SIZE = (400, 300)
"""Pixels of a picture for people: half of velma.eyes.lens.WIDTH and HEIGHT
(services.executor.telemetry.SHRINK).
"""
PICTURE_FOCAL = PICTURE_SIZE[0] / 2 / math.tan(1.047 / 2)  # [pixels]; velma.eyes.lens.HALF_WIDTH


def every(history: History, kind: type[T]) -> tuple[tuple[float, T], ...]:
    """All of this type, each with when it was heard [unix s]; where one is enough, `newest` and
    `next_one` are quicker.
    """
    return tuple((at, one) for at, one in history.signals if isinstance(one, kind))


def backwards(
    history: History, kind: type[T], until: float = math.inf
) -> Iterator[tuple[float, T]]:
    """Those of this type that were heard up to then [unix s], each with when; the newest first."""
    found = history.signals.until(until, KINDS[kind])
    return ((at, one) for at, one in found if isinstance(one, kind))


def newest(history: History, kind: type[T], until: float = math.inf) -> tuple[float, T] | None:
    """The newest one of this type that was heard up to then [unix s], and when; None for none."""
    return next(backwards(history, kind, until), None)


def next_one(history: History, kind: type[T], after: float) -> tuple[float, T] | None:
    """The first one of this type that was heard after that [unix s], and when; None for none."""
    found = history.signals.after(after, KINDS[kind])
    return next(((at, one) for at, one in found if isinstance(one, kind)), None)


def paced(history: History) -> bool | None:
    """Whether the loop kept a clock (speed 1); None where nobody tells. Without one there is no
    lateness at all.
    """
    if history.setting is not None:
        return history.setting.speed != "max"
    last = newest(history, RobotState)
    return None if last is None else last[1].lateness_us.max > 0


LOOSE_S = 1.0
"""Further than this from any telemetry a simulated time is a guess, and not given; telemetry comes
at 20 Hz.
"""


class Clock:
    """Simulated seconds by unix seconds."""

    def __init__(self, history: History) -> None:
        self._history = history
        self._kind: type[RobotState | TrueState] = (
            TrueState if newest(history, RobotState) is None else RobotState
        )

    def sim(self, wall: float) -> float | None:
        """Simulated time at `wall`; None where nothing says."""
        past, kind = self._history, self._kind
        near = [newest(past, kind, wall), next_one(past, kind, wall)]
        told = [(at, _sim_s(one)) for at, one in filter(None, near)]
        if not told or min(abs(at - wall) for at, _ in told) > LOOSE_S:
            return None
        return float(np.interp(wall, [at for at, _ in told], [sim_s for _, sim_s in told]))

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


def _sim_s(one: RobotState | TrueState) -> float:
    return one.sim_time_s if isinstance(one, RobotState) else one.time_s

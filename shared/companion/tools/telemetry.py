"""Telemetry of ex and the simulation's true state in a recorded run, each with the time at which it
was heard.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

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
    return _of(history, RobotState)


def pictures(history: History) -> Timed[Picture]:
    """The pictures of the head camera."""
    return _of(history, Picture)


def truth(history: History) -> Timed[TrueState]:
    """The true states of the simulation."""
    return _of(history, TrueState)


def paced(history: History) -> bool | None:
    """Whether the loop kept a clock (speed 1); None where nobody tells. Without one there is no
    lateness at all.
    """
    if history.setting is not None:
        return history.setting.speed != "max"
    states = robot(history)
    return states[-1][1].lateness_us.max > 0 if states else None


def _of(history: History, kind: type[T]) -> Timed[T]:
    return tuple((at, one) for at, one in history.told if isinstance(one, kind))

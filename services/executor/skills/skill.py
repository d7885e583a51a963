"""What a skill is: a generator that yields motions of the loop and is sent what came of each.

So a skill neither waits nor reads a clock; the same one runs in one process, in a worker of the agent and in tests.
It ends by returning nothing (done) or by raising NotPossible (the outcome in words, and what kind of failure it is).
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np

from services.executor.loop.program import Motion
from services.executor.receptor import Sight


@dataclass(frozen=True)
class Sensed:
    """After a motion: how it ended, the set-point q (15,) held now, the measured one, fingers that touched, sights."""

    ended: str
    reason: str
    q: np.ndarray
    measured: np.ndarray
    touched: dict[str, tuple[bool, ...]]
    fingers: dict[str, float]
    head: tuple[float, float]
    sights: Sequence[Sight]
    time: float


Skill = Generator[Motion, Sensed, None]


class NotPossible(Exception):
    """The skill cannot be done. `kind`: failed, or replan (the world is not as the plan supposes)."""

    def __init__(self, kind: str, reason: str) -> None:
        self.kind, self.reason = kind, reason
        super().__init__(reason)


class Cancelled(Exception):
    """Thrown into a skill whose motion was cancelled: it may make safe what it began, then lets this pass."""


def whatever_comes(make: Callable[[], Motion]) -> Generator[Motion, Sensed, Sensed]:
    """The motion that `make` makes, made and begun again where a cancel broke it off: for what must come to its end."""
    try:
        return (yield make())
    except Cancelled:
        return (yield make())


def replan(reason: str) -> NotPossible:
    """The world is not as the plan supposes."""
    return NotPossible("replan", reason)


def failed(reason: str) -> NotPossible:
    """It was tried, or cannot be tried."""
    return NotPossible("failed", reason)

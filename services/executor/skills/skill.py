"""A skill: a generator that yields motions of the loop and takes the Sensed of each.

At a motion that is to be looked at, it gets a Sensed now and then that has not `ended` (Phase.RUNNING), and yields what
to do: LookAgain, or Cancel to bring the motion to rest. Whether anybody looks is not sure; the end of a motion is.

A skill neither waits nor reads a clock, so the same one runs in one process, in the skill process and in tests. It
returns when the act is done, or raises NotPossible with kind and facts.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np

from companion.languages import rc
from companion.languages.facts import Fact, Facts
from services.executor.loop.program import Cancel, GripReport, LookAgain, Motion
from services.executor.sight import Sight


@dataclass(frozen=True)
class Sensed:
    """After or during a motion: how it ended, why, set-point q and measured joints (15,) [rad], touches, grips, sights.

    `wrong`, `off`: of the eyes that had these sights (services.executor.sight.Eye).
    """

    ended: str
    why: Facts
    q: np.ndarray
    measured: np.ndarray
    touched: dict[str, tuple[bool, ...]]
    fingers: dict[str, float]
    grips: dict[str, GripReport]
    head: tuple[float, float]
    sights: Sequence[Sight]
    time: float
    wrong: str = ""
    off: float = 0.0


SLIPS = 3  # estimate: a bowl that is tilted settles once or twice in the fingers (seen on the way to a free spot)

Asked = Motion | LookAgain | Cancel
Skill = Generator[Asked, Sensed, None]


class NotPossible(Exception):
    """The act cannot be done. `kind`: failed, replan (the world is not as planned), missing (a thing), empty or
    slipped (in the hand)."""

    def __init__(self, kind: str, why: Facts) -> None:
        self.kind, self.why = kind, why
        super().__init__(kind, why)


class Cancelled(Exception):
    """Thrown into a skill whose motion was cancelled. The skill may make its work safe, then lets it pass."""


def despite_cancel(make: Callable[[], Motion]) -> Generator[Motion, Sensed, Sensed]:
    """Run the motion that `make` returns, and once more if a cancel stopped it: for what must be finished."""
    try:
        return (yield make())
    except Cancelled:
        return (yield make())


def despite_slips(make: Callable[[], Skill]) -> Skill:
    """Run the skill that `make` returns, again from where the hand is after each of a few slips."""
    for _ in range(SLIPS):
        try:
            return (yield from make())
        except NotPossible as slip:
            if slip.kind != rc.NotDoneKind.SLIPPED:
                raise
    return (yield from make())


def replan(*why: Fact) -> NotPossible:
    """Return the exception for a world that is not as planned."""
    return NotPossible(rc.NotDoneKind.REPLAN, why)


def empty(*why: Fact) -> NotPossible:
    """Return the exception for a hand that does not hold what it should."""
    return NotPossible(rc.NotDoneKind.EMPTY, why)


def missing(*why: Fact) -> NotPossible:
    """Return the exception for a thing that is not where it should be."""
    return NotPossible(rc.NotDoneKind.MISSING, why)


def failed(*why: Fact) -> NotPossible:
    """Return the exception for an act that failed or cannot be tried."""
    return NotPossible(rc.NotDoneKind.FAILED, why)

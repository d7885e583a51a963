"""A skill: a generator that yields motions of the loop and takes the Sensed of each.

At a motion that is to be looked at, it gets a Sensed now and then that has not `ended`
(Phase.RUNNING), and yields what to do: LookAgain, or Cancel to bring the motion to rest. Whether
anybody looks is not sure; the end of a motion is.

A skill neither waits nor reads a clock, so the same one runs in one process, in the skill process
and in tests. It returns when the act is done, or raises NotPossible with kind and facts.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from companion.languages import rc
from companion.languages.evidence import AnyClaim, Sense
from companion.languages.facts import Fact, Facts
from companion.skills.loop_messages import Cancel, GripReport, LookAgain, Motion
from companion.skills.situation import Sight, Situation


@dataclass(frozen=True)
class Sensed:
    """After or during a motion: how it ended, why, set-point q and measured joints (15,) [rad],
    touches, grips, sights.

    `wrong`, `off`: of the eyes that had these sights (companion.skills.situation.Eye).
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


# estimate: a bowl that is tilted settles once or twice in the fingers (seen on the way to a free
# spot)
SLIPS = 3

Asked = Motion | LookAgain | Cancel
Skill = Generator[Asked, Sensed, None]
Tells = Callable[[Situation, Any, Sensed, str], bool]
"""Whether a sense told, in an act that was done and with what was sensed last, that a claim is true
of a thing.
"""


@dataclass(frozen=True)
class SkillRow:
    """The skill that performs an act, and what has to be well for it.

    `carries`: the hand of the act may hold a thing all the while; with one that it does not feel,
    the act is not done. `by_joints`: the hand goes by its joints, so it is not begun with joints
    that tell its place wrong. `checked`: it is not begun where neither the camera nor the wrist
    could tell how it ends. `tells`: how senses tell what must be true after it, beside the general
    claims (companion.skills.senses). `done`: fields of its outcome that it alone fills.
    """

    act: type[rc.Command]
    skill: Callable[[Situation, Any], Skill]
    carries: bool = False
    by_joints: bool = True
    checked: bool = False
    tells: Mapping[tuple[AnyClaim, Sense], Tells] = field(default_factory=dict)
    done: Callable[[Situation], Mapping[str, Any]] = lambda here: {}


class NotPossible(Exception):
    """The act cannot be done. `kind`: failed, replan (the world is not as planned), missing (a
    thing), empty or slipped (in the hand).
    """

    def __init__(self, kind: str, *why: Fact) -> None:
        self.kind, self.why = kind, why
        super().__init__(kind, why)


class Cancelled(Exception):
    """Thrown into a skill whose motion was cancelled. The skill may make its work safe, then lets
    it pass.
    """


def despite_cancel(make: Callable[[], Motion]) -> Generator[Motion, Sensed, Sensed]:
    """Run the motion that `make` returns, and once more if a cancel stopped it: for what must be
    finished.
    """
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


replan = partial(NotPossible, rc.NotDoneKind.REPLAN)
"""The exception for a world that is not as planned."""
empty = partial(NotPossible, rc.NotDoneKind.EMPTY)
"""The exception for a hand that does not hold what it should."""
missing = partial(NotPossible, rc.NotDoneKind.MISSING)
"""The exception for a thing that is not where it should be."""
failed = partial(NotPossible, rc.NotDoneKind.FAILED)
"""The exception for an act that failed or cannot be tried."""

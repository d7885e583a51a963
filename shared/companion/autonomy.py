"""Words between an operator and ta: which acts wait for the operator, and what lets one begin.

Both are parameters of ta in the design (docs/parameters.md). A leaf of a plan is named by its path,
as in reports.
"""

from enum import StrEnum

import msgspec

from companion.acts import ACTS
from companion.languages import rc

LEVEL, STEP = "autonomy", "step"
"""Names of the parameters: the level of autonomy, and the operator's last word."""
WAIT_S = 600.0
"""Longest that a plan waits for the operator [s]; estimate: who does not come within ten minutes
has gone.
"""


class Level(StrEnum):
    """Levels of autonomy: which acts wait for the operator."""

    AUTO = "auto"  # none
    HANDLING = "handling"  # those that handle a thing
    CONFIRM = "confirm"  # all


def asks(level: str, act: type[rc.Command]) -> bool:
    """Whether an act waits for the operator at a level."""
    return level == Level.CONFIRM or (level == Level.HANDLING and ACTS[act].handles)


class Verb(StrEnum):
    """`go`: begin the act that waits. `replan`: end the act under way, or give up the one that
    waits; plan again.
    """

    GO = "go"
    REPLAN = "replan"


class Permission(msgspec.Struct, frozen=True):
    """Word of the operator to the leaf `at` and to no other one, so that a word that comes late
    does nothing.
    """

    verb: Verb
    at: str

    def __str__(self) -> str:
        """The value of the parameter that says it."""
        return f"{self.verb} {self.at}"


def read(text: str) -> Permission | None:
    """The word that a value of the parameter says, None where it says none."""
    verb, _, at = text.partition(" ")
    return Permission(Verb(verb), at) if verb in [*Verb] and at else None

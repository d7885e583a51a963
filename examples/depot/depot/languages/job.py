"""JOB: transports that are put out to tender among the robots (contract net, FIPA SC00029H)."""

import msgspec
from fipa_codec.languages import Language


class Sentence(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """Something said in JOB."""


class Call(Sentence, frozen=True):
    """Who can carry this, and how soon?"""

    item: str
    source: str
    target: str


class Offer(Sentence, frozen=True):
    """It would be delivered in so many seconds."""

    seconds: float


class Carried(Sentence, frozen=True):
    """It is delivered."""

    item: str


class NotFree(Sentence, frozen=True):
    """Not now, and why."""

    reason: str


Content = Call | Offer | Carried | NotFree
LANGUAGE = Language("JOB", Content)

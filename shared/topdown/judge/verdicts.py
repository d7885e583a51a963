"""Verdicts of a judge about a communicate, and their subjects.

The words are those of reports, logs and exit codes. Nothing here knows a particular system, a clock
or a wire.
"""

from enum import StrEnum

import msgspec

from fipa_codec.communicate import Communicate


class Verdict(StrEnum):
    """One verdict; those of VIOLATIONS are against the design."""

    LEGAL = "legal"
    COPY = "copy"
    """Said before, word for word: a durable communicate sent again, a question asked again."""
    SLOW = "slow"
    """In sequence and before reply-by, but later than the design says an answer should need at
    most.
    """
    NOT_JUDGED = "not judged"
    """Of a conversation whose beginning, or a part of it, was not heard: its place in the sequence
    is not known.
    """
    OUT_OF_SEQUENCE = "out of sequence"
    WRONG_CHANNEL = "wrong channel"
    """On a key that says something else than the communicate, or on another channel than the design
    has it on.
    """
    WRONG_LANGUAGE = "wrong language"
    """Language, ontology or class of content are not those of the design, or the content cannot be
    read.
    """
    OVER_BUDGET = "over budget"
    """Larger than the design allows."""
    LATE = "late"
    """An answer after reply-by."""
    UNANSWERED = "unanswered"
    """Reply-by passed, and no answer was heard."""
    NOT_ENTITLED = "not entitled"
    """An agent that the design does not know, or one that may not say this act in this protocol to
    that receiver.
    """
    MALFORMED = "malformed"
    """Bytes that are not a communicate."""
    NOT_TAKEN = "not taken"
    """Said, and nobody took it: its receiver was down, frozen or out of reach."""
    NOT_SAID = "not said"
    """Taken, and its sender did not say it: somebody else did, in its name."""
    ALTERED = "altered"
    """Its receiver took other words than its sender said."""


FINE = frozenset({Verdict.LEGAL, Verdict.COPY, Verdict.SLOW, Verdict.NOT_JUDGED, Verdict.NOT_TAKEN})
VIOLATIONS = frozenset(Verdict) - FINE


class Heard(msgspec.Struct, frozen=True, gc=False):
    """The `n`-th sample (from 1), heard at `at` [s] on `key`; `size` [bytes]; None: not a
    communicate.
    """

    n: int
    at: float
    key: str
    size: int
    communicate: Communicate | None


class Judgement(msgspec.Struct, frozen=True):
    """A verdict about one communicate, and why.

    `channel`: the one the design has it on, else what its key says. `states`: initiator and
    participant after it, if nothing is lost on its way; several with | between where that is not
    certain; "" where it is not followed.
    """

    verdict: Verdict
    heard: Heard
    channel: str = ""
    why: str = ""
    states: tuple[str, str] = ("", "")

    @property
    def violation(self) -> bool:
        """Whether it is against the design."""
        return self.verdict in VIOLATIONS

"""The words for the states of all protocols of this package; what ends a conversation is named by how it ended."""

from enum import StrEnum

from fipa_codec.tables import START


class State(StrEnum):
    """States of both roles. `cancelling-x`: initiator in x whose cancel is pending; `stopping-x`: participant in x
    that has taken the cancel and not answered it.
    """

    START = START
    ASKED = "asked"
    """Opened, and not yet answered."""
    AGREED = "agreed"
    WAITING = "waiting"
    """Agreed to act once a condition holds."""
    LIVE = "live"
    """Subscribed."""
    CALLED = "called"
    """Called for a proposal."""
    OFFERED = "offered"
    """A proposal is made, and not yet accepted or rejected."""
    AWARDED = "awarded"
    """The proposal is accepted: it binds who made it."""
    SEARCHING = "searching"
    """The broker looks for agents that fit, and passes the embedded message on."""
    RELAYING = "relaying"
    """The message is passed on; what the targets answer is relayed."""

    CANCELLING_ASKED = "cancelling-asked"
    CANCELLING = "cancelling"
    """Of AGREED and LIVE."""
    CANCELLING_WAITING = "cancelling-waiting"
    CANCELLING_CALLED = "cancelling-called"
    CANCELLING_OFFERED = "cancelling-offered"
    CANCELLING_AWARDED = "cancelling-awarded"
    CANCELLING_SEARCHING = "cancelling-searching"
    CANCELLING_RELAYING = "cancelling-relaying"
    OVERTAKEN = "overtaken"
    """Initiator: the end crossed the cancel, whose own answer is still to come."""
    STOPPING_ASKED = "stopping-asked"
    STOPPING = "stopping"
    """Of AGREED and LIVE."""
    STOPPING_WAITING = "stopping-waiting"
    STOPPING_CALLED = "stopping-called"
    STOPPING_OFFERED = "stopping-offered"
    STOPPING_AWARDED = "stopping-awarded"
    STOPPING_SEARCHING = "stopping-searching"
    STOPPING_RELAYING = "stopping-relaying"
    TOO_LATE = "too-late"
    """Participant: owes the cancel its failure, since the conversation had ended."""

    ASKED_AGAIN = "asked-again"
    """Participant: owes its agree once more."""
    REFUSED_AGAIN = "refused-again"
    FAILED_AGAIN = "failed-again"

    DONE = "done"
    FAILED = "failed"
    REFUSED = "refused"
    ACCEPTED = "accepted"
    REJECTED = "rejected"
    PASSED = "passed"
    """The message was handed over; what is said about it is said elsewhere."""
    CANCELLED = "cancelled"
    SETTLED = "settled"
    """Ended by itself, and the cancel that came too late is answered."""

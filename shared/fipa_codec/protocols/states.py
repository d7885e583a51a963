"""Names of the states of the protocols of this package."""

from enum import StrEnum

from fipa_codec.tables import START


class State(StrEnum):
    """States of both roles. A final state is named after the outcome.

    `cancelling-x`: initiator in x with a pending cancel. `stopping-x`: participant in x that has not answered a
    received cancel.
    """

    START = START
    ASKED = "asked"
    """Opened, not answered yet."""
    AGREED = "agreed"
    WAITING = "waiting"
    """Agreed to act when a condition holds."""
    LIVE = "live"
    """Subscribed; informs may follow at any time."""
    CALLED = "called"
    """Called for a proposal."""
    OFFERED = "offered"
    """A proposal was made and is neither accepted nor rejected yet."""
    AWARDED = "awarded"
    """The proposal is accepted and binding."""
    SEARCHING = "searching"
    """The broker looks for target agents and forwards the embedded message."""
    RELAYING = "relaying"
    """The embedded message is forwarded; the answers of the targets are relayed."""

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
    """Initiator: the last message crossed the cancel; the answer to the cancel is still to come."""
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
    """Participant: must answer the cancel with failure, since the conversation had ended."""

    ASKED_AGAIN = "asked-again"
    """Participant: must repeat its agree."""
    REFUSED_AGAIN = "refused-again"
    FAILED_AGAIN = "failed-again"

    DONE = "done"
    FAILED = "failed"
    REFUSED = "refused"
    ACCEPTED = "accepted"
    REJECTED = "rejected"
    PASSED = "passed"
    """The embedded message was forwarded; its conversation is another one."""
    CANCELLED = "cancelled"
    SETTLED = "settled"
    """Ended without the cancel; the late cancel is answered."""

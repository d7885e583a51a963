"""Request, of the specification (`fipa-request`, SC00026H) and the paper's (`request`); and request-when (SC00028H)."""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import Pending, cancellable, pending
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Row, register

PLAIN, PROGRESS = Kind.PLAIN, Kind.PROGRESS

ANSWERS = (
    Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.AGREED),
    Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
    Row(S.ASKED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
    Row(S.ASKED, RECEIVE, P.INFORM, PLAIN, S.DONE),
    Row(S.AGREED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
    Row(S.AGREED, RECEIVE, P.INFORM, PLAIN, S.DONE),
)
"""Rows of the answers to a request or a query (SC00026H, SC00027H), from the view of the initiator."""
ENDED = (S.DONE, S.FAILED, S.REFUSED)
"""States after the last of them."""
OPEN = {
    S.ASKED: Pending(S.CANCELLING_ASKED, S.STOPPING_ASKED),
    S.AGREED: Pending(S.CANCELLING, S.STOPPING),
}
"""States in which the initiator may cancel."""

_OPENING = Row(S.START, SEND, P.REQUEST, PLAIN, S.ASKED)

FIPA_REQUEST = register(cancellable("fipa-request", [_OPENING, *ANSWERS], ended=ENDED, pending=OPEN))
"""Request (SC00026H).

agree may be omitted if the result is immediate. The result is the only inform: progress is told by a subscription.
"""

REQUEST = register(
    cancellable(
        "request",
        [_OPENING, *ANSWERS, Row(S.AGREED, RECEIVE, P.INFORM, PROGRESS, S.AGREED)],
        ended=ENDED,
        pending=OPEN,
        failure_ends=True,
    )
)
"""The paper's request: inform[progress] between agree and result is added.

A failure in reply to the cancel ends the conversation too, since the act is over: a participant that cannot stop its
act completes it first and then answers the cancel.
"""

REQUEST_WHEN = register(
    cancellable(
        "request-when",
        [
            Row(S.START, SEND, P.REQUEST_WHEN, PLAIN, S.ASKED),
            Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
            Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.WAITING),
            Row(S.WAITING, RECEIVE, P.INFORM, PLAIN, S.DONE),
            Row(S.WAITING, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        ],
        ended=ENDED,
        pending=pending(S.ASKED, S.WAITING),
        aliases=("fipa-request-when",),
    )
)
"""Request when (SC00028H).

The act is performed once, when the condition holds. The agree is required before the result.
"""

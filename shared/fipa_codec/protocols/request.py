"""`request` (FIPA SC00026H) and `request-when` (SC00028H), with cancel."""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import Pending, cancellable, pending
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Row, register

PLAIN, PROGRESS = Kind.PLAIN, Kind.PROGRESS

REQUEST = register(
    cancellable(
        "request",
        [
            Row(S.START, SEND, P.REQUEST, PLAIN, S.ASKED),
            Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.AGREED),
            Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
            Row(S.ASKED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
            Row(S.ASKED, RECEIVE, P.INFORM, PLAIN, S.DONE),
            Row(S.AGREED, RECEIVE, P.INFORM, PROGRESS, S.AGREED),
            Row(S.AGREED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
            Row(S.AGREED, RECEIVE, P.INFORM, PLAIN, S.DONE),
        ],
        ended=(S.DONE, S.FAILED, S.REFUSED),
        pending={
            S.ASKED: Pending(S.CANCELLING_ASKED, S.STOPPING_ASKED),
            S.AGREED: Pending(S.CANCELLING, S.STOPPING),
        },
        failure_ends=True,
        aliases=("fipa-request",),
    )
)
"""Request (SC00026H).

agree may be omitted if the result is immediate; inform[progress] between agree and result is added. A failure in reply
to the cancel ends the conversation too, since the act is over: a participant that cannot stop its act completes it
first and then answers the cancel.
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
        ended=(S.DONE, S.FAILED, S.REFUSED),
        pending=pending(S.ASKED, S.WAITING),
        aliases=("fipa-request-when",),
    )
)
"""Request when (SC00028H).

The act is performed once, when the condition holds. The agree is required before the result.
"""

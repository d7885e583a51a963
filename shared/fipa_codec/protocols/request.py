"""`request` (FIPA SC00026H) and `request-when` (SC00028H), with cancel."""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import Pending, cancellable, pending
from fipa_codec.protocols.naming import register
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Row

PLAIN, PROGRESS = Kind.PLAIN, Kind.PROGRESS

# agree is needed only when the result does not come at once. An inform[progress] between agree and result is ours.
# A failure in reply to the cancel ends the conversation as an inform does: the act is over, so there is nothing to go
# on with; who cannot stop its act brings it to its end first and answers the cancel then.
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

# The act is done once, when the condition comes true. The agreement is explicit: no result comes straight from asked.
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

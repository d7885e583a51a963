"""Subscription, of the specification (`fipa-subscribe`, SC00035H) and the paper's (`subscribe`), which is soft state.

A live subscription may last for ever. In the paper's the initiator repeats subscribe, with the same m_w, until it is
answered; the participant then repeats its answer. A participant answers the cancel in the same step, and a failed
cancel ends the subscription.
"""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import Pending, cancellable
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Protocol, Row, Table, register

PLAIN, CANCEL = Kind.PLAIN, Kind.CANCEL

_subscribe_initiator = Table(
    [
        Row(S.START, SEND, P.SUBSCRIBE, PLAIN, S.ASKED),
        Row(S.ASKED, SEND, P.SUBSCRIBE, PLAIN, S.ASKED),
        Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.LIVE),
        Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.ASKED, RECEIVE, P.INFORM, PLAIN, S.LIVE),
        Row(S.ASKED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        Row(S.ASKED, SEND, P.CANCEL, PLAIN, S.CANCELLING_ASKED),
        Row(S.LIVE, RECEIVE, P.AGREE, PLAIN, S.LIVE),
        Row(S.LIVE, RECEIVE, P.INFORM, PLAIN, S.LIVE),
        Row(S.LIVE, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        Row(S.LIVE, SEND, P.CANCEL, PLAIN, S.CANCELLING),
        Row(S.REFUSED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.FAILED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        Row(S.CANCELLING_ASKED, RECEIVE, P.AGREE, PLAIN, S.CANCELLING),
        Row(S.CANCELLING_ASKED, RECEIVE, P.REFUSE, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING_ASKED, RECEIVE, P.INFORM, PLAIN, S.CANCELLING),
        Row(S.CANCELLING_ASKED, RECEIVE, P.FAILURE, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING_ASKED, RECEIVE, P.INFORM, CANCEL, S.CANCELLED),
        Row(S.CANCELLING_ASKED, RECEIVE, P.FAILURE, CANCEL, S.CANCELLED),
        Row(S.CANCELLING, RECEIVE, P.AGREE, PLAIN, S.CANCELLING),
        Row(S.CANCELLING, RECEIVE, P.INFORM, PLAIN, S.CANCELLING),
        Row(S.CANCELLING, RECEIVE, P.FAILURE, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING, RECEIVE, P.INFORM, CANCEL, S.CANCELLED),
        Row(S.CANCELLING, RECEIVE, P.FAILURE, CANCEL, S.CANCELLED),
        Row(S.OVERTAKEN, RECEIVE, P.REFUSE, PLAIN, S.OVERTAKEN),
        Row(S.OVERTAKEN, RECEIVE, P.FAILURE, PLAIN, S.OVERTAKEN),
        Row(S.OVERTAKEN, RECEIVE, P.FAILURE, CANCEL, S.SETTLED),
    ],
    ended=(S.FAILED, S.REFUSED, S.CANCELLED, S.SETTLED),
    resting=(S.LIVE,),
)

_subscribe_participant = Table(
    [
        Row(S.START, RECEIVE, P.SUBSCRIBE, PLAIN, S.ASKED),
        Row(S.ASKED, RECEIVE, P.SUBSCRIBE, PLAIN, S.ASKED),
        Row(S.ASKED, SEND, P.AGREE, PLAIN, S.LIVE),
        Row(S.ASKED, SEND, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.ASKED, SEND, P.INFORM, PLAIN, S.LIVE),
        Row(S.ASKED, SEND, P.FAILURE, PLAIN, S.FAILED),
        Row(S.ASKED, RECEIVE, P.CANCEL, PLAIN, S.STOPPING),
        Row(S.LIVE, SEND, P.INFORM, PLAIN, S.LIVE),
        Row(S.LIVE, SEND, P.FAILURE, PLAIN, S.FAILED),
        Row(S.LIVE, RECEIVE, P.CANCEL, PLAIN, S.STOPPING),
        Row(S.STOPPING, SEND, P.INFORM, CANCEL, S.CANCELLED),
        Row(S.STOPPING, SEND, P.FAILURE, CANCEL, S.CANCELLED),
        Row(S.LIVE, RECEIVE, P.SUBSCRIBE, PLAIN, S.ASKED_AGAIN),
        Row(S.ASKED_AGAIN, SEND, P.AGREE, PLAIN, S.LIVE),
        Row(S.REFUSED, RECEIVE, P.SUBSCRIBE, PLAIN, S.REFUSED_AGAIN),
        Row(S.REFUSED_AGAIN, SEND, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.FAILED, RECEIVE, P.SUBSCRIBE, PLAIN, S.FAILED_AGAIN),
        Row(S.FAILED_AGAIN, SEND, P.FAILURE, PLAIN, S.FAILED),
        Row(S.START, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE),
        Row(S.FAILED, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE),
        Row(S.REFUSED, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE),
        Row(S.TOO_LATE, SEND, P.FAILURE, CANCEL, S.SETTLED),
    ],
    ended=(S.FAILED, S.REFUSED, S.CANCELLED, S.SETTLED),
    urgent=(S.STOPPING, S.ASKED_AGAIN, S.REFUSED_AGAIN, S.FAILED_AGAIN, S.TOO_LATE),
    resting=(S.LIVE,),
)

SUBSCRIBE = register(Protocol("subscribe", initiator=_subscribe_initiator, participant=_subscribe_participant))
"""The paper's subscription."""

FIPA_SUBSCRIBE = register(
    cancellable(
        "fipa-subscribe",
        [
            Row(S.START, SEND, P.SUBSCRIBE, PLAIN, S.ASKED),
            Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.LIVE),
            Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
            Row(S.ASKED, RECEIVE, P.INFORM, PLAIN, S.LIVE),
            Row(S.ASKED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
            Row(S.LIVE, RECEIVE, P.INFORM, PLAIN, S.LIVE),
            Row(S.LIVE, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        ],
        ended=(S.REFUSED, S.FAILED),
        pending={
            S.ASKED: Pending(S.CANCELLING_ASKED, S.STOPPING_ASKED),
            S.LIVE: Pending(S.CANCELLING, S.STOPPING),
        },
        resting=(S.LIVE,),
    )
)
"""Subscribe (SC00035H); agree may be omitted if the first notification is immediate."""

"""The interaction protocols `request`, `query` and `subscribe` as tables, and the protocols of a system by name.

Sources: FIPA SC00026H (request), SC00027H (query), SC00035H (subscribe), the cancel meta-protocol common to all three.
The usual drawings leave out what crosses on the way; `exploration.py` walks both roles over two FIFO channels and found
the rows that close them. Must not know: agents, languages, time.
"""

from enum import StrEnum

from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Row, Table

__all__ = ["QUERY", "REQUEST", "SUBSCRIBE", "Protocol", "State", "named", "register"]

PLAIN, PROGRESS, CANCEL = Kind.PLAIN, Kind.PROGRESS, Kind.CANCEL


class State(StrEnum):
    """States of the three protocols. What ends a conversation is named by how it ended."""

    START = START
    ASKED = "asked"
    """Opened, and not yet answered."""
    AGREED = "agreed"
    LIVE = "live"
    """Subscribed."""
    CANCELLING_ASKED = "cancelling-asked"
    """Initiator: cancelled before any answer came."""
    CANCELLING = "cancelling"
    OVERTAKEN = "overtaken"
    """Initiator: the end crossed the cancel, whose own answer is still to come."""
    STOPPING_ASKED = "stopping-asked"
    """Participant: cancelled before it gave any answer."""
    STOPPING = "stopping"
    TOO_LATE = "too-late"
    """Participant: owes the cancel its failure, since the conversation had ended."""
    ASKED_AGAIN = "asked-again"
    """Participant: owes its agree once more."""
    REFUSED_AGAIN = "refused-again"
    FAILED_AGAIN = "failed-again"
    DONE = "done"
    FAILED = "failed"
    REFUSED = "refused"
    CANCELLED = "cancelled"
    SETTLED = "settled"
    """Ended by itself, and the cancel that came too late is answered."""


S = State

# --- request (SC00026H) with cancel -----------------------------------------------------------------------------------
# agree is needed only when the result does not come at once. An inform[progress] between agree and result is ours.
# A cancel is always answered in reply to itself: inform or failure while the act was on (both end the conversation: the
# act is over), failure when it came too late; the initiator always waits for that answer.

_request_initiator = Table(
    [
        Row(S.START, SEND, P.REQUEST, PLAIN, S.ASKED),
        Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.AGREED),
        Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.ASKED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        Row(S.ASKED, RECEIVE, P.INFORM, PLAIN, S.DONE),
        Row(S.ASKED, SEND, P.CANCEL, PLAIN, S.CANCELLING_ASKED),
        Row(S.AGREED, RECEIVE, P.INFORM, PROGRESS, S.AGREED),
        Row(S.AGREED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        Row(S.AGREED, RECEIVE, P.INFORM, PLAIN, S.DONE),
        Row(S.AGREED, SEND, P.CANCEL, PLAIN, S.CANCELLING),
        # What crosses the cancel is taken; its answer still comes.
        Row(S.CANCELLING_ASKED, RECEIVE, P.AGREE, PLAIN, S.CANCELLING),
        Row(S.CANCELLING_ASKED, RECEIVE, P.REFUSE, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING_ASKED, RECEIVE, P.FAILURE, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING_ASKED, RECEIVE, P.INFORM, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING_ASKED, RECEIVE, P.INFORM, CANCEL, S.CANCELLED),
        Row(S.CANCELLING_ASKED, RECEIVE, P.FAILURE, CANCEL, S.CANCELLED),
        Row(S.CANCELLING, RECEIVE, P.INFORM, PROGRESS, S.CANCELLING),
        Row(S.CANCELLING, RECEIVE, P.FAILURE, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING, RECEIVE, P.INFORM, PLAIN, S.OVERTAKEN),
        Row(S.CANCELLING, RECEIVE, P.INFORM, CANCEL, S.CANCELLED),
        Row(S.CANCELLING, RECEIVE, P.FAILURE, CANCEL, S.CANCELLED),
        Row(S.OVERTAKEN, RECEIVE, P.FAILURE, CANCEL, S.SETTLED),
    ],
    ended=(S.DONE, S.FAILED, S.REFUSED, S.CANCELLED, S.SETTLED),
)

_request_participant = Table(
    [
        Row(S.START, RECEIVE, P.REQUEST, PLAIN, S.ASKED),
        Row(S.ASKED, SEND, P.AGREE, PLAIN, S.AGREED),
        Row(S.ASKED, SEND, P.REFUSE, PLAIN, S.REFUSED),
        Row(S.ASKED, SEND, P.FAILURE, PLAIN, S.FAILED),
        Row(S.ASKED, SEND, P.INFORM, PLAIN, S.DONE),
        Row(S.ASKED, RECEIVE, P.CANCEL, PLAIN, S.STOPPING_ASKED),
        Row(S.AGREED, SEND, P.INFORM, PROGRESS, S.AGREED),
        Row(S.AGREED, SEND, P.FAILURE, PLAIN, S.FAILED),
        Row(S.AGREED, SEND, P.INFORM, PLAIN, S.DONE),
        Row(S.AGREED, RECEIVE, P.CANCEL, PLAIN, S.STOPPING),
        # Stopping takes its time, and the act may come to its own end meanwhile.
        Row(S.STOPPING_ASKED, SEND, P.REFUSE, PLAIN, S.TOO_LATE),
        Row(S.STOPPING_ASKED, SEND, P.FAILURE, PLAIN, S.TOO_LATE),
        Row(S.STOPPING_ASKED, SEND, P.INFORM, PLAIN, S.TOO_LATE),
        Row(S.STOPPING_ASKED, SEND, P.INFORM, CANCEL, S.CANCELLED),
        Row(S.STOPPING_ASKED, SEND, P.FAILURE, CANCEL, S.CANCELLED),
        Row(S.STOPPING, SEND, P.INFORM, PROGRESS, S.STOPPING),
        Row(S.STOPPING, SEND, P.FAILURE, PLAIN, S.TOO_LATE),
        Row(S.STOPPING, SEND, P.INFORM, PLAIN, S.TOO_LATE),
        Row(S.STOPPING, SEND, P.INFORM, CANCEL, S.CANCELLED),
        Row(S.STOPPING, SEND, P.FAILURE, CANCEL, S.CANCELLED),
        # A cancel that crossed the end, or (start) names a conversation nobody remembers: nothing need be remembered.
        Row(S.START, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE),
        Row(S.DONE, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE),
        Row(S.FAILED, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE),
        Row(S.REFUSED, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE),
        Row(S.TOO_LATE, SEND, P.FAILURE, CANCEL, S.SETTLED),
    ],
    ended=(S.DONE, S.FAILED, S.REFUSED, S.CANCELLED, S.SETTLED),
    urgent=(S.TOO_LATE,),
)

REQUEST = Protocol("request", initiator=_request_initiator, participant=_request_participant, aliases=("fipa-request",))

# --- query (SC00027H) -------------------------------------------------------------------------------------------------
# The answer comes at once, so there is neither agree nor cancel (one who no longer wants the answer drops it). Asking
# again, with the same m_w, is free while nothing came: each copy may be answered, and later answers are dropped.
# inform-ref as an answer is the paper's habit (Table 8); the standard says inform.

_ANSWERS = ((P.INFORM, S.DONE), (P.INFORM_REF, S.DONE), (P.REFUSE, S.REFUSED), (P.FAILURE, S.FAILED))
_QUERIES = (P.QUERY_REF, P.QUERY_IF)
_QUERY_ENDED = (S.DONE, S.REFUSED, S.FAILED)

_query_initiator = Table(
    [
        *(Row(state, SEND, query, PLAIN, S.ASKED) for query in _QUERIES for state in (S.START, S.ASKED)),
        *(Row(S.ASKED, RECEIVE, answer, PLAIN, end) for answer, end in _ANSWERS),
        *(Row(end, RECEIVE, answer, PLAIN, end) for answer, _ in _ANSWERS for end in _QUERY_ENDED),
    ],
    ended=_QUERY_ENDED,
)

_query_participant = Table(
    [
        *(Row(state, RECEIVE, q, PLAIN, S.ASKED) for q in _QUERIES for state in (S.START, S.ASKED, *_QUERY_ENDED)),
        *(Row(S.ASKED, SEND, answer, PLAIN, end) for answer, end in _ANSWERS),
    ],
    ended=_QUERY_ENDED,
)

QUERY = Protocol("query", initiator=_query_initiator, participant=_query_participant, aliases=("fipa-query",))

# --- subscribe (SC00035H) with cancel ---------------------------------------------------------------------------------
# Soft state: the initiator repeats subscribe, with the same m_w, until it is answered; the answer is then repeated too.
# A live subscription may rest for ever.

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

SUBSCRIBE = Protocol(
    "subscribe", initiator=_subscribe_initiator, participant=_subscribe_participant, aliases=("fipa-subscribe",)
)

# --- by name ----------------------------------------------------------------------------------------------------------

_registered: dict[str, Protocol] = {}


def register(protocol: Protocol) -> Protocol:
    """Make a protocol known by its name and aliases, for conversations read from a wire or a journal.

    Names are only ever added: LocalProtocolError where one is already taken by another protocol.
    """
    for name in (protocol.name, *protocol.aliases):
        if _registered.setdefault(name, protocol) is not protocol:
            raise LocalProtocolError("protocol", f"{name!r} is already another protocol")
    return protocol


def named(name: str) -> Protocol:
    """LocalProtocolError names the protocols there are; one of a system is there once its module is imported."""
    if name not in _registered:
        raise LocalProtocolError("protocol", f"{name!r} is unknown, known are {', '.join(sorted(_registered))}")
    return _registered[name]


for _protocol in (REQUEST, QUERY, SUBSCRIBE):
    register(_protocol)

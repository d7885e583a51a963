"""`brokering` (FIPA SC00033H) and `recruiting` (SC00034H), with cancel, and the one message `propagate` (SC00037J).

The participant is the broker. Its messages to the target agents are another conversation, with another id, in the
protocol of the embedded message; `proxying.py` connects the two. A broker relays the answers of the targets; in
recruiting they answer the initiator, or the receiver that it designated, directly.
"""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import cancellable, mirrored, pending
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Protocol, Row, Table, register

PLAIN, FINAL = Kind.PLAIN, Kind.FINAL

_SEARCH = (
    Row(S.START, SEND, P.PROXY, PLAIN, S.ASKED),
    Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
    Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.SEARCHING),
    Row(S.SEARCHING, RECEIVE, P.FAILURE, PLAIN, S.FAILED),  # no target found, or none reached
)
_ENDED = (S.DONE, S.FAILED, S.REFUSED)

BROKERING = register(
    cancellable(
        "brokering",
        (
            *_SEARCH,
            Row(S.SEARCHING, RECEIVE, P.INFORM, PLAIN, S.RELAYING),
            Row(S.RELAYING, RECEIVE, P.INFORM, PLAIN, S.RELAYING),
            Row(S.RELAYING, RECEIVE, P.INFORM, FINAL, S.DONE),
            Row(S.RELAYING, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
        ),
        ended=_ENDED,
        pending=pending(S.ASKED, S.SEARCHING, S.RELAYING),
        aliases=("fipa-brokering",),
    )
)
"""Brokering (SC00033H).

The standard says that answers are relayed, but not which one is the last: inform[final] is added. A broker that does
not send it continues until the initiator cancels.
"""

RECRUITING = register(
    cancellable(
        "recruiting",
        (*_SEARCH, Row(S.SEARCHING, RECEIVE, P.INFORM, PLAIN, S.DONE)),
        ended=_ENDED,
        pending=pending(S.ASKED, S.SEARCHING),
        aliases=("fipa-recruiting",),
    )
)
"""Recruiting (SC00034H)."""

_FORWARDED = (Row(S.START, SEND, P.PROPAGATE, PLAIN, S.PASSED),)
PROPAGATE = register(
    Protocol(
        "propagate",
        initiator=Table(_FORWARDED, ended=(S.PASSED,)),
        participant=Table(mirrored(_FORWARDED), ended=(S.PASSED,)),
    )
)
"""The single message of a recruiter to a target; not a protocol of FIPA.

The target treats the embedded message as sent by the sender of that message, and answers that agent.
"""

"""`brokering` (FIPA SC00033H) and `recruiting` (SC00034H), with cancel, and the one message `propagate` (SC00037J).

The participant is the broker. What it says to the targets it finds is another conversation, with an id of its own, in
the protocol of the embedded message; `proxying.py` tells how the two are tied. Brokering relays the targets' answers;
in recruiting they answer the initiator, or the receiver it designated, themselves.
"""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import cancellable, mirrored, pending
from fipa_codec.protocols.naming import register
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Protocol, Row, Table

PLAIN, FINAL = Kind.PLAIN, Kind.FINAL

_SEARCH = (
    Row(S.START, SEND, P.PROXY, PLAIN, S.ASKED),
    Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
    Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.SEARCHING),
    Row(S.SEARCHING, RECEIVE, P.FAILURE, PLAIN, S.FAILED),  # nobody fits, or nobody could be reached
)
_ENDED = (S.DONE, S.FAILED, S.REFUSED)

# The standard says that answers are relayed, not which one is the last: inform[final] is ours. A broker that does not
# know the word goes on until the initiator cancels.
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

RECRUITING = register(
    cancellable(
        "recruiting",
        (*_SEARCH, Row(S.SEARCHING, RECEIVE, P.INFORM, PLAIN, S.DONE)),
        ended=_ENDED,
        pending=pending(S.ASKED, S.SEARCHING),
        aliases=("fipa-recruiting",),
    )
)

# The receiver takes the embedded message as sent to it by the message's own sender, and answers that one. No protocol
# of FIPA: the recruiter's single word to a target.
_passed = (Row(S.START, SEND, P.PROPAGATE, PLAIN, S.PASSED),)
PROPAGATE = register(
    Protocol(
        "propagate",
        initiator=Table(_passed, ended=(S.PASSED,)),
        participant=Table(mirrored(_passed), ended=(S.PASSED,)),
    )
)

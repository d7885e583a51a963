"""`cfp` (contract net, FIPA SC00029H), `icfp` (iterated contract net, SC00030H) and `propose` (SC00036H), with cancel.

One table is one participant's; `multicast.py` holds several of them together, whose proposals compete. A call carries
reply-by, and a proposal that comes later is rejected. A proposal binds who made it once it is accepted.
"""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import cancellable, pending
from fipa_codec.protocols.naming import register
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Row

PLAIN = Kind.PLAIN

_CALL = (
    Row(S.START, SEND, P.CFP, PLAIN, S.CALLED),
    Row(S.CALLED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
    Row(S.CALLED, RECEIVE, P.PROPOSE, PLAIN, S.OFFERED),
    Row(S.OFFERED, SEND, P.REJECT_PROPOSAL, PLAIN, S.REJECTED),
    Row(S.OFFERED, SEND, P.ACCEPT_PROPOSAL, PLAIN, S.AWARDED),
    Row(S.AWARDED, RECEIVE, P.INFORM, PLAIN, S.DONE),
    Row(S.AWARDED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
)
_NEW_ROUND = Row(S.OFFERED, SEND, P.CFP, PLAIN, S.CALLED)
_ENDED = (S.DONE, S.FAILED, S.REFUSED, S.REJECTED)
_OPEN = pending(S.CALLED, S.OFFERED, S.AWARDED)

CFP = register(cancellable("cfp", _CALL, ended=_ENDED, pending=_OPEN, aliases=("fipa-contract-net",)))

# A new round is a new call, with a reply-with and a reply-by of its own; there is none after an award.
ICFP = register(
    cancellable(
        "icfp",
        (*_CALL, _NEW_ROUND),
        ended=_ENDED,
        pending=_OPEN,
        aliases=("fipa-iterated-contract-net",),
        rounds=(P.CFP,),
    )
)

# What comes of an accepted proposal is not part of this protocol.
PROPOSE = register(
    cancellable(
        "propose",
        [
            Row(S.START, SEND, P.PROPOSE, PLAIN, S.OFFERED),
            Row(S.OFFERED, RECEIVE, P.ACCEPT_PROPOSAL, PLAIN, S.ACCEPTED),
            Row(S.OFFERED, RECEIVE, P.REJECT_PROPOSAL, PLAIN, S.REJECTED),
        ],
        ended=(S.ACCEPTED, S.REJECTED),
        pending=pending(S.OFFERED),
        aliases=("fipa-propose",),
    )
)

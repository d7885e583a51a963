"""`cfp` (contract net, FIPA SC00029H), `icfp` (iterated contract net, SC00030H) and `propose` (SC00036H), with cancel.

A table describes the conversation with one participant; `multicast.py` combines several, whose proposals compete. A
call for proposals has a reply-by; later proposals are rejected. An accepted proposal is binding.
"""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import cancellable, pending
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Row, register

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
"""Contract net (SC00029H)."""

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
"""Iterated contract net (SC00030H).

A new round is a new cfp with its own reply-with and reply-by; none after an award.
"""

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
"""Propose (SC00036H). The performance of an accepted proposal is not part of this protocol."""

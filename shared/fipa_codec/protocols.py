"""FIPA's interaction protocols as tables, in two profiles.

Where the paper's agents do what the specification does, there is one protocol: its name is the
paper's, FIPA's token (`fipa-contract-net`) is an alias. Where they differ there are two: `request`,
`query` and `subscribe` are the paper's, `fipa-request`, `fipa-query` and `fipa-subscribe` those of
the specifications. A conversation has the rules of the name it is opened with. Tests explore every
protocol exhaustively in both roles (`exploration.py`). Independent of agents, languages and time.
"""

from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Row, Table, named, register

__all__ = [
    "BROKERING",
    "CFP",
    "FIPA",
    "FIPA_QUERY",
    "FIPA_REQUEST",
    "FIPA_SUBSCRIBE",
    "ICFP",
    "PAPER",
    "PROPAGATE",
    "PROPOSE",
    "PROTOCOLS",
    "QUERY",
    "RECRUITING",
    "REQUEST",
    "REQUEST_WHEN",
    "SUBSCRIBE",
    "Pending",
    "Profile",
    "Protocol",
    "State",
    "cancellable",
    "mirrored",
    "named",
    "register",
]

PLAIN, PROGRESS, FINAL, CANCEL = Kind.PLAIN, Kind.PROGRESS, Kind.FINAL, Kind.CANCEL


# --- States ---------------------------------------------------------------------------------------


class State(StrEnum):
    """States of both roles. A final state is named after the outcome.

    `cancelling-x`: initiator in x with a pending cancel. `stopping-x`: participant in x that has
    not answered a received cancel.
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


S = State  # for short tables


# --- FIPA's cancel meta-protocol: tables of both roles from the arrows of a protocol diagram ------
# The cancel meta-protocol is the same in all specifications (SC00026H to SC00036H): only the
# initiator may cancel, at any time between the opening and the end; the participant answers the
# cancel with inform (cancelled) or failure (not cancelled). The diagrams do not show messages that
# cross. Exploration of both roles (`exploration.py`) requires:
#
# - the initiator accepts messages that cross its cancel; if one ends the protocol, the answer to
# the cancel still follows;
# - a participant that has ended answers a late cancel with failure; it needs no memory of the
# conversation;
# - while it stops, a participant may still end or send messages that change no state, but it must
# not advance.


class Pending(NamedTuple):
    """The states of both roles between the cancel and its answer, for one open state."""

    initiator: S
    participant: S


def pending(*states: S) -> dict[S, Pending]:
    """The states `cancelling-x` and `stopping-x` for each open state x."""
    return {state: Pending(S(f"cancelling-{state}"), S(f"stopping-{state}")) for state in states}


def mirrored(rows: Iterable[Row]) -> tuple[Row, ...]:
    """The same arrows from the view of the other role."""
    return tuple(row._replace(way=RECEIVE if row.way is SEND else SEND) for row in rows)


def cancellable(
    name: str,
    rows: Iterable[Row],
    *,
    ended: Iterable[S],
    pending: Mapping[S, Pending],
    failure_ends: bool = False,
    aliases: tuple[str, ...] = (),
    rounds: Iterable[P] = (),
    resting: Iterable[S] = (),
) -> Protocol:
    """The protocol of a diagram (`rows`, from the view of the initiator) with cancel.

    `ended`: final states of the diagram. `pending`: its open states after the opening.
    `failure_ends`: whether a failed cancel ends the conversation too; otherwise the conversation
    continues in its state. `resting`: open states that may last for ever.
    """
    arrows, ends, rests = tuple(rows), tuple(ended), tuple(resting)
    mirror, over = mirrored(arrows), (*ends, S.CANCELLED, S.SETTLED)
    return Protocol(
        name,
        initiator=Table(
            (*arrows, *_initiator(arrows, pending, failure_ends)), ended=over, resting=rests
        ),
        participant=Table(
            (*mirror, *_participant(mirror, ends, pending, failure_ends)),
            ended=over,
            urgent=(S.TOO_LATE,),
            resting=rests,
        ),
        aliases=aliases,
        rounds=rounds,
    )


def _initiator(
    arrows: tuple[Row, ...], pending: Mapping[S, Pending], failure_ends: bool
) -> Iterable[Row]:
    for state, (cancelling, _) in pending.items():
        yield Row(state, SEND, P.CANCEL, PLAIN, cancelling)
        for row in arrows:
            if row.state == state and row.way is RECEIVE:
                known = pending.get(S(row.to))
                yield row._replace(state=cancelling, to=known.initiator if known else S.OVERTAKEN)
        yield Row(cancelling, RECEIVE, P.INFORM, CANCEL, S.CANCELLED)
        yield Row(cancelling, RECEIVE, P.FAILURE, CANCEL, S.CANCELLED if failure_ends else state)
    yield Row(S.OVERTAKEN, RECEIVE, P.FAILURE, CANCEL, S.SETTLED)


def _participant(
    arrows: tuple[Row, ...], ends: tuple[S, ...], pending: Mapping[S, Pending], failure_ends: bool
) -> Iterable[Row]:
    for state, (_, stopping) in pending.items():
        yield Row(state, RECEIVE, P.CANCEL, PLAIN, stopping)
        for row in arrows:
            if row.state == state and row.way is SEND and (row.to == state or row.to in ends):
                yield row._replace(state=stopping, to=stopping if row.to == state else S.TOO_LATE)
        yield Row(stopping, SEND, P.INFORM, CANCEL, S.CANCELLED)
        yield Row(stopping, SEND, P.FAILURE, CANCEL, S.CANCELLED if failure_ends else state)
    # A cancel that crossed the last message of the participant, or (start) of a forgotten
    # conversation.
    reached = {row.to for row in arrows if row.way is SEND}
    for state in (S.START, *(end for end in ends if end in reached)):
        yield Row(state, RECEIVE, P.CANCEL, PLAIN, S.TOO_LATE)
    yield Row(S.TOO_LATE, SEND, P.FAILURE, CANCEL, S.SETTLED)


# --- Request: of the specification (SC00026H) and the paper's; request-when (SC00028H) ------------


ANSWERS = (
    Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.AGREED),
    Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
    Row(S.ASKED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
    Row(S.ASKED, RECEIVE, P.INFORM, PLAIN, S.DONE),
    Row(S.AGREED, RECEIVE, P.FAILURE, PLAIN, S.FAILED),
    Row(S.AGREED, RECEIVE, P.INFORM, PLAIN, S.DONE),
)
"""Rows of the answers to a request or a query (SC00026H, SC00027H), from the view of the
initiator.
"""
ENDED = (S.DONE, S.FAILED, S.REFUSED)
"""States after the last of them."""
OPEN = {
    S.ASKED: Pending(S.CANCELLING_ASKED, S.STOPPING_ASKED),
    S.AGREED: Pending(S.CANCELLING, S.STOPPING),
}
"""States in which the initiator may cancel."""

_OPENING = Row(S.START, SEND, P.REQUEST, PLAIN, S.ASKED)

FIPA_REQUEST = register(
    cancellable("fipa-request", [_OPENING, *ANSWERS], ended=ENDED, pending=OPEN)
)
"""Request (SC00026H).

agree may be omitted if the result is immediate. The result is the only inform: progress is told by
a subscription.
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

A failure in reply to the cancel ends the conversation too, since the act is over: a participant
that cannot stop its act completes it first and then answers the cancel.
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


# --- Query: whether a proposition holds (query-if), which object a descriptor denotes (query-ref) -
# `fipa-query` is that of the specification (SC00027H). `query` is the paper's. There the answer is
# immediate, so there is neither agree nor cancel; an initiator that needs no answer any more
# ignores it. The query may be repeated with the same m_w until it is answered: each copy may be
# answered, and later answers are ignored. The paper answers with `inform-ref` (Table 8), a macro
# act that the specification does not send (SC00037J); `query` has rows for it and for inform.


_ANSWERS = (
    (P.INFORM, S.DONE),
    (P.INFORM_REF, S.DONE),
    (P.REFUSE, S.REFUSED),
    (P.FAILURE, S.FAILED),
)
_QUERIES = (P.QUERY_REF, P.QUERY_IF)
_QUERY_ENDED = (S.DONE, S.REFUSED, S.FAILED)

_query_initiator = Table(
    [
        *(
            Row(state, SEND, query, PLAIN, S.ASKED)
            for query in _QUERIES
            for state in (S.START, S.ASKED)
        ),
        *(Row(S.ASKED, RECEIVE, answer, PLAIN, end) for answer, end in _ANSWERS),
        *(Row(end, RECEIVE, answer, PLAIN, end) for answer, _ in _ANSWERS for end in _QUERY_ENDED),
    ],
    ended=_QUERY_ENDED,
)

_query_participant = Table(
    [
        *(
            Row(state, RECEIVE, q, PLAIN, S.ASKED)
            for q in _QUERIES
            for state in (S.START, S.ASKED, *_QUERY_ENDED)
        ),
        *(Row(S.ASKED, SEND, answer, PLAIN, end) for answer, end in _ANSWERS),
    ],
    ended=_QUERY_ENDED,
)

QUERY = register(Protocol("query", initiator=_query_initiator, participant=_query_participant))
"""The paper's query."""

FIPA_QUERY = register(
    cancellable(
        "fipa-query",
        [*(Row(S.START, SEND, query, PLAIN, S.ASKED) for query in _QUERIES), *ANSWERS],
        ended=ENDED,
        pending=OPEN,
    )
)
"""Query (SC00027H); agree may be omitted if the answer is immediate."""


# --- Subscription: of the specification (SC00035H) and the paper's, which is soft state -----------
# A live subscription may last for ever. In the paper's the initiator repeats subscribe, with the
# same m_w, until it is answered; the participant then repeats its answer. A participant answers the
# cancel in the same step, and a failed cancel ends the subscription.


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

SUBSCRIBE = register(
    Protocol("subscribe", initiator=_subscribe_initiator, participant=_subscribe_participant)
)
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


# --- Contract net (SC00029H), iterated contract net (SC00030H) and propose (SC00036H) -------------
# A table describes the conversation with one participant; `multicast.py` combines several, whose
# proposals compete. A call for proposals has a reply-by; later proposals are rejected. An accepted
# proposal is binding.


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

CFP = register(
    cancellable("cfp", _CALL, ended=_ENDED, pending=_OPEN, aliases=("fipa-contract-net",))
)
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


# --- Brokering (SC00033H) and recruiting (SC00034H), and the one message propagate (SC00037J) -----
# The participant is the broker. Its messages to the target agents are another conversation, with
# another id, in the protocol of the embedded message; `proxying.py` connects the two. A broker
# relays the answers of the targets; in recruiting they answer the initiator, or the receiver that
# it designated, directly.


_SEARCH = (
    Row(S.START, SEND, P.PROXY, PLAIN, S.ASKED),
    Row(S.ASKED, RECEIVE, P.REFUSE, PLAIN, S.REFUSED),
    Row(S.ASKED, RECEIVE, P.AGREE, PLAIN, S.SEARCHING),
    Row(S.SEARCHING, RECEIVE, P.FAILURE, PLAIN, S.FAILED),  # no target found, or none reached
)
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
        ended=ENDED,
        pending=pending(S.ASKED, S.SEARCHING, S.RELAYING),
        aliases=("fipa-brokering",),
    )
)
"""Brokering (SC00033H).

The standard says that answers are relayed, but not which one is the last: inform[final] is added. A
broker that does not send it continues until the initiator cancels.
"""

RECRUITING = register(
    cancellable(
        "recruiting",
        (*_SEARCH, Row(S.SEARCHING, RECEIVE, P.INFORM, PLAIN, S.DONE)),
        ended=ENDED,
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

The target treats the embedded message as sent by the sender of that message, and answers that
agent.
"""


# --- All of them, in two profiles -----------------------------------------------------------------


FIPA = (
    FIPA_REQUEST,
    REQUEST_WHEN,
    FIPA_QUERY,
    FIPA_SUBSCRIBE,
    CFP,
    ICFP,
    PROPOSE,
    BROKERING,
    RECRUITING,
)
"""The interaction protocols of SC00026H to SC00036H without the auctions, which remained
experimental.
"""

PAPER = (REQUEST, REQUEST_WHEN, QUERY, SUBSCRIBE, CFP, ICFP, PROPOSE, BROKERING, RECRUITING)
"""The same, as the paper's agents have them."""

PROTOCOLS = tuple(dict.fromkeys((*FIPA, *PAPER)))
"""Those of both profiles, each once."""


class Profile(StrEnum):
    """Owner of the protocols that FIPA's tokens (`fipa-request`) mean in a text of another
    platform.
    """

    FIPA = "fipa"
    """Those of the specifications."""
    PAPER = "paper"
    """Those of the paper: `fipa-request` is read as `request`, and a query is answered with
    inform-ref.
    """

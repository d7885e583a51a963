"""Whether a waiting message is in sequence, and what the runtime does with one that is not.

Nothing a peer says kills an agent. In sequence: it goes to the behaviour. A cancel that came too
late is answered as its protocol demands. A question asked again gets its answer again. What is
wrong on a durable stream, or as an opening, is answered not-understood, which ends the conversation
on both sides. Volatile strays are dropped: copies and late answers are normal there.
"""

from enum import StrEnum

import msgspec
from msgspec.structs import replace

from agent_runtime.core import streams
from agent_runtime.core.duplicate_digests import note, receipt
from agent_runtime.core.effects import Out, Receipt
from agent_runtime.core.events import Broken, Received
from agent_runtime.core.reception import reject
from agent_runtime.core.state import CoreState, Held, Waiting, age
from agent_runtime.core.turn import dispatch
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import RemoteProtocolError
from fipa_codec.languages import REASON, Kind, Reason
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Role


class What(StrEnum):
    TAKE = "take"
    REPEAT = "asked again"
    LATE_CANCEL = "late cancel"
    DROP = "stray"
    REFUSE = "not understood"


class Verdict(msgspec.Struct, frozen=True):
    """`held`: the conversation after the message (TAKE, LATE_CANCEL), or as it was (REPEAT,
    REFUSE).

    `kind`: which use of its performative the message makes (TAKE).
    """

    what: What
    held: Held | None = None
    error: RemoteProtocolError | None = None
    kind: Kind = Kind.PLAIN


# Before Python 3.12 a member found by its class takes 0.1 us.
_DURABLE, _LATEST = Delivery.DURABLE, Delivery.LATEST
_INITIATOR, _PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT
_CANCEL, _TAKE = Performative.CANCEL, What.TAKE


def judge(state: CoreState, waiting: Waiting) -> Verdict:
    """What is to be done with a message; nothing is changed."""
    communicate: Communicate = waiting.event.communicate
    held = state.held(communicate.conversation, communicate.sender)
    try:
        if held is None:
            return _judge_new(state, waiting, communicate)
        if waiting.fault is not None:
            return Verdict(What.REFUSE, held, waiting.fault)
        talk = held.conversation
        if (
            held.delivery is not _DURABLE
            and talk.role is _PARTICIPANT
            and communicate.performative in named(talk.protocol).openings
            and communicate.reply_with == talk.asked
        ):
            return Verdict(What.REPEAT, held)
        talk = talk.receive(communicate, waiting.kind)
    except RemoteProtocolError as error:
        durable = waiting.number > 0
        return Verdict(What.REFUSE if durable else What.DROP, held if durable else None, error)
    kind = held.conversation.kind_of(
        communicate.performative, communicate.in_reply_to, waiting.kind
    )
    return Verdict(_TAKE, replace(held, conversation=talk), kind=kind)


def _judge_new(state: CoreState, waiting: Waiting, communicate: Communicate) -> Verdict:
    link: Link = waiting.link
    opening = communicate.performative in named(link.protocol).openings
    if link.role is _INITIATOR or not (opening or communicate.performative is _CANCEL):
        return Verdict(What.DROP, error=RemoteProtocolError("conversation", "is not open here"))
    if waiting.fault is not None:
        return Verdict(What.REFUSE, error=waiting.fault)
    if opening and (communicate.sender, communicate.conversation) in state.soft.over:
        error = RemoteProtocolError("conversation", "has ended; its last word was said")
        return Verdict(What.DROP, error=error)
    if opening and link.delivery is _LATEST and _outlived(state, communicate):
        error = RemoteProtocolError("conversation", "a newer subscription took its place")
        return Verdict(What.DROP, error=error)
    try:
        talk = Conversation.answering(communicate, state.agent).receive(communicate, waiting.kind)
    except RemoteProtocolError as error:
        return Verdict(What.REFUSE, error=error)
    return Verdict(What.TAKE if opening else What.LATE_CANCEL, Held(talk, link.delivery))


def _outlived(state: CoreState, communicate: Communicate) -> bool:
    """Whether a subscription is a late copy of one that its subscriber replaced by a newer one.

    A subscriber asks again until agreed, so copies of its older `subscribe` may come in after the
    newer one. To take one would send the observations into a conversation that no agent holds, for
    ever. A subscription of the present life is newer than all others: a subscriber whose journal
    was lost counts its lives from 1 again.
    """
    alive = state.soft.peers.get(communicate.sender)

    def rank(name: str) -> tuple[bool, int, int]:
        incarnation, counter = age(name) or (0, 0)
        return incarnation == alive, incarnation, counter

    every = state.soft.conversations.values()
    held = (one.conversation.id for one in every if _same_subscriber(one, communicate))
    return any(rank(name) > rank(communicate.conversation) for name in held)


def _same_subscriber(held: Held, communicate: Communicate) -> bool:
    talk = held.conversation
    same = (talk.peer, talk.protocol) == (communicate.sender, communicate.protocol)
    return same and held.delivery is _LATEST and talk.role is _PARTICIPANT


def carry_out(
    state: CoreState, out: Out, wiring: Wiring, waiting: Waiting, verdict: Verdict, now: float
) -> Received | Broken | None:
    """Count the message as taken, carry the verdict out; return the event for the behaviour, None
    if there is none.
    """
    communicate: Communicate = waiting.event.communicate
    if waiting.number:
        note(state, waiting.peer, waiting.number, waiting.digest)
        out.receipts.append(receipt(state, waiting.peer))
        out.durable = True
    elif waiting.subject:
        state.versions[waiting.peer] = state.versions.get(waiting.peer, {}) | {
            waiting.subject: waiting.version
        }
        out.receipts.append(Receipt(waiting.peer, subject=waiting.subject, version=waiting.version))
        out.durable = True
    held = verdict.held
    match verdict.what:
        case What.TAKE if held is not None:
            return _take(state, out, waiting, held)
        case What.REPEAT if held is not None:
            state.count(What.REPEAT)
            if held.answer is not None:
                streams.send(state, out, held.answer)
                streams.send_due(state, out, wiring, communicate.sender, now)
        case What.LATE_CANCEL if held is not None:
            state.count(What.LATE_CANCEL)
            _answer_late_cancel(state, out, wiring, held, now)
        case What.REFUSE:
            return _refuse(state, out, wiring, waiting, verdict, now)
        case _:
            why = str(verdict.error)
            if waiting.number:
                reject(state, out, communicate, What.DROP, why)
            else:
                state.count(What.DROP)
                if waiting.link.role is _INITIATOR:
                    # perhaps its last word
                    out.receipts.append(Receipt(communicate.sender, subject=communicate.id))
    return None


def _take(state: CoreState, out: Out, waiting: Waiting, held: Held) -> Received:
    """Keep the conversation after a message in sequence."""
    talk, asks = held.conversation, state.soft.asks
    communicate: Communicate = waiting.event.communicate
    volatile = not (waiting.number or waiting.subject)
    if volatile and talk.ended and talk.role is _INITIATOR and talk.id not in asks:
        # It ends a conversation in which this agent asks no more: it is repeated until receipted.
        out.receipts.append(Receipt(communicate.sender, subject=communicate.id))
    if not talk.cancel or talk.ended:  # what crosses a cancel is not an answer to it
        asks.pop(communicate.conversation, None)
    # a subscriber's new conversation replaces its older one
    if held.delivery is _LATEST and talk.role is _PARTICIPANT:
        for name, other in list(state.soft.conversations.items()):
            if name != talk.id and _same_subscriber(other, communicate):
                del state.soft.conversations[name]
    state.keep(held)
    return Received(communicate, waiting.content, talk)


def _answer_late_cancel(state: CoreState, out: Out, wiring: Wiring, held: Held, now: float) -> None:
    """Answer a late cancel: `request` and `subscribe` demand a failure; `coordinate` drops it."""
    talk = held.conversation
    if not talk.owes:
        return
    reason = Reason("the conversation has ended, or never was")
    durable = held.delivery is _DURABLE
    talk, communicate = talk.send(
        Performative.FAILURE,
        id=streams.next_id(state, talk.peer, durable),
        now=now,
        content=REASON.encode(reason),
        language=REASON.name,
        kind=Kind.CANCEL,
    )
    dispatch(state, out, wiring, replace(held, conversation=talk), communicate, now)


def _refuse(
    state: CoreState, out: Out, wiring: Wiring, waiting: Waiting, verdict: Verdict, now: float
) -> Broken | None:
    """Answer not-understood with the reason; end the conversation it was said in, and tell the
    behaviour.
    """
    communicate: Communicate = waiting.event.communicate
    error = verdict.error or RemoteProtocolError("", "not understood")
    reject(state, out, communicate, What.REFUSE, str(error))
    durable = waiting.number > 0
    answer = Communicate(
        performative=error.performative,
        content=REASON.encode(Reason(error.reason, error.field)),
        language=REASON.name,
        protocol=communicate.protocol,
        in_reply_to=communicate.reply_with,
        conversation=communicate.conversation,
        sender=state.agent,
        receiver=communicate.sender,
        id=streams.next_id(state, communicate.sender, durable),
        sent=now,
    )
    if durable:
        streams.issue(state, out, answer, now)
    else:
        streams.send(state, out, answer)
    if verdict.held is None:
        return None
    held = verdict.held
    for place in (state.conversations, state.soft.conversations, state.soft.asks):
        place.pop(held.key, None)
    return Broken(held.conversation.id, str(error), held.conversation.peer if held.several else "")

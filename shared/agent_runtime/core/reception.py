"""Reception of an event, before anything is taken: bookkeeping of streams, peers, orders and the
router.

What the behaviour is to be told is put into the inbox.
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import Any

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from agent_runtime.core import control, peers, streams
from agent_runtime.core.agent import Agent
from agent_runtime.core.errors import BehaviourError
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Broken,
    Garbled,
    LinkChanged,
    Local,
    Next,
    Ordered,
    Out,
    PeerChanged,
    Receipt,
    Receipted,
    Received,
    Settled,
    Started,
    Tick,
)
from agent_runtime.core.state import CoreState, Held, Waiting, age
from agent_runtime.core.streams import (
    digest_of,
    follows,
    parse_observation,
    receipt,
    refuse,
    taken_before,
    tell,
    too_far,
)
from agent_runtime.core.turn import dispatch
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.communicate import LONGEST_LABEL, Communicate, number_of
from fipa_codec.conversation import Conversation
from fipa_codec.errors import RemoteProtocolError
from fipa_codec.languages import REASON, Kind, Reason
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Role

# --- Intake of a message: it is kept for its turn, receipted again, or dropped and counted --------
# Durable: only the next number of the sender's stream is kept; a copy of an older one is receipted
# again, another message under its number is refused (streams); a gap is dropped without
# receipt, so it comes again. Observations: only a newer version of the subject, and only in a
# conversation that is held. Volatile: every message but copies of a waiting one, up to a bound.
# Nothing is answered here: answers follow the order of the stream.


# Before Python 3.12 a member found by its class takes 0.1 us.
_DURABLE, _LATEST, _VOLATILE = Delivery.DURABLE, Delivery.LATEST, Delivery.VOLATILE
_INITIATOR, _PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT
HELD_OF_STREAM = 16
"""Waiting messages of one stream; as many as its sender's outbox holds."""
HELD_VOLATILE = 256
HELD_BYTES = 16 * 1024 * 1024
"""Waiting volatile messages of a sender, and their contents; estimates. One beyond is dropped, its
sender asks again.
"""


def admit(state: CoreState, out: Out, wiring: Wiring, arrived: Arrived) -> None:
    """Put a communicate into the inbox, or receipt or drop it at once."""
    communicate = arrived.communicate
    link = wiring.link(communicate.sender, communicate.protocol)
    if communicate.receiver != state.agent or link is None:
        reject(
            state,
            out,
            communicate,
            "not for us",
            f"no {communicate.protocol[:64]!r} with {communicate.sender[:64]!r}",
        )
    elif link.delivery is _DURABLE:
        _admit_durable(state, out, wiring, link, arrived)
    elif (
        link.delivery is _LATEST
        and link.role is _INITIATOR
        and communicate.performative is Performative.INFORM
        and "@" in communicate.id
    ):
        _admit_observation(state, out, wiring, link, communicate)
    else:
        _admit_volatile(state, out, wiring, link, communicate)


def reject(state: CoreState, out: Out, communicate: Communicate, what: str, why: str) -> None:
    """Count and log a message that is dropped."""
    state.count(what)
    out.log(
        what,
        level="warning",
        conversation=communicate.conversation[:LONGEST_LABEL],
        sender=communicate.sender[:LONGEST_LABEL],
        performative=str(communicate.performative),
        id=communicate.id[:LONGEST_LABEL],
        why=why,
    )


def _admit_durable(
    state: CoreState, out: Out, wiring: Wiring, link: Link, arrived: Arrived
) -> None:
    communicate, peer = arrived.communicate, arrived.communicate.sender
    number, taken = number_of(communicate.id), state.taken.get(peer, 0)
    if not number:
        reject(
            state,
            out,
            communicate,
            "no stream number",
            "a durable communicate has its stream's number as id",
        )
        return
    waiting = [one for one in state.soft.inbox if one.number and one.peer == peer]
    last = waiting[-1].number if waiting else taken
    if number <= taken:
        taken_before(state, out, communicate, number)
    elif number <= last:
        state.count("waiting already")
        if digest_of(communicate) not in [one.digest for one in waiting]:
            tell(state, out, communicate, "waits to be taken")
        # the sender learns that it is heard, though not its turn
        out.receipts.append(receipt(state, peer))
    elif len(waiting) < HELD_OF_STREAM and follows(state, arrived, waiting, number, last):
        digest = digest_of(communicate)
        _wait(state, wiring, link, communicate, peer=peer, number=number, digest=digest)
    else:
        state.count("gap")
        if not waiting and too_far(state, arrived, number, last):
            refuse(state, out, peer, digest_of(communicate))


def _admit_observation(
    state: CoreState, out: Out, wiring: Wiring, link: Link, communicate: Communicate
) -> None:
    peer, parsed = communicate.sender, parse_observation(communicate.id)
    held = state.soft.conversations.get(communicate.conversation)
    if parsed is None or held is None:
        state.count("observation of no subscription")
        return
    subject, version = parsed
    if version <= state.versions.get(peer, {}).get(subject, (0, 0)):
        state.count("observed before")
        out.receipts.append(Receipt(peer, subject=subject, version=version))
        return
    older = [one for one in state.soft.inbox if one.peer == peer and one.subject == subject]
    if any(one.version >= version for one in older):
        return
    state.soft.inbox = tuple(one for one in state.soft.inbox if one not in older)
    _wait(state, wiring, link, communicate, peer=peer, subject=subject, version=version)


def _admit_volatile(
    state: CoreState, out: Out, wiring: Wiring, link: Link, communicate: Communicate
) -> None:
    inbox, peer = state.soft.inbox, communicate.sender
    volatile = (one for one in inbox if isinstance(one.event, Arrived) and not one.number)
    waiting = [one for one in volatile if one.peer == peer]
    same = [one for one in waiting if one.event.communicate.id == communicate.id]
    if any(one.event.communicate.conversation == communicate.conversation for one in same):
        state.count("waiting already")
    elif len(waiting) >= HELD_VOLATILE:
        reject(
            state,
            out,
            communicate,
            "inbox full",
            f"{HELD_VOLATILE} volatile messages of it wait already",
        )
    elif (
        waiting
        and sum(_size(one.event.communicate) for one in waiting) + _size(communicate) > HELD_BYTES
    ):
        reject(
            state,
            out,
            communicate,
            "inbox full",
            f"{HELD_BYTES >> 20} MiB of volatile messages of it wait already",
        )
    else:
        _wait(state, wiring, link, communicate, peer=peer)


def _size(communicate: Communicate) -> int:
    return 0 if communicate.content is UNSET else len(communicate.content)


def _wait(
    state: CoreState, wiring: Wiring, link: Link, communicate: Communicate, **place: Any
) -> None:
    fault: RemoteProtocolError | None = None
    try:
        content, kind = wiring.languages.read(communicate)
        name = f"{communicate.language}.{type(content).__name__}" if content is not None else ""
        link.require_heard(communicate.performative, name)
    except RemoteProtocolError as error:
        content, kind, fault = None, Kind.PLAIN, error
    event = Arrived(communicate)
    waiting = Waiting(event, link=link, content=content, kind=kind, fault=fault, **place)
    _queue(state, waiting)


# --- Reception of an event, before anything is taken ----------------------------------------------


REFUSED = "order refused"


def note(
    agent: Agent[Any], wiring: Wiring, state: CoreState, out: Out, event: AnyEvent, now: float
) -> None:
    """Take note of an event, and queue what the behaviour is to be told. Raises BehaviourError for
    another event.
    """
    match event:
        case Arrived():
            _arrive(wiring, state, out, event, now)
        case Local():
            _queue(state, Waiting(event))
        case Receipted(peer=peer):
            if _settles(wiring, state, out, event, now):
                _queue(state, Waiting(Settled(peer), forced=True))
        case PeerChanged():
            _note_peer(wiring, state, out, event, now)
            _queue(state, Waiting(event, forced=True))
        case LinkChanged(up=up):
            state.soft.up = up
            out.log("links open" if up else "links closed")
            _flush(wiring.peers if up else (), wiring, state, out, now)
        case Started():
            _queue(state, Waiting(event, forced=True))
            _flush(wiring.peers, wiring, state, out, now)
        case Garbled(key=key, reason=reason, forged=forged):
            what = "forged" if forged else "garbled"
            state.count(what)
            out.log(what, level="warning", key=key, why=reason)
        case Tick():
            streams.on_time(state, out, wiring, now)
            _forget_unanswered(state, now)
        case Ordered():
            _obey(agent, state, out, event)
        case Next():
            pass
        case _:
            wrong = f"was stepped with {event!r}"
            raise BehaviourError(agent.name, state.state, wrong, "that is the core's own")


def _arrive(wiring: Wiring, state: CoreState, out: Out, event: Arrived, now: float) -> None:
    """Admit a message that is between the present journals of both."""
    sender = event.communicate.sender
    if event.journal and not peers.fits(state, out, sender, event.journal, event.believed):
        return
    if not (event.journal and peers.shortened(state, out, sender, event.heard, now)):
        admit(state, out, wiring, event)


def _obey(agent: Agent[Any], state: CoreState, out: Out, event: Ordered) -> None:
    """Obey an order, or say why not; either way the answer names it. Of a copy the behaviour is not
    told again.
    """
    command, parameters = event.command, agent.parameters
    order, copy = control.worded(command.order), command.id == state.soft.answer.id
    try:
        settings = control.obeyed(state.now_set, command.order, parameters)
    except ValueError as error:
        state.count(REFUSED)
        out.log(REFUSED, level="warning", order=order, why=str(error))
        state.soft.answer = control.Answer(command.id, str(error))
        return
    state.settings, state.soft.answer = settings, control.Answer(command.id)
    state.soft.parameters = control.values(settings, parameters)[0]
    out.durable = True
    out.log("ordered", order=order)
    if isinstance(command.order, control.SetParameter) and not copy:
        _queue(state, Waiting(event, forced=True))


def _settles(wiring: Wiring, state: CoreState, out: Out, event: Receipted, now: float) -> bool:
    """Take a receipt of the present journal. Whether it covers the last observation due."""
    told = bool(event.life) and not event.answer
    if event.journal and not peers.fits(state, out, event.peer, event.journal, event.believed):
        if told and event.life == state.incarnation:
            peers.renamed(state, out, event, now)
        return False
    if peers.shortened(state, out, event.peer, event.heard, now):
        return False
    if told:
        out.receipts.append(replace(receipt(state, event.peer), life=event.life, answer=True))
    elif event.answer and state.soft.untold.get(event.peer) == event.life:
        del state.soft.untold[event.peer]
        if not (state.outbox.get(event.peer) or state.due.get(event.peer)):
            state.soft.resend.pop(event.peer, None)
    emptied = streams.settle(state, out, wiring, event, now)
    streams.look(state, out, event, now)
    return emptied


def _note_peer(wiring: Wiring, state: CoreState, out: Out, event: PeerChanged, now: float) -> None:
    if event.incarnation is None:
        state.soft.peers.pop(event.agent, None)
        state.soft.untold.pop(event.agent, None)
        streams.forget_last(state, event.agent)
    else:
        if state.soft.peers.get(event.agent, event.incarnation) != event.incarnation:
            streams.forget_last(state, event.agent)
        state.soft.peers[event.agent] = event.incarnation
        news = peers.met(state, out, event.agent, event.journal)
        if state.heard.get(event.agent) or event.journal in state.given_up:
            state.soft.untold[event.agent] = event.incarnation
        streams.flush(state, out, wiring, event.agent, now, force=news)


def _flush(peers: Sequence[str], wiring: Wiring, state: CoreState, out: Out, now: float) -> None:
    for peer in peers:
        streams.flush(state, out, wiring, peer, now, force=True)


def _forget_unanswered(state: CoreState, now: float) -> None:
    """Drop questions of peers left unanswered until their reply-by: no peer waits for them any
    more.
    """
    for name, held in list(state.soft.conversations.items()):
        talk = held.conversation
        if held.delivery is _VOLATILE and talk.role is _PARTICIPANT and talk.late(now):
            state.count("left unanswered")
            del state.soft.conversations[name]


def _queue(state: CoreState, waiting: Waiting) -> None:
    state.soft.inbox = (*state.soft.inbox, waiting)


# --- Whether a waiting message is in sequence, and what is done with one that is not --------------
# Nothing a peer says kills an agent. In sequence: it goes to the behaviour. A cancel that came too
# late is answered as its protocol demands. A question asked again gets its answer again. What is
# wrong on a durable stream, or as an opening, is answered not-understood, which ends the
# conversation on both sides. Volatile strays are dropped: copies and late answers are normal there.


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
        streams.note(state, waiting.peer, waiting.number, waiting.digest)
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

"""Reception of an event, before anything is taken: bookkeeping of streams, peers, orders and the
router.

What the behaviour is to be told is put into the inbox.
"""

from collections.abc import Sequence
from typing import Any

from msgspec import UNSET
from msgspec.structs import replace

from agent_runtime.core import control, lineage, streams
from agent_runtime.core.agent import Agent
from agent_runtime.core.duplicate_digests import (
    JUMP,
    digest_of,
    follows,
    receipt,
    refuse,
    taken_before,
    tell,
    too_far,
)
from agent_runtime.core.effects import Out, Receipt
from agent_runtime.core.errors import BehaviourError
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Garbled,
    LinkChanged,
    Local,
    Next,
    Ordered,
    PeerChanged,
    Receipted,
    Settled,
    Started,
    Tick,
)
from agent_runtime.core.state import CoreState, Lost, Outgoing, Waiting
from agent_runtime.core.streams import parse_observation
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.communicate import LONGEST_LABEL, MOST_DIGITS, Communicate, number_of
from fipa_codec.errors import RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

# --- Intake of a message: it is kept for its turn, receipted again, or dropped and counted --------
# Durable: only the next number of the sender's stream is kept; a copy of an older one is receipted
# again, another message under its number is refused (duplicate_digests); a gap is dropped without
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


# --- Renumbering: a sender whose numbers another used for its messages sends its own again, under
# new numbers
# Whoever has this agent's key can do so. The receiver's receipt names the message that it took by
# its digest (duplicate_digests), or says that one was refused. Order is kept: what follows a
# refused message in the outbox gets new numbers, too, and each message says which one it follows.
# With each message that is refused the new numbers lie farther ahead, so a thief who always uses
# the next number is passed; after AT_ONCE tries without one that is taken, the next is made when it
# is time to re-send. Where the receiver cannot know any more whether a message was taken, it is not
# sent again: its conversation is lost, and the behaviour is told.


AT_ONCE = 5
FARTHER = 16
"""New numbers lie 0, 15, 255, 4095, 32767 beyond the next one: a thief sends a few in a round trip
(estimate).
"""
MOST = 10**MOST_DIGITS - 2 * JUMP
"""Numbers beyond it are of a receiver that lies: none could follow them."""


def look(state: CoreState, out: Out, event: Receipted, now: float) -> None:
    """After the messages that a receipt covers are settled: see whether it is for another's, or
    refuses one.
    """
    peer, taken = event.peer, event.taken
    if event.subject or not (event.digest or event.refused) or not 0 <= taken <= MOST:
        return
    sent, issued = state.outbox.get(peer, ()), state.issued.get(peer, 0)
    place = next((at for at, one in enumerate(sent) if _another_taken(one, event)), None)
    if place is None:
        if taken > issued:
            _tell(state, out, peer, f"took number {taken}, and this agent's last word has {issued}")
            state.issued[peer] = taken if taken <= issued + JUMP else issued
    elif event.unknown:
        _give_up(state, out, peer, place, taken, now)
    else:
        _renumber(state, out, peer, place, taken, now)


def _another_taken(one: Outgoing, event: Receipted) -> bool:
    """Whether a receipt says that another message has the number of this one, or that it is too far
    on.
    """
    if event.refused:
        near = event.taken < one.number <= event.taken + JUMP
        return not near and digest_of(one.communicate) == event.refused
    return one.number == event.taken


def _renumber(state: CoreState, out: Out, peer: str, place: int, taken: int, now: float) -> None:
    """Send the message at this place of the outbox, and what follows it, under numbers after the
    last one taken.
    """
    sent, soft = state.outbox[peer], state.soft
    tries = soft.renumbered.get(peer, 0)
    kept = sent[:place]
    first = max(taken, kept[-1].number if kept else 0) + min(FARTHER**tries, JUMP // 2)
    again = enumerate((one.communicate for one in sent[place:]), first)
    moved = tuple(Outgoing(number, replace(one, id=str(number))) for number, one in again)
    why = (
        f"took another word than this agent's as number {sent[place].number}; it is said again as"
        f" {first}"
    )
    _tell(state, out, peer, why)
    state.outbox[peer] = (*kept, *moved)
    state.issued[peer] = moved[-1].number
    soft.renumbered[peer] = tries + 1
    out.durable = True
    if tries < AT_ONCE:
        for one in moved:
            streams.send(state, out, one.communicate)
        soft.resend[peer] = (now + streams.RESEND_FIRST, streams.RESEND_FIRST)


def _give_up(state: CoreState, out: Out, peer: str, place: int, taken: int, now: float) -> None:
    """Never send the message at this place again, nor what follows in its conversation, which is
    lost.
    """
    sent = state.outbox[peer]
    given_up = sent[place].communicate
    why = (
        f"does not know any more whether it took number {given_up.id} from this agent or from"
        " another"
    )
    _tell(state, out, peer, f"{why}; the conversation is over")
    for key, held in list(state.conversations.items()):
        if (held.conversation.peer, held.conversation.id) == (peer, given_up.conversation):
            state.lost[key] = Lost(
                held, f"{peer} {why}; perhaps it was done, look before you say it again"
            )
            del state.conversations[key]
    rest = tuple(
        one for one in sent[place + 1 :] if one.communicate.conversation != given_up.conversation
    )
    streams.put(state.outbox, peer, (*sent[:place], *rest))
    out.durable = True
    if rest:
        _renumber(state, out, peer, place, taken, now)
    else:
        state.issued[peer] = max(taken, state.issued[peer])


def _tell(state: CoreState, out: Out, peer: str, what: str) -> None:
    me = state.agent
    why = (
        f"{peer} {what}: somebody else speaks with {me}'s key, or its journal is an old copy; `roco"
        f" keys revoke {me}`"
    )
    state.count("another speaker")
    out.log("another speaker", level="error", peer=peer, why=why)


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
    if event.journal and not lineage.fits(state, out, sender, event.journal, event.believed):
        return
    if not (event.journal and lineage.shortened(state, out, sender, event.heard, now)):
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
    if event.journal and not lineage.fits(state, out, event.peer, event.journal, event.believed):
        if told and event.life == state.incarnation:
            lineage.renamed(state, out, event, now)
        return False
    if lineage.shortened(state, out, event.peer, event.heard, now):
        return False
    if told:
        out.receipts.append(replace(receipt(state, event.peer), life=event.life, answer=True))
    elif event.answer and state.soft.untold.get(event.peer) == event.life:
        del state.soft.untold[event.peer]
        if not (state.outbox.get(event.peer) or state.due.get(event.peer)):
            state.soft.resend.pop(event.peer, None)
    emptied = streams.settle(state, out, wiring, event, now)
    look(state, out, event, now)
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
        news = lineage.met(state, out, event.agent, event.journal)
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

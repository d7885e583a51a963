"""Reception of an event, before anything is taken: bookkeeping of streams, peers, orders and the router.

What the behaviour is to be told is put into the inbox.
"""

from typing import Any

from msgspec.structs import replace

from agent_runtime.core import control, lineage, streams
from agent_runtime.core.agent import Agent
from agent_runtime.core.effects import Out
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
from agent_runtime.core.intake import admit
from agent_runtime.core.recent import JUMP, digest, receipt
from agent_runtime.core.state import CoreState, Lost, Outgoing, Waiting
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.communicate import MOST_DIGITS
from fipa_codec.tables import Role

# --- Renumbering: a sender whose numbers another used for its words says its own words again, under new numbers ------
# Whoever has this agent's key can do so. The receiver's receipt names the word that it took by its digest (recent),
# or says that a word was refused. Order is kept: what follows a refused word in the outbox gets new numbers, too, and
# each word says which one it follows. With each word that is refused the new numbers lie farther ahead, so a thief
# who always says the next number is passed; after AT_ONCE tries without one that is taken, the next is made when it
# is time to re-send. Where the receiver cannot know any more whether a word was taken, it is not said again: its
# conversation is lost, and the behaviour is told.


AT_ONCE = 5
FARTHER = 16
"""New numbers lie 0, 15, 255, 4095, 32767 beyond the next one: a thief says a few words in a round trip (estimate)."""
MOST = 10**MOST_DIGITS - 2 * JUMP
"""Numbers beyond it are of a receiver that lies: none could follow them."""


def look(state: CoreState, out: Out, event: Receipted, now: float) -> None:
    """After the words that a receipt covers are settled: see whether it is for another's word, or refuses one."""
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
    """Whether a receipt says that another word has the number of this one, or that it is too far on."""
    if event.refused:
        return digest(one.communicate) == event.refused and not event.taken < one.number <= event.taken + JUMP
    return one.number == event.taken


def _renumber(state: CoreState, out: Out, peer: str, place: int, taken: int, now: float) -> None:
    """Say the word at this place of the outbox, and what follows it, again, under numbers after the last one taken."""
    sent, soft = state.outbox[peer], state.soft
    tries = soft.renumbered.get(peer, 0)
    kept = sent[:place]
    first = max(taken, kept[-1].number if kept else 0) + min(FARTHER**tries, JUMP // 2)
    moved = tuple(_numbered(one, first + at) for at, one in enumerate(sent[place:]))
    why = f"took another word than this agent's as number {sent[place].number}; it is said again as {first}"
    _tell(state, out, peer, why)
    state.outbox[peer] = (*kept, *moved)
    state.issued[peer] = moved[-1].number
    soft.renumbered[peer] = tries + 1
    out.durable = True
    if tries < AT_ONCE:
        for one in moved:
            streams.send(state, out, one.communicate)
        soft.resend[peer] = (now + streams.RESEND_FIRST, streams.RESEND_FIRST)


def _numbered(one: Outgoing, number: int) -> Outgoing:
    return Outgoing(number, replace(one.communicate, id=str(number)))


def _give_up(state: CoreState, out: Out, peer: str, place: int, taken: int, now: float) -> None:
    """Say the word at this place never again, nor what follows in its conversation, which is lost."""
    sent = state.outbox[peer]
    word = sent[place].communicate
    why = f"does not know any more whether it took number {word.id} from this agent or from another"
    _tell(state, out, peer, f"{why}; the conversation is over")
    for key, held in list(state.conversations.items()):
        if (held.conversation.peer, held.conversation.id) == (peer, word.conversation):
            state.lost[key] = Lost(held, f"{peer} {why}; perhaps it was done, look before you say it again")
            del state.conversations[key]
    rest = tuple(one for one in sent[place + 1 :] if one.communicate.conversation != word.conversation)
    streams.put(state.outbox, peer, (*sent[:place], *rest))
    out.durable = True
    if rest:
        _renumber(state, out, peer, place, taken, now)
    else:
        state.issued[peer] = max(taken, state.issued[peer])


def _tell(state: CoreState, out: Out, peer: str, what: str) -> None:
    me = state.agent
    why = f"{peer} {what}: somebody else speaks with {me}'s key, or its journal is an old copy; `roco keys revoke {me}`"
    state.count("another speaker")
    out.log("another speaker", level="error", peer=peer, why=why)


# --- Reception of an event, before anything is taken ------------------------------------------------------------------


REFUSED = "order refused"
# Before Python 3.12 a member found by its class takes 0.1 us.
_VOLATILE, _PARTICIPANT = Delivery.VOLATILE, Role.PARTICIPANT


def note(agent: Agent[Any], wiring: Wiring, state: CoreState, out: Out, event: AnyEvent, now: float) -> None:
    """Take note of an event, and queue what the behaviour is to be told. Raises BehaviourError for another event."""
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
            _flush_all(wiring, state, out, now, wanted=up)
        case Started():
            _queue(state, Waiting(event, forced=True))
            _flush_all(wiring, state, out, now, wanted=True)
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
            raise BehaviourError(agent.name, state.state, f"was stepped with {event!r}", "that is the core's own")


def _arrive(wiring: Wiring, state: CoreState, out: Out, event: Arrived, now: float) -> None:
    said, journal = event.communicate, event.journal
    if journal:
        if not lineage.fits(state, out, said.sender, journal, event.believed):
            return
        if lineage.shortened(state, out, said.sender, event.heard, now):
            return
    admit(state, out, wiring, event)


def _obey(agent: Agent[Any], state: CoreState, out: Out, event: Ordered) -> None:
    """Obey an order, or say why not; either way the answer names it. Of a copy the behaviour is not told again."""
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
    """Take a receipt of the present journal. Return True where it covers the last observation due."""
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


def _flush_all(wiring: Wiring, state: CoreState, out: Out, now: float, *, wanted: bool) -> None:
    for peer in wiring.peers if wanted else ():
        streams.flush(state, out, wiring, peer, now, force=True)


def _queue(state: CoreState, waiting: Waiting) -> None:
    state.soft.inbox = (*state.soft.inbox, waiting)


def _forget_unanswered(state: CoreState, now: float) -> None:
    """Drop questions of peers left unanswered until their reply-by: no peer waits for them any more."""
    for name, held in list(state.soft.conversations.items()):
        talk = held.conversation
        if held.delivery is _VOLATILE and talk.role is _PARTICIPANT and talk.late(now):
            state.count("left unanswered")
            del state.soft.conversations[name]

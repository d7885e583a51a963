"""Renumbering: a sender whose numbers another used for its words says its own words again, under new numbers.

Whoever has this agent's key can do so. The receiver's receipt names the word that it took by its digest (recent), or
says that a word was refused. Order is kept: what follows a refused word in the outbox gets new numbers, too, and each
word says which one it follows. With each word that is refused the new numbers lie farther ahead, so a thief who always
says the next number is passed; after AT_ONCE tries without one that is taken, the next is made when it is time to
re-send. Where the receiver cannot know any more whether a word was taken, it is not said again: its conversation is
lost, and the behaviour is told.
"""

from msgspec.structs import replace

from agent_runtime.core import streams
from agent_runtime.core.effects import Out
from agent_runtime.core.events import Receipted
from agent_runtime.core.recent import JUMP, digest
from agent_runtime.core.state import CoreState, Lost, Outgoing
from fipa_codec.communicate import MOST_DIGITS

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

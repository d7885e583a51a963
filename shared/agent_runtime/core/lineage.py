"""Lineage of a stream's numbers: each journal has a random name, and a stream is between two
journals.

A journal that is deleted takes the numbers of its streams with it. So messages and receipts of
streams carry the name of the sender's journal and of the one that the sender believes the receiver
to have; what is meant for another journal is neither taken nor receipted. A peer's liveliness token
names its journal. Under another name than before, the peer has lost its memory: both streams begin
at 1 again, and the conversations with it are over. A name that was given up is never believed
again, since its token may outlive it by a lease.

A journal of which only the end is lost, or an old copy of it that was put back, keeps its name. So
an agent tells a peer that appears how many of its messages the peer had receipted, until the peer
answers. A peer that remembers less gives its journal another name: its memory is not what the
others know.
"""

from hashlib import blake2b

from agent_runtime.core.effects import Out
from agent_runtime.core.events import Receipted
from agent_runtime.core.state import CoreState, Lost, Record
from agent_runtime.core.streams import forget_last, release
from agent_runtime.core.wiring import Delivery
from fipa_codec.tables import Role

GIVEN_UP = 16
"""Names of lost journals that are remembered; estimate: tokens of that many lives last a lease (2
s) at most.
"""
TOLD = 16
"""Lost conversations that are remembered after the behaviour was told; estimate: its answers under
way.
"""
ANOTHER = "of another journal"
SHORTENED = "journal shortened"
_DURABLE, _LATEST = Delivery.DURABLE, Delivery.LATEST


def fits(state: CoreState, out: Out, peer: str, journal: str, believed: str) -> bool:
    """Whether a message or receipt is between the present journals of both; the first name of a
    peer is learnt.
    """
    known = state.journals.get(peer)
    if known is None and journal not in state.given_up:
        learn(state, out, peer, journal)
        known = journal
    if journal == known and believed == state.journal:
        return True
    if ANOTHER not in state.counts:
        why = f"{peer} means another journal than this one; it is not taken"
        out.log(ANOTHER, peer=peer, why=why)
    state.count(ANOTHER)
    return False


def learn(state: CoreState, out: Out, peer: str, journal: str) -> None:
    """Note the name of a peer's journal, durably: the numbers that follow count for it."""
    state.journals = state.journals | {peer: journal}
    out.durable = True


def met(state: CoreState, out: Out, peer: str, journal: str) -> bool:
    """Note the journal in a peer's token. Return whether it is news; streams with a peer that lost
    its memory end.
    """
    known = state.journals.get(peer)
    if not journal or journal == known or journal in state.given_up:
        return False
    if known is not None:
        lost = f"{peer} lost its memory: its journal is gone, and with it this"
        begin_again(state, peer, f"{lost} conversation")
        forget_soft(state, peer, f"{lost} subscription")
        state.given_up = (*state.given_up, known)[-GIVEN_UP:]
        ended = sum(
            not one.told and one.held.conversation.peer == peer for one in state.lost.values()
        )
        why = (
            f"{peer} has another journal than before; {ended} conversations with it end, messages"
            " are numbered from 1"
        )
        out.log("lost its memory", level="warning", peer=peer, why=why)
        state.count("peer lost its memory")
    learn(state, out, peer, journal)
    return True


def shortened(state: CoreState, out: Out, peer: str, heard: int, now: float) -> bool:
    """Whether the peer's messages up to `heard` were taken, and that was forgotten: the journal
    gets another name.
    """
    taken = state.taken.get(peer, 0)
    if heard > taken:
        _rename(state, out, peer, f"it took {heard} messages of {peer} and remembers {taken}", now)
    return heard > taken


def renamed(state: CoreState, out: Out, event: Receipted, now: float) -> None:
    """Give the journal another name if the peer believes this life to have another one: an old
    journal was put back.
    """
    if event.journal == state.journals.get(event.peer) and event.believed not in (
        "",
        state.journal,
    ):
        _rename(state, out, event.peer, f"{event.peer} knows a newer one", now)


def _rename(state: CoreState, out: Out, peer: str, what: str, now: float) -> None:
    """Give the journal another name, and end all conversations. Nothing may be said before the
    agent's next life, whose token has that name.
    """
    why = f"a part of {state.agent}'s journal was lost: {what}"
    out.log(SHORTENED, level="error", peer=peer, why=f"{why}; all conversations end")
    state.count(SHORTENED)
    talks = [*state.conversations.values(), *state.soft.conversations.values()]
    for other in {held.conversation.peer for held in talks} | {*state.issued, *state.taken}:
        begin_again(state, other, why)
        forget_soft(state, other, why)
    name = f"{state.journal} {state.incarnation} {now}".encode()
    state.journal = blake2b(name, digest_size=len(state.journal) // 2 or 1).hexdigest()
    out.durable = True


def begin_again(record: Record, peer: str, why: str) -> None:
    """Let the streams with a peer begin at 1, and mark the conversations with it as lost."""
    for key, held in list(record.conversations.items()):
        if held.conversation.peer == peer:
            record.lost[key] = Lost(held, why)
            del record.conversations[key]
    for table in (
        record.taken,
        record.recent,
        record.issued,
        record.heard,
        record.outbox,
        record.versions,
    ):
        table.pop(peer, None)


def forget_soft(state: CoreState, peer: str, why: str) -> None:
    """Forget what waits of a stream that begins again, and the peer's subscription; one to it is
    lost, too.
    """
    soft = state.soft
    soft.inbox = tuple(
        one for one in soft.inbox if one.peer != peer or not (one.number or one.subject)
    )
    soft.resend.pop(peer, None)
    soft.untold.pop(peer, None)
    forget_last(state, peer)
    release(state)
    for key, held in list(soft.conversations.items()):
        if held.conversation.peer != peer or held.delivery is not _LATEST:
            continue
        del soft.conversations[key]
        soft.asks.pop(key, None)
        if held.conversation.role is Role.INITIATOR:
            state.lost[key] = Lost(held, why)


def note_lost(state: CoreState, key: str) -> Lost:
    """Note that the behaviour is told of a lost conversation now, and forget the oldest ones it was
    told of.
    """
    lost = state.lost.pop(key)
    old = [name for name, one in state.lost.items() if one.told]
    for name in old[: max(0, len(old) - TOLD + 1)]:
        del state.lost[name]
    state.lost[key] = Lost(lost.held, lost.why, told=True)
    return lost

"""Durable numbered streams, latest-value observations, repeated questions: sending, keeping,
receipts, sending again.

The receiver keeps one number per stream, with digests of the newest messages; the sender keeps the
unreceipted messages. They are sent again at once when the peer (re)appears, else after
RESEND_FIRST, then after twice the wait up to RESEND_LAST, for ever: reply-by does not end this. All
functions change the forked state they are given and add to `out`; nothing here knows protocols'
tables or behaviours.
"""

from collections.abc import Sequence
from hashlib import blake2b
from itertools import pairwise
from typing import Any

import msgspec
from msgspec.structs import replace

from agent_runtime.core.events import Arrived, Out, Receipt, Receipted
from agent_runtime.core.state import (
    Ask,
    CoreState,
    Due,
    Held,
    Lost,
    Outgoing,
    Record,
    Version,
    Waiting,
)
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.communicate import LONGEST_LABEL, MOST_DIGITS, Communicate, number_of
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Role

RESEND_FIRST = 0.2
RESEND_LAST = 2.0
"""Seconds; proposed with the scheme of delivery, not measured: a receipt takes a disk sync and a
router hop (ms).
"""
OUTBOX_BOUND = 16
"""Unreceipted messages to one peer at which an agent opens no conversation with it of itself. The
explored fleet never held more than 5.
"""
ANSWERS_BOUND = 4 * OUTBOX_BOUND
"""Such messages at which others add nothing to them: slots kept for answers. A full outbox of
openings, and three answers (agree, result, reply to a cancel) to each opening in the peer's.
Messages of the peer itself may add as many again: one in answer to each; a peer that says more
floods.
"""
LAST_MESSAGES = 64
"""Unreceipted last messages of volatile conversations; estimate: more subscriptions than an agent
ends at once.
"""


def issue(state: CoreState, out: Out, communicate: Communicate, now: float) -> None:
    """Put a durable communicate, whose id is the next number of its stream, into the outbox and
    send it.
    """
    peer, number = communicate.receiver, int(communicate.id)
    state.issued[peer] = number
    state.outbox[peer] = (*state.outbox.get(peer, ()), Outgoing(number, communicate))
    out.durable = True
    if _named(state, peer):
        send(state, out, communicate)
    state.soft.resend.setdefault(peer, (now + RESEND_FIRST, RESEND_FIRST))


def _named(state: CoreState, peer: str) -> bool:
    """Whether messages to a peer can name its journal (peers); until its token came they wait."""
    return peer in state.journals or not state.journal or peer in state.soft.peers


def next_id(state: CoreState, peer: str, durable: bool) -> str:
    """The id of the next message to `peer`: its number in the stream, or a fresh name."""
    return str(state.issued.get(peer, 0) + _ahead(state, peer)) if durable else state.name()


def crowded(state: CoreState) -> bool:
    """Whether some outbox is so full that not everything may be said."""
    return any(len(sent) >= OUTBOX_BOUND for sent in state.outbox.values())


def overfull(before: CoreState, after: CoreState, event: Any) -> str:
    """The peer whose outbox has no room for what a step said after `event`; "" where there is room.

    The end of a conversation is taken however full its peer's outbox is: otherwise two agents whose
    outboxes are full towards each other would wait for each other for ever.
    """
    said = event.communicate if isinstance(event, Arrived) else None
    held = None if said is None else before.held(said.conversation, said.sender)
    ended = held is not None and after.held(held.conversation.id, held.conversation.peer) is None
    for peer, sent in after.outbox.items():
        old, own = len(before.outbox.get(peer, ())), said is not None and said.sender == peer
        if len(sent) == old or old < (
            OUTBOX_BOUND if said is None else 2 * ANSWERS_BOUND if own else ANSWERS_BOUND
        ):
            continue
        opening = any(
            one.performative in named(one.protocol).openings
            and before.held(one.conversation, one.receiver) is None
            for one in (outgoing.communicate for outgoing in sent[old:])
        )
        if (opening and not (own and ended)) or (old >= ANSWERS_BOUND and not ended):
            return peer
    return ""


def release(state: CoreState) -> None:
    """Let what was held back for want of room be tried again."""
    soft = state.soft
    if soft.full:
        soft.full, soft.held = "", frozenset()
        soft.inbox = tuple(replace(one, held=False) if one.held else one for one in soft.inbox)


def observed(state: CoreState, out: Out, peer: str, subject: str, due: Due, now: float) -> None:
    """Make an observation the newest of its subject that is due to `peer`; an older one is
    deleted.
    """
    state.due[peer] = state.due.get(peer, {}) | {subject: due}
    out.durable = True
    state.soft.resend.setdefault(peer, (now + RESEND_FIRST, RESEND_FIRST))


def send_due(state: CoreState, out: Out, wiring: Wiring, peer: str, now: float) -> None:
    """Send all observations due to `peer` within its live subscription, if it has one."""
    waits = last_waits(state, peer)
    for subject, due in state.due.get(peer, {}).items():
        if not (due.last and waits):
            send_observation(state, out, wiring, peer, subject, due, now)


def last_waits(state: CoreState, peer: str) -> bool:
    """Whether the last observation has to wait because others are due."""
    return not all(due.last for due in state.due.get(peer, {}).values())


def send_observation(
    state: CoreState, out: Out, wiring: Wiring, peer: str, subject: str, due: Due, now: float
) -> None:
    """Send one observation, if `peer` has a live subscription."""
    held = live_subscription(state, peer)
    if held is None:
        return
    talk, communicate = held.conversation.send(
        Performative.INFORM,
        id=observation_id(subject, due.version),
        now=now,
        content=due.content,
        language=due.language,
        ontology=wiring.required(held.conversation.peer, held.conversation.protocol).ontology,
    )
    state.keep(replace(held, conversation=talk))
    send(state, out, communicate)


def live_subscription(state: CoreState, peer: str) -> Held | None:
    """The conversation in which `peer` is subscribed to this agent's observations."""
    for held in state.soft.conversations.values():
        talk = held.conversation
        if held.delivery is Delivery.LATEST and talk.role is Role.PARTICIPANT and talk.peer == peer:
            return held if talk.state in talk.table.resting else None
    return None


def observation_id(subject: str, version: Version) -> str:
    """The id of an observation on the wire: subject@incarnation.counter."""
    return f"{subject}@{version[0]}.{version[1]}"


def parse_observation(id: str) -> tuple[str, Version] | None:
    """Subject and version from an observation's id; None for other ids."""
    subject, _, version = id.rpartition("@")
    first, _, second = version.partition(".")
    incarnation, counter = number_of(first), number_of(second)
    if not subject or incarnation is None or counter is None:
        return None
    return subject, (incarnation, counter)


def settle(state: CoreState, out: Out, wiring: Wiring, event: Receipted, now: float) -> bool:
    """Delete messages that a receipt covers. Whether the last observation due to the peer was among
    them.
    """
    if event.subject and state.soft.last.pop(event.subject, None) is not None:
        return False
    peer, emptied, waited = event.peer, False, last_waits(state, event.peer)
    sent = state.outbox.get(peer, ())
    taken = covered(sent, event.taken, event.digest) if sent else 0
    rest = tuple(one for one in sent if one.number > taken)
    due = state.due.get(peer, {})
    waiting = due.get(event.subject)
    if waiting is not None and waiting.version <= event.version:
        due = {subject: value for subject, value in due.items() if subject != event.subject}
        emptied = not due
    elif len(rest) == len(sent):
        return False
    if len(rest) < len(sent):
        state.heard[peer] = taken
        release(state)
        state.soft.renumbered.pop(peer, None)
    put(state.outbox, peer, rest)
    put(state.due, peer, due)
    state.soft.resend.pop(peer, None)
    if rest or due or peer in state.soft.untold:
        state.soft.resend[peer] = (now + RESEND_FIRST, RESEND_FIRST)
    if waited and not last_waits(state, peer):
        send_due(state, out, wiring, peer, now)
    return emptied


def flush(
    state: CoreState, out: Out, wiring: Wiring, peer: str, now: float, *, force: bool
) -> None:
    """Send everything `peer` has not receipted or answered, in order, and restart the re-send
    timer.

    Without `force`, what was sent less than RESEND_FIRST ago is not sent at once, but when that
    time is over.
    """
    if state.outbox.get(peer) or state.due.get(peer) or peer in state.soft.untold:
        at, gap = state.soft.resend.get(peer, (0.0, 0.0))
        last, fresh = at - gap, not force and now - (at - gap) < RESEND_FIRST
        if not fresh:
            resend(state, out, wiring, peer, now)
        state.soft.resend[peer] = ((last if fresh else now) + RESEND_FIRST, RESEND_FIRST)
    for table in (state.soft.asks, state.soft.last):
        for name, one in list(table.items()):
            if one.communicate.receiver == peer:
                last = one.at - one.gap
                fresh = not force and now - last < RESEND_FIRST
                if not fresh:
                    send(state, out, one.communicate)
                table[name] = Ask(
                    one.communicate, (last if fresh else now) + RESEND_FIRST, RESEND_FIRST
                )


def resend(state: CoreState, out: Out, wiring: Wiring, peer: str, now: float) -> None:
    """Send the outbox of a peer once more, in order, and the observations due; tell it again what
    it had receipted.
    """
    if peer in state.soft.untold and state.soft.up:
        told = replace(
            receipt(state, peer), heard=state.heard.get(peer, 0), life=state.soft.untold[peer]
        )
        out.receipts.append(told)
    for outgoing in state.outbox.get(peer, ()) if _named(state, peer) else ():
        send(state, out, outgoing.communicate)
    send_due(state, out, wiring, peer, now)


def ask(state: CoreState, out: Out, communicate: Communicate, now: float) -> None:
    """Send a volatile question and remember to ask again."""
    state.soft.asks[communicate.conversation] = Ask(communicate, now + RESEND_FIRST, RESEND_FIRST)
    send(state, out, communicate)


def say_last(state: CoreState, out: Out, communicate: Communicate, now: float) -> None:
    """Send the last message of a volatile conversation in which nothing is asked any more, until it
    is receipted.

    Of more than LAST_MESSAGES the oldest is given up.
    """
    last = state.soft.last
    if len(last) >= LAST_MESSAGES:
        state.count("last word given up")
        del last[next(iter(last))]
    last[communicate.id] = Ask(communicate, now + RESEND_FIRST, RESEND_FIRST)
    ended = (communicate.receiver, communicate.conversation)
    state.soft.over = (*state.soft.over[1 - LAST_MESSAGES :], ended)
    send(state, out, communicate)


def forget_last(state: CoreState, peer: str) -> None:
    """Send no last messages to a peer that is gone or has restarted: it knows nothing of those
    conversations.
    """
    for name in [name for name, one in state.soft.last.items() if one.communicate.receiver == peer]:
        del state.soft.last[name]
    state.soft.over = tuple(one for one in state.soft.over if one[0] != peer)


def on_time(state: CoreState, out: Out, wiring: Wiring, now: float) -> None:
    """Re-send and ask again whatever is due; each wait doubles. Nothing is sent while the router is
    away.
    """
    if not state.soft.up:
        return
    for peer, (at, gap) in list(state.soft.resend.items()):
        if at <= now:
            state.count("resent")
            resend(state, out, wiring, peer, now)
            wait = min(2 * gap, RESEND_LAST)
            state.soft.resend[peer] = (now + wait, wait)
    for table, what in ((state.soft.asks, "asked again"), (state.soft.last, "last word again")):
        for name, one in list(table.items()):
            if one.at <= now:
                state.count(what)
                wait = min(2 * one.gap, RESEND_LAST)
                table[name] = Ask(one.communicate, now + wait, wait)
                send(state, out, one.communicate)


def send(state: CoreState, out: Out, communicate: Communicate) -> None:
    """Send now, unless the router is away (what must arrive is kept elsewhere and flushed when it
    is back).
    """
    if state.soft.up:
        out.sends.append(communicate)


def put(table: dict[str, Any], key: str, value: Any) -> None:
    """Keep a value, unless it is empty."""
    if value:
        table[key] = value
    else:
        table.pop(key, None)


# --- Digests of the messages taken under a stream's newest numbers --------------------------------
# Another message under such a number is no copy.
# Whoever has an agent's key can send a message under its next number; the agent's own under that
# number comes later. So a receipt names the message it is for by its digest, and a message that is
# not the one that was taken is refused. A message says which message of its sender it follows,
# while that one is not receipted: it is not taken before that one, whatever number either of them
# gets.


KEPT = 16
"""Messages of a stream that are remembered: as many as its sender's outbox holds in ordinary use
(OUTBOX_BOUND).
"""
DIGEST_BYTES = 8
"""Length of a digest: to find another message with the same one takes 2^64 tries; the right one is
taken meanwhile.
"""
JUMP = 65_536
"""Farthest number after the last one that a message may have. Estimate: farther than a thief gets
in a round trip, and with a thousand messages a second the numbers (18 digits) last 480 years.
"""
# what came was decoded, what is sent encoded: without their checks
_encode = msgspec.msgpack.Encoder().encode


def digest_of(communicate: Communicate) -> bytes:
    """A copy has the same, another message or another number has another."""
    return blake2b(_encode(communicate), digest_size=DIGEST_BYTES).digest()


def note(record: Record, peer: str, number: int, digest: bytes) -> None:
    """Note that a message was taken as this number of the peer's stream."""
    record.taken[peer] = number
    record.recent[peer] = (*record.recent.get(peer, ())[1 - KEPT :], (number, digest))


def receipt(record: Record, peer: str) -> Receipt:
    """The receipt for all that was taken of a peer's stream."""
    newest = record.recent.get(peer, ())
    return Receipt(peer, taken=record.taken.get(peer, 0), digest=newest[-1][1] if newest else b"")


def receipted(sender: str, one: Receipt, journal: str = "", believed: str = "") -> Receipted:
    """The event that a receipt of `sender` is for whom it names; the names of journals as in
    Arrived.
    """
    parts = {name: getattr(one, name) for name in one.__struct_fields__ if name != "peer"}
    return Receipted(peer=sender, journal=journal, believed=believed, **parts)


def preceding(record: Record, communicate: Communicate) -> tuple[bytes, int]:
    """Which message a durable one follows: its digest while it is not receipted, else its number.

    (b"", 0) for the first message of a stream, and for one that is of no stream.
    """
    sent = record.outbox.get(communicate.receiver, ())
    if sent and sent[0].communicate is communicate:
        return b"", record.heard.get(communicate.receiver, 0)
    for before, one in pairwise(sent):
        if one.communicate is communicate:
            return digest_of(before.communicate), 0
    return b"", 0


def covered(sent: Sequence[Outgoing], taken: int, digest: bytes) -> int:
    """Up to which number a receipt is for what was sent; 0 where it is for another's message.

    Receipts of test programs name no message, and are believed.
    """
    if not digest or any(
        one.number == taken and digest_of(one.communicate) == digest for one in sent
    ):
        return taken
    return 0


def follows(
    state: CoreState, arrived: Arrived, waiting: Sequence[Waiting], number: int, last: int
) -> bool:
    """Whether a message is the next one of its stream after `last`.

    The one it follows was taken or waits. Then its number may be farther on: between the two its
    sender said nothing, though others did in its name.
    """
    if not _known(state, arrived, waiting):
        return False
    return number == last + 1 or (bool(arrived.journal) and number <= last + JUMP)


def too_far(state: CoreState, arrived: Arrived, number: int, last: int) -> bool:
    """Whether a message is the next one of its sender, under a number that it cannot have here."""
    return bool(arrived.journal) and number > last + JUMP and _known(state, arrived, ())


def _known(state: CoreState, arrived: Arrived, waiting: Sequence[Waiting]) -> bool:
    after = arrived.after
    if not after or any(one.digest == after for one in waiting):
        return True
    return any(digest == after for _, digest in state.recent.get(arrived.communicate.sender, ()))


def taken_before(state: CoreState, out: Out, communicate: Communicate, number: int) -> None:
    """Receipt a copy of what was taken; refuse another message under the number of one."""
    peer, digest = communicate.sender, digest_of(communicate)
    kept = state.recent.get(peer, ())
    copy, unknown = (number, digest) in kept, len(kept) == KEPT and number < kept[0][0]
    if copy or unknown:
        state.count("taken before")
        conversation = communicate.conversation[:LONGEST_LABEL]
        out.log("taken before", sender=peer, id=communicate.id, conversation=conversation)
    else:
        tell(state, out, communicate, "was taken")
    if copy:
        out.receipts.append(Receipt(peer, taken=number, digest=digest))
    else:
        refuse(state, out, peer, digest, unknown=unknown)


def refuse(state: CoreState, out: Out, peer: str, digest: bytes, *, unknown: bool = False) -> None:
    """Tell the sender of a message that it was not taken, or (`unknown`) that this is not known any
    more.
    """
    out.receipts.append(replace(receipt(state, peer), refused=digest, unknown=unknown))


def tell(state: CoreState, out: Out, communicate: Communicate, what: str) -> None:
    """Log that two speak in the name of a peer; `what` became of the other message under the number
    of this one.
    """
    peer, number = communicate.sender, communicate.id
    why = (
        f"{peer} said two words under its number {number}, of which the other {what}: somebody else"
        f" speaks with its key; `roco keys revoke {peer}`"
    )
    state.count("another speaker")
    conversation = communicate.conversation[:LONGEST_LABEL]
    out.log(
        "another speaker", level="error", sender=peer, id=number, conversation=conversation, why=why
    )


# --- Renumbering: a sender whose numbers another used for its messages sends its own again, under
# new numbers
# Whoever has this agent's key can do so. The receiver's receipt names the message that it took by
# its digest, or says that one was refused. Order is kept: what follows a
# refused message in the outbox gets new numbers, too, and each message says which one it follows.
# With each message that is refused or given up the new numbers lie farther ahead, so a thief who
# always uses the next number is passed; after AT_ONCE tries without one that is taken, the next is
# made when it is time to re-send. Where the receiver cannot know any more whether a message was
# taken, it is not sent again: its conversation is lost, and the behaviour is told.


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
    first = max(taken, kept[-1].number if kept else 0) + _ahead(state, peer)
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
            send(state, out, one.communicate)
        soft.resend[peer] = (now + RESEND_FIRST, RESEND_FIRST)


def _ahead(state: CoreState, peer: str) -> int:
    """How far beyond the last number the next one lies."""
    return int(min(FARTHER ** state.soft.renumbered.get(peer, 0), JUMP // 2))


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
    put(state.outbox, peer, (*sent[:place], *rest))
    out.durable = True
    if rest:
        _renumber(state, out, peer, place, taken, now)
    else:  # what is said next lies beyond the thief's numbers, though he goes on meanwhile
        state.issued[peer] = max(taken, state.issued[peer])
        state.soft.renumbered[peer] = state.soft.renumbered.get(peer, 0) + 1


def _tell(state: CoreState, out: Out, peer: str, what: str) -> None:
    me = state.agent
    why = (
        f"{peer} {what}: somebody else speaks with {me}'s key, or its journal is an old copy; `roco"
        f" keys revoke {me}`"
    )
    state.count("another speaker")
    out.log("another speaker", level="error", peer=peer, why=why)

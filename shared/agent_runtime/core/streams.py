"""Durable numbered streams, latest-value observations, repeated questions: sending, keeping,
receipts, sending again.

The receiver keeps one number per stream, with digests of the newest messages (duplicate_digests);
the sender keeps the unreceipted messages (messages of another under its numbers: reception). They
are sent again at once when the peer (re)appears, else after RESEND_FIRST, then after twice the wait
up to RESEND_LAST, for ever: reply-by does not end this. All functions change the forked state they
are given and add to `out`; nothing here knows protocols' tables or behaviours.
"""

from typing import Any

from msgspec.structs import replace

from agent_runtime.core.duplicate_digests import covered, receipt
from agent_runtime.core.effects import Out
from agent_runtime.core.events import Arrived, Receipted
from agent_runtime.core.state import Ask, CoreState, Due, Held, Outgoing, Version
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.communicate import Communicate, number_of
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
    """Whether messages to a peer can name its journal (lineage); until its token came they wait."""
    return peer in state.journals or not state.journal or peer in state.soft.peers


def next_id(state: CoreState, peer: str, durable: bool) -> str:
    """The id of the next message to `peer`: its number in the stream, or a fresh name."""
    return str(state.issued.get(peer, 0) + 1) if durable else state.name()


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

"""Durable numbered streams, latest-value observations, repeated questions: sending, keeping, receipts, re-
sending.

One number per stream at the receiver, the unreceipted messages at the sender. Re-sent at once when the peer
(re)appears, else after RESEND_FIRST, then after twice the wait up to RESEND_LAST, for ever: reply-by ends no re-
sending. All functions change the forked state they are given and add to `out`; nothing here knows protocols' tables or
behaviours.
"""

from typing import Any

from msgspec.structs import replace

from agent_runtime.core.effects import Out, Receipt
from agent_runtime.core.events import Receipted
from agent_runtime.core.state import Ask, CoreState, Due, Held, Outgoing, Version
from agent_runtime.core.wiring import Delivery, Wiring
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

RESEND_FIRST = 0.2
RESEND_LAST = 2.0
"""Seconds; proposed with the scheme of delivery, not measured: a receipt takes a disk sync and a router hop (ms)."""
OUTBOX_BOUND = 16
"""Unreceipted messages to one peer at which an agent takes nothing more. The explored fleet never held more than 5."""


def issue(state: CoreState, out: Out, communicate: Communicate, now: float) -> None:
    """Put a durable communicate, whose id is the next number of its stream, into the outbox and send it."""
    peer, number = communicate.receiver, int(communicate.id)
    state.issued[peer] = number
    state.outbox[peer] = (*state.outbox.get(peer, ()), Outgoing(number, communicate))
    out.durable = True
    send(state, out, communicate)
    state.soft.resend.setdefault(peer, (now + RESEND_FIRST, RESEND_FIRST))


def next_number(state: CoreState, peer: str) -> int:
    """The number the next durable communicate to `peer` gets."""
    return state.issued.get(peer, 0) + 1


def blocked(state: CoreState) -> str | None:
    """The peer whose outbox is full; as long as there is one, the agent takes nothing."""
    for peer, sent in state.outbox.items():
        if len(sent) >= OUTBOX_BOUND:
            return peer
    return None


def observed(state: CoreState, out: Out, peer: str, subject: str, due: Due, now: float) -> None:
    """Make an observation the newest of its subject that is due to `peer`; an older one is deleted."""
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


def send_observation(state: CoreState, out: Out, wiring: Wiring, peer: str, subject: str, due: Due, now: float) -> None:
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
    """Return the conversation in which `peer` is subscribed to this agent's observations."""
    for held in state.soft.conversations.values():
        talk = held.conversation
        if held.delivery is Delivery.LATEST and talk.role is Role.PARTICIPANT and talk.peer == peer:
            return held if talk.state in talk.table.resting else None
    return None


def observation_id(subject: str, version: Version) -> str:
    """Return the id of an observation on the wire: subject@incarnation.counter."""
    return f"{subject}@{version[0]}.{version[1]}"


def parse_observation(id: str) -> tuple[str, Version] | None:
    """Return subject and version from an observation's id; None for other ids."""
    subject, _, version = id.rpartition("@")
    incarnation, _, counter = version.partition(".")
    if not (subject and incarnation.isascii() and incarnation.isdigit() and counter.isascii() and counter.isdigit()):
        return None
    return subject, (int(incarnation), int(counter))


def receipt_stream(state: CoreState, out: Out, peer: str) -> None:
    """Tell `peer` how far its stream is journalled."""
    out.receipts.append(Receipt(peer, taken=state.taken.get(peer, 0)))


def settle(state: CoreState, out: Out, wiring: Wiring, event: Receipted, now: float) -> bool:
    """Delete messages that a receipt covers. Return True where the last observation due to the peer was among them."""
    peer, emptied, waited = event.peer, False, last_waits(state, event.peer)
    sent = state.outbox.get(peer, ())
    rest = tuple(one for one in sent if one.number > event.taken)
    due = state.due.get(peer, {})
    waiting = due.get(event.subject)
    if waiting is not None and waiting.version <= event.version:
        due = {subject: value for subject, value in due.items() if subject != event.subject}
        emptied = not due
    elif len(rest) == len(sent):
        return False
    _put(state.outbox, peer, rest)
    _put(state.due, peer, due)
    state.soft.resend.pop(peer, None)
    if rest or due:
        state.soft.resend[peer] = (now + RESEND_FIRST, RESEND_FIRST)
    if waited and not last_waits(state, peer):
        send_due(state, out, wiring, peer, now)
    return emptied


def flush(state: CoreState, out: Out, wiring: Wiring, peer: str, now: float, *, force: bool) -> None:
    """Send everything `peer` has not receipted or answered, in order, and restart the re-send timer.

    Without `force`, what was sent less than RESEND_FIRST ago is not sent at once, but when that time is over.
    """
    if state.outbox.get(peer) or state.due.get(peer):
        at, gap = state.soft.resend.get(peer, (0.0, 0.0))
        fresh = not force and now - (at - gap) < RESEND_FIRST
        if not fresh:
            resend(state, out, wiring, peer, now)
        state.soft.resend[peer] = (_next_at(now, at - gap, fresh), RESEND_FIRST)
    for name, one in list(state.soft.asks.items()):
        if one.communicate.receiver == peer:
            fresh = not force and now - (one.at - one.gap) < RESEND_FIRST
            if not fresh:
                send(state, out, one.communicate)
            state.soft.asks[name] = Ask(one.communicate, _next_at(now, one.at - one.gap, fresh), RESEND_FIRST)


def _next_at(now: float, last: float, fresh: bool) -> float:
    return (last if fresh else now) + RESEND_FIRST


def resend(state: CoreState, out: Out, wiring: Wiring, peer: str, now: float) -> None:
    """Send the outbox of a peer once more, in order, and the observations due."""
    for outgoing in state.outbox.get(peer, ()):
        send(state, out, outgoing.communicate)
    send_due(state, out, wiring, peer, now)


def ask(state: CoreState, out: Out, communicate: Communicate, now: float) -> None:
    """Send a volatile question and remember to ask again."""
    state.soft.asks[communicate.conversation] = Ask(communicate, now + RESEND_FIRST, RESEND_FIRST)
    send(state, out, communicate)


def on_time(state: CoreState, out: Out, wiring: Wiring, now: float) -> None:
    """Re-send and ask again whatever is due; each wait doubles. Nothing is sent while the router is away."""
    if not state.soft.up:
        return
    for peer, (at, gap) in list(state.soft.resend.items()):
        if at <= now:
            state.count("resent")
            resend(state, out, wiring, peer, now)
            wait = min(2 * gap, RESEND_LAST)
            state.soft.resend[peer] = (now + wait, wait)
    for name, one in list(state.soft.asks.items()):
        if one.at <= now:
            state.count("asked again")
            wait = min(2 * one.gap, RESEND_LAST)
            state.soft.asks[name] = Ask(one.communicate, now + wait, wait)
            send(state, out, one.communicate)


def send(state: CoreState, out: Out, communicate: Communicate) -> None:
    """Send now, unless the router is away (what must arrive is kept elsewhere and flushed when it is back)."""
    if state.soft.up:
        out.sends.append(communicate)


def _put(table: dict[str, Any], key: str, value: Any) -> None:
    if value:
        table[key] = value
    else:
        table.pop(key, None)

"""Intake of an arriving communicate: keep it for its turn, receipt it again, or drop and count it.

Durable: only the next number of the sender's stream is kept; a copy of an older one is receipted again, another word
under its number is refused (recent); a gap is dropped without receipt, so it comes again. Observations: only a newer
version of the subject, and only in a conversation that is held. Volatile: every communicate but copies of a waiting
one, up to a bound. Nothing is answered here: answers follow the order of the stream.
"""

from typing import Any

from msgspec import UNSET

from agent_runtime.core.effects import Out, Receipt
from agent_runtime.core.events import Arrived
from agent_runtime.core.recent import digest, follows, refuse, taken_before, tell, too_far
from agent_runtime.core.state import CoreState, Waiting
from agent_runtime.core.streams import parse_observation, receipt_stream
from agent_runtime.core.wiring import Delivery, Link, Wiring
from fipa_codec.communicate import LONGEST_LABEL, Communicate, number_of
from fipa_codec.errors import RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

# Before Python 3.12 a member found by its class takes 0.1 us.
_DURABLE, _LATEST = Delivery.DURABLE, Delivery.LATEST
HELD_OF_STREAM = 16
"""Waiting messages of one stream; as many as its sender's outbox holds."""
HELD_VOLATILE = 256
HELD_BYTES = 16 * 1024 * 1024
"""Waiting volatile messages of a sender, and their contents; estimates. One beyond is dropped, its sender asks again.
"""


def admit(state: CoreState, out: Out, wiring: Wiring, arrived: Arrived) -> None:
    """Put a communicate into the inbox, or receipt or drop it at once."""
    communicate = arrived.communicate
    link = wiring.link(communicate.sender, communicate.protocol)
    if communicate.receiver != state.agent or link is None:
        reject(
            state, out, communicate, "not for us", f"no {communicate.protocol[:64]!r} with {communicate.sender[:64]!r}"
        )
    elif link.delivery is _DURABLE:
        _admit_durable(state, out, wiring, link, arrived)
    elif link.delivery is _LATEST and _is_observation(link, communicate):
        _admit_observation(state, out, wiring, link, communicate)
    else:
        _admit_volatile(state, out, wiring, link, communicate)


def reject(state: CoreState, out: Out, communicate: Communicate, what: str, why: str) -> None:
    """Drop, count and log it."""
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


def _is_observation(link: Link, communicate: Communicate) -> bool:
    said = communicate.performative is Performative.INFORM and "@" in communicate.id
    return said and link.role is Role.INITIATOR


def _admit_durable(state: CoreState, out: Out, wiring: Wiring, link: Link, arrived: Arrived) -> None:
    communicate, peer = arrived.communicate, arrived.communicate.sender
    number, taken = number_of(communicate.id), state.taken.get(peer, 0)
    if not number:
        reject(state, out, communicate, "no stream number", "a durable communicate has its stream's number as id")
        return
    waiting = [one for one in state.soft.inbox if one.number and one.peer == peer]
    last = waiting[-1].number if waiting else taken
    if number <= taken:
        taken_before(state, out, communicate, number)
    elif number <= last:
        state.count("waiting already")
        if digest(communicate) not in [one.digest for one in waiting]:
            tell(state, out, communicate, "waits to be taken")
        receipt_stream(state, out, peer)  # how far it is: the sender learns that it is heard, though not its turn
    elif len(waiting) < HELD_OF_STREAM and follows(state, arrived, waiting, number, last):
        _wait(state, wiring, link, communicate, peer=peer, number=number, digest=digest(communicate))
    else:
        state.count("gap")
        if not waiting and too_far(state, arrived, number, last):
            refuse(state, out, peer, digest(communicate))


def _admit_observation(state: CoreState, out: Out, wiring: Wiring, link: Link, communicate: Communicate) -> None:
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


def _admit_volatile(state: CoreState, out: Out, wiring: Wiring, link: Link, communicate: Communicate) -> None:
    inbox, peer = state.soft.inbox, communicate.sender
    waiting = [one for one in inbox if one.peer == peer and isinstance(one.event, Arrived) and not one.number]
    if waiting and any(_same(one.event.communicate, communicate) for one in waiting):
        state.count("waiting already")
    elif len(waiting) >= HELD_VOLATILE:
        reject(state, out, communicate, "inbox full", f"{HELD_VOLATILE} volatile messages of it wait already")
    elif waiting and sum(_size(one.event.communicate) for one in waiting) + _size(communicate) > HELD_BYTES:
        reject(state, out, communicate, "inbox full", f"{HELD_BYTES >> 20} MiB of volatile messages of it wait already")
    else:
        _wait(state, wiring, link, communicate, peer=peer)


def _size(communicate: Communicate) -> int:
    return 0 if communicate.content is UNSET else len(communicate.content)


def _same(one: Communicate, other: Communicate) -> bool:
    return (one.sender, one.id, one.conversation) == (other.sender, other.id, other.conversation)


def _wait(state: CoreState, wiring: Wiring, link: Link, communicate: Communicate, **place: Any) -> None:
    fault: RemoteProtocolError | None = None
    try:
        content, kind = wiring.languages.read(communicate)
        name = f"{communicate.language}.{type(content).__name__}" if content is not None else ""
        link.require_heard(communicate.performative, name)
    except RemoteProtocolError as error:
        content, kind, fault = None, Kind.PLAIN, error
    waiting = Waiting(Arrived(communicate), link=link, content=content, kind=kind, fault=fault, **place)
    state.soft.inbox = (*state.soft.inbox, waiting)

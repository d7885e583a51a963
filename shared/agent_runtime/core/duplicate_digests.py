"""Digests of the messages taken under a stream's newest numbers, so that another one under such a
number is no copy.

Whoever has an agent's key can send a message under its next number; the agent's own under that
number comes later. So a receipt names the message it is for by its digest, and a message that is
not the one that was taken is refused. A message says which message of its sender it follows, while
that one is not receipted: it is not taken before that one, whatever number either of them gets.
"""

from collections.abc import Sequence
from hashlib import blake2b
from itertools import pairwise

import msgspec
from msgspec.structs import replace

from agent_runtime.core.effects import Out, Receipt
from agent_runtime.core.events import Arrived, Receipted
from agent_runtime.core.state import CoreState, Outgoing, Record, Waiting
from fipa_codec.communicate import LONGEST_LABEL, Communicate

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

"""Digests of the words taken under a stream's newest numbers, so that another word under one of them is not a copy.

Whoever has an agent's key can say a word under its next number; the agent's own word under that number comes later. So
a receipt names the word it is for by its digest, and a word that is not the one that was taken is refused. A word says
which word of its sender it follows, while that one is not receipted: it is not taken before that one, whatever number
either of them gets.
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
"""Words of a stream that are remembered: as many as its sender's outbox holds in ordinary use (OUTBOX_BOUND)."""
DIGEST_BYTES = 8
"""Length of a digest: to find another word with a given digest takes 2^64 tries; the given one is taken meanwhile."""
JUMP = 65_536
"""Farthest number after the last one that a word may have. Estimate: farther than a thief gets in a round trip, and
with a thousand words a second the numbers (18 digits) last 480 years.
"""
_encode = msgspec.msgpack.Encoder().encode  # what came was decoded, what was said encoded: without their checks


def digest(communicate: Communicate) -> bytes:
    """Return the digest of a word; a copy has the same, another word or another number has another."""
    return blake2b(_encode(communicate), digest_size=DIGEST_BYTES).digest()


def note(record: Record, peer: str, number: int, word: bytes) -> None:
    """Note that a word was taken as this number of the peer's stream."""
    record.taken[peer] = number
    record.recent[peer] = (*record.recent.get(peer, ())[1 - KEPT :], (number, word))


def receipt(record: Record, peer: str) -> Receipt:
    """Return the receipt for all that was taken of a peer's stream."""
    newest = record.recent.get(peer, ())
    return Receipt(peer, taken=record.taken.get(peer, 0), digest=newest[-1][1] if newest else b"")


def receipted(sender: str, one: Receipt, journal: str = "", believed: str = "") -> Receipted:
    """Return the event that a receipt of `sender` is for whom it names; the names of journals as in Arrived."""
    parts = {name: getattr(one, name) for name in one.__struct_fields__ if name != "peer"}
    return Receipted(peer=sender, journal=journal, believed=believed, **parts)


def preceding(record: Record, communicate: Communicate) -> tuple[bytes, int]:
    """Return which word a durable one follows: its digest while it is not receipted, else its number.

    (b"", 0) for the first word of a stream, and for one that is of no stream.
    """
    sent = record.outbox.get(communicate.receiver, ())
    if sent and sent[0].communicate is communicate:
        return b"", record.heard.get(communicate.receiver, 0)
    for before, one in pairwise(sent):
        if one.communicate is communicate:
            return digest(before.communicate), 0
    return b"", 0


def covered(sent: Sequence[Outgoing], taken: int, word: bytes) -> int:
    """Return up to which number a receipt is for what was sent; 0 where it is for another's word.

    Receipts of test programs name no word, and are believed.
    """
    if not word or any(one.number == taken and digest(one.communicate) == word for one in sent):
        return taken
    return 0


def follows(state: CoreState, arrived: Arrived, waiting: Sequence[Waiting], number: int, last: int) -> bool:
    """Whether a word is the next one of its stream after `last`.

    The word it is said to follow was taken or waits. Then its number may be farther on: between the two its sender said
    nothing, though others did in its name.
    """
    if not _known(state, arrived, waiting):
        return False
    return number == last + 1 or (bool(arrived.journal) and number <= last + JUMP)


def too_far(state: CoreState, arrived: Arrived, number: int, last: int) -> bool:
    """Whether a word is the next one of its sender, under a number that it cannot have here."""
    return bool(arrived.journal) and number > last + JUMP and _known(state, arrived, ())


def _known(state: CoreState, arrived: Arrived, waiting: Sequence[Waiting]) -> bool:
    after = arrived.after
    if not after or any(one.digest == after for one in waiting):
        return True
    return any(word == after for _, word in state.recent.get(arrived.communicate.sender, ()))


def taken_before(state: CoreState, out: Out, communicate: Communicate, number: int) -> None:
    """Receipt a copy of what was taken; refuse another word under the number of one."""
    peer, word, kept = communicate.sender, digest(communicate), state.recent.get(communicate.sender, ())
    if (number, word) in kept:
        _copy(state, out, communicate)
        out.receipts.append(Receipt(peer, taken=number, digest=word))
        return
    unknown = len(kept) == KEPT and number < kept[0][0]
    if unknown:
        _copy(state, out, communicate)
    else:
        tell(state, out, communicate, "was taken")
    refuse(state, out, peer, word, unknown=unknown)


def refuse(state: CoreState, out: Out, peer: str, word: bytes, *, unknown: bool = False) -> None:
    """Tell the sender of a word that it was not taken, or (`unknown`) that this is not known any more."""
    out.receipts.append(replace(receipt(state, peer), refused=word, unknown=unknown))


def tell(state: CoreState, out: Out, communicate: Communicate, what: str) -> None:
    """Log that two speak in the name of a peer; `what` became of the other word under the number of this one."""
    peer, number = communicate.sender, communicate.id
    why = (
        f"{peer} said two words under its number {number}, of which the other {what}: somebody else speaks with its "
        f"key; `roco keys revoke {peer}`"
    )
    state.count("another speaker")
    out.log("another speaker", level="error", sender=peer, id=number, conversation=_label(communicate), why=why)


def _copy(state: CoreState, out: Out, communicate: Communicate) -> None:
    state.count("taken before")
    out.log("taken before", sender=communicate.sender, id=communicate.id, conversation=_label(communicate))


def _label(communicate: Communicate) -> str:
    return communicate.conversation[:LONGEST_LABEL]

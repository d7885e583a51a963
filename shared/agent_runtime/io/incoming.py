"""Samples that an agent hears, as they came off the wire: nothing is decoded yet."""

import msgspec

from agent_runtime.core.control import Command
from agent_runtime.core.effects import Receipt
from agent_runtime.core.events import AnyEvent, Arrived, Garbled, Ordered
from agent_runtime.core.recent import receipted
from fipa_codec.communicate import UNREADABLE, decode
from fipa_codec.errors import MalformedError

NAMELESS = ("", "")
"""Names of journals where none are said."""


class Bytes(msgspec.Struct, frozen=True):
    """A communicate as it came off the wire, not decoded yet; `told`: what its key says of it.

    That is sender, receiver, protocol and performative. `journals`, `after`, `heard`: see Arrived.
    """

    key: str
    told: tuple[str, ...]
    data: bytes
    journals: tuple[str, str] = NAMELESS
    after: bytes = b""
    heard: int = 0


class ReceiptBytes(msgspec.Struct, frozen=True):
    """A receipt of `peer` as it came."""

    peer: str
    data: bytes
    journals: tuple[str, str] = NAMELESS


class OrderBytes(msgspec.Struct, frozen=True):
    """An order of the operator as it came."""

    data: bytes


class Ping(msgspec.Struct, frozen=True):
    """`peer` asks whether we are there (answer with a pong), or (`pong`) answers."""

    peer: str
    channel: bytes
    pong: bool


class Token(msgspec.Struct, frozen=True):
    """The liveliness token of an agent's incarnation appeared or vanished."""

    agent: str
    incarnation: int
    alive: bool
    journal: str = ""


# --- From bytes of the wire to events of the core; what cannot be read, or says what its key does not, is Garbled


def ordered(data: bytes) -> AnyEvent:
    """The order in what came, if it is one."""
    try:
        return Ordered(msgspec.msgpack.decode(data, type=Command))
    except UNREADABLE as error:
        return Garbled("order", str(error))


def arrived(item: Bytes) -> AnyEvent:
    """The communicate in what came, if it is one and says what its key says (the router's rights go by the key)."""
    try:
        communicate = decode(item.data)
    except MalformedError as error:
        return Garbled(item.key, str(error))
    one = communicate
    says = (one.sender, one.receiver, one.protocol, one.performative)
    if item.told != says:
        return Garbled(item.key, f"the communicate says {'/'.join(says)}", forged=True)
    return Arrived(communicate, *item.journals, item.after, item.heard)


def receipt(item: ReceiptBytes) -> AnyEvent:
    """The receipt in what came, if it is one."""
    try:
        told = msgspec.msgpack.decode(item.data, type=Receipt)
    except UNREADABLE as error:
        return Garbled(f"receipt of {item.peer}", str(error))
    return receipted(item.peer, told, *item.journals)

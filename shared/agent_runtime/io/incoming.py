"""Samples that an agent hears, as they came off the wire: nothing is decoded yet."""

import msgspec

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

"""The wire of one agent over sessions of Zenoh: it hands on what it hears, and sends.

Every communicate is a put on its own key; receipts, pings and pongs are puts beside them; a
liveliness token says which incarnation of the agent is alive. All this goes to the neighbours, with
which the agent is linked. What is for tools (the state, samples for people, the log) goes by the
router, and orders come from there. A process that speaks for a group of the design is connected to
the router.
"""

import threading
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

import msgspec
import zenoh

from agent_runtime.core.control import KIND, Command
from agent_runtime.core.events import AnyEvent, Arrived, Garbled, Ordered, Receipt
from agent_runtime.core.streams import receipted
from agent_runtime.core.wiring import (
    Delivery,
    Wiring,
    communicate_key,
    life,
    parse_life,
    service_key,
)
from agent_runtime.io.inbox import Class
from agent_runtime.io.sessions import close, put
from agent_runtime.io.steplog import LOG_PART, LOG_WANTED, LogSender
from fipa_codec.communicate import UNREADABLE, Communicate, decode, encode, number_of
from fipa_codec.errors import MalformedError

# --- Samples that an agent hears, as they came off the wire: nothing is decoded yet ---------------


NAMELESS = ("", "")
"""Names of journals where none are said."""


class Bytes(msgspec.Struct, frozen=True):
    """A communicate as it came off the wire, not decoded yet; `address`: what its key says of it.

    That is sender, receiver, protocol and performative. `journals`, `after`, `heard`: see Arrived.
    """

    key: str
    address: tuple[str, ...]
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


# --- From bytes of the wire to events of the core; what cannot be read, or says what its key does
# not, is Garbled


def ordered(data: bytes) -> AnyEvent:
    """The order in what came, if it is one."""
    try:
        return Ordered(msgspec.msgpack.decode(data, type=Command))
    except UNREADABLE as error:
        return Garbled("order", str(error))


def arrived(item: Bytes) -> AnyEvent:
    """The communicate in what came, if it is one and says what its key says (the router's rights go
    by the key).
    """
    try:
        communicate = decode(item.data)
    except MalformedError as error:
        return Garbled(item.key, str(error))
    one = communicate
    says = (one.sender, one.receiver, one.protocol, one.performative)
    if item.address != says:
        return Garbled(item.key, f"the communicate says {'/'.join(says)}", forged=True)
    return Arrived(communicate, *item.journals, item.after, item.heard)


def receipt(item: ReceiptBytes) -> AnyEvent:
    """The receipt in what came, if it is one."""
    try:
        one = msgspec.msgpack.decode(item.data, type=Receipt)
    except UNREADABLE as error:
        return Garbled(f"receipt of {item.peer}", str(error))
    return receipted(item.peer, one, *item.journals)


BULK_BYTES = 16 * 1024
"""Volatile content from here on goes at low priority, so that it delays nobody else (estimate)."""
KNOWN_KEYS = 1024
"""Keys that are known; estimate: an agent hears on some dozen."""
LONGEST_NAMES = 64
"""Bytes of an attachment that are read; ours have 25, with a digest 42, with a number of 18 digits
45.
"""
NOBODYS = b"?"
"""In the place of a digest that cannot be read: of no message."""
KNOWN_NAMES = 256
"""Attachments that are known; estimate: some for each peer."""
Attached = tuple[tuple[str, str], bytes, int]
NOTHING: Attached = (NAMELESS, b"", 0)
_FIRST, _SECOND, _LAST = (
    zenoh.Priority.INTERACTIVE_HIGH,
    zenoh.Priority.DATA,
    zenoh.Priority.DATA_LOW,
)
_BLOCK = zenoh.CongestionControl.BLOCK


class Entrance(Protocol):
    """The place in which the wire leaves samples: an Inbox, or the StepLock before one."""

    def put(self, kind: Class, item: Any, sender: str = "", size: int = 0) -> object:
        """Take it, or keep it, or drop it; must not wait. `sender` "": the own side."""


class ZenohWire:
    """The sessions of one agent. All callbacks put into `inbox` and return.

    What is numbered or kept, and receipts, have the names of both journals attached: "own/peer's".
    """

    def __init__(
        self,
        session: zenoh.Session,
        wiring: Wiring,
        incarnation: int,
        inbox: Entrance,
        journal: str = "",
        log: Path | None = None,
    ) -> None:
        """Declare what the agent listens to, then its token, with the name of its journal.

        `session`: linked with the neighbours; `join` gives the one at the router. `log`: its step
        log, for a recorder that cannot read it.
        """
        self._wiring, self._inbox = wiring, inbox
        self._routes: dict[tuple[str, str, str], tuple[zenoh.KeyExpr | str, Any, Any, bool]] = {}
        self._known: dict[str, tuple[Class, tuple[str, ...], bool]] = {}
        self._channels = {
            peer: frozenset(link.channel.encode() for link in wiring.links if link.peer == peer)
            for peer in wiring.peers
        }
        self._journal, self._names = journal, dict[str, bytes]()
        self._life = service_key(wiring.system, "alive", wiring.agent, life(incarnation, journal))
        self._sender = None if log is None else LogSender(log, self._put_log)
        # References are kept: a dropped declaration is undeclared.
        self._tools: zenoh.Session | None = None
        self._orders: list[Any] = []
        self._declared: list[Any] = []
        # What devices hear. They ask for it on the shell's thread; `join` may come on another one.
        self._joined = threading.Lock()
        self._hears: dict[str, Callable[[bytes], None]] = {}
        self._on_guest: Callable[[str, bytes], None] | None = None
        self.link(session)

    def link(self, session: zenoh.Session) -> None:
        """Hear the neighbours, and be alive to them, from now on in this session."""
        self._session, self._routes = session, {}
        self._declared += [
            *self._heard(session, set(self._wiring.peers) - self._wiring.groups, "*"),
            session.liveliness().declare_token(self._life),
        ]

    def _heard(self, session: zenoh.Session, peers: Collection[str], owner: str) -> list[Any]:
        """Hear these peers in a session. `owner`: the chunk of the runtime's own keys that names
        them.
        """
        system, me = self._wiring.system, self._wiring.agent
        return [
            *(
                session.declare_subscriber(key, self._on_communicate)
                for key in self._wiring.inbox_keys(peers)
            ),
            session.declare_subscriber(service_key(system, "receipt", owner, me), self._on_receipt),
            *(
                session.declare_subscriber(service_key(system, kind, owner, me), self._on_question)
                for kind in ("ping", "pong")
            ),
            # history: a token declared in the same instant was missed without it in 4 of 9 runs.
            session.liveliness().declare_subscriber(
                service_key(system, "alive", owner, "*"), self._on_token, history=True
            ),
        ]

    def unlink(self) -> None:
        """End the session with the neighbours; the token vanishes at once."""
        self._declared.clear()
        close(self._session)

    def join(self, session: zenoh.Session) -> None:
        """Take orders in a session at the router, and say there what is for tools."""
        system, me = self._wiring.system, self._wiring.agent
        with self._joined:
            self._tools = session  # before a recorder can ask for the log
            self._orders = [self._ear(session, *one) for one in self._hears.items()]
            self._orders += self._doors(session)
        self._orders += [
            session.declare_subscriber(service_key(system, KIND, "*", me), self._on_order),
            session.declare_subscriber(service_key(system, LOG_WANTED, "*", me), self._on_wanted),
            session.liveliness().declare_token(self._life),
            *(
                one
                for group in sorted(self._wiring.groups)
                for one in self._heard(session, {group}, group)
            ),
        ]

    def hear(self, kind: str, on_data: Callable[[bytes], None]) -> None:
        """Hand on what is put at the router on keys of this kind for this agent; on Zenoh's
        threads.
        """
        with self._joined:
            self._hears[kind] = on_data
            if self._tools is not None:
                self._orders.append(self._ear(self._tools, kind, on_data))

    def hear_guests(self, on_data: Callable[[str, bytes], None]) -> None:
        """Hand on key and bytes of what guests of the design put at the router for this agent; on
        Zenoh's threads.
        """
        with self._joined:
            self._on_guest = on_data
            if self._tools is not None:
                self._orders += self._doors(self._tools)

    def _doors(self, session: zenoh.Session) -> list[Any]:
        if (on_data := self._on_guest) is None:
            return []
        system, me = self._wiring.system, self._wiring.agent
        return [
            session.declare_subscriber(
                f"roco/{system}/{channel}/{guest}/{me}/*/*",
                lambda sample: on_data(str(sample.key_expr), sample.payload.to_bytes()),
            )
            for guest, channel in self._wiring.guests.items()
        ]

    def say_to_guest(self, communicate: Communicate) -> None:
        """Put a communicate to a guest at the router: dropped where it would have to wait."""
        one, tools = communicate, self._tools
        channel = self._wiring.guests[one.receiver]
        key = communicate_key(
            self._wiring.system, channel, one.sender, one.receiver, one.protocol, one.performative
        )
        if tools is not None and not tools.is_closed():
            put(tools, key, encode(one), congestion_control=zenoh.CongestionControl.DROP)

    def _ear(self, session: zenoh.Session, kind: str, on_data: Callable[[bytes], None]) -> Any:
        key = service_key(self._wiring.system, kind, "*", self._wiring.agent)
        return session.declare_subscriber(key, lambda sample: on_data(sample.payload.to_bytes()))

    @property
    def at_router(self) -> bool:
        """Whether the session for tools is connected."""
        return (
            self._tools is not None
            and not self._tools.is_closed()
            and bool(self._tools.info.routers_zid())
        )

    # --- out --------------------------------------------------------------------------------------

    def knows(self, journals: Mapping[str, str]) -> None:
        """From now on the peers have journals of these names."""
        self._names = {peer: f"{self._journal}/{name}".encode() for peer, name in journals.items()}

    def send(self, communicate: Communicate, after: bytes = b"", heard: int = 0) -> int:
        """Put a communicate; its size in bytes. `after`, `heard`: which one it follows
        (streams.preceding).
        """
        data = encode(communicate)
        act = (communicate.receiver, communicate.protocol, communicate.performative)
        route = self._routes.get(act)
        if route is None:
            route = self._routes[act] = self._route(communicate)
        key, priority, bulky, kept = route
        names = self._attached(communicate.receiver) if kept else None
        if names and (after or heard):
            names += b"/" + after.hex().encode() + (f"/{heard}".encode() if heard else b"")
        self._put(
            communicate.receiver, key, data, priority if len(data) < BULK_BYTES else bulky, names
        )
        return len(data)

    def _attached(self, peer: str) -> bytes | None:
        return self._names.get(peer) or (f"{self._journal}/".encode() if self._journal else None)

    def _route(self, communicate: Communicate) -> tuple[zenoh.KeyExpr | str, Any, Any, bool]:
        """Key and priorities. One for a whole stream: an overtaking message would only be dropped
        as a gap.
        """
        link = self._wiring.required(communicate.receiver, communicate.protocol)
        key: zenoh.KeyExpr | str = self._wiring.key(communicate)
        if communicate.receiver not in self._wiring.groups:
            key = self._session.declare_keyexpr(key)
        if link.delivery is Delivery.DURABLE:
            return key, _FIRST, _FIRST, True
        return key, _SECOND, _LAST, link.delivery is Delivery.LATEST

    def send_receipt(self, receipt: Receipt) -> None:
        key = service_key(self._wiring.system, "receipt", self._wiring.agent, receipt.peer)
        self._put(
            receipt.peer, key, msgspec.msgpack.encode(receipt), _FIRST, self._attached(receipt.peer)
        )

    def ping(self, peer: str, channel: bytes, *, pong: bool = False) -> None:
        """Ask whether `peer` is there on a channel, or answer its question."""
        key = service_key(self._wiring.system, "pong" if pong else "ping", self._wiring.agent, peer)
        self._put(peer, key, channel, _SECOND)

    def publish(self, kind: str, data: bytes, *peer: str) -> None:
        """Put something for people: dropped where it would have to wait. Raises TooLongError."""
        key, tools = service_key(self._wiring.system, kind, self._wiring.agent, *peer), self._tools
        if tools is not None and not tools.is_closed():
            # More than about 1 MB/s of it must not be put: if the cable is cut under 3 MB/s, such a
            # put never returns (eclipse-zenoh 1.10.2, with any size of the socket's buffer). 0.6
            # MB/s does no harm (measured).
            drop = zenoh.CongestionControl.DROP
            put(tools, key, data, congestion_control=drop)

    def close(self) -> None:
        """Close the sessions; the token vanishes at once."""
        if self._sender is not None:
            self._sender.close()
        close(self._session)
        if self._tools is not None:
            close(self._tools)
        self._declared.clear()
        self._orders.clear()

    def _put(
        self,
        peer: str,
        key: zenoh.KeyExpr | str,
        data: bytes,
        priority: Any,
        attached: bytes | None = None,
    ) -> None:
        session = self._tools if peer in self._wiring.groups else self._session
        if session is None or session.is_closed():  # it is said again once it is open
            return
        how = {"priority": priority, "congestion_control": _BLOCK, "attachment": attached}
        put(session, key, data, **how)

    def _put_log(self, data: bytes) -> None:
        """Put a part of the log, behind everything else."""
        if self._tools is not None and not self._tools.is_closed():
            key = service_key(self._wiring.system, LOG_PART, self._wiring.agent)
            priority = zenoh.Priority.BACKGROUND
            put(self._tools, key, data, priority=priority, congestion_control=_BLOCK)

    # --- in: on Zenoh's threads -------------------------------------------------------------------

    def _on_communicate(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        kind, address, kept = self._known.get(key) or self._read_key(key)
        attached = _attachment(sample) if kept else NOTHING
        data = sample.payload.to_bytes()
        self._inbox.put(kind, Bytes(key, address, data, *attached), address[0], len(data))

    def _read_key(self, key: str) -> tuple[Class, tuple[str, ...], bool]:
        """The parts of a key, cached up to a bound, since strangers may make up keys without
        end.
        """
        chunks = key.split("/")
        link = self._wiring.link(chunks[3], chunks[5])
        durable = link is not None and link.delivery is Delivery.DURABLE
        kept = link is not None and link.delivery is not Delivery.VOLATILE
        found = Class.STREAM if durable else Class.VOLATILE, tuple(chunks[3:]), kept
        if len(self._known) < KNOWN_KEYS:
            self._known[key] = found
        return found

    def _on_receipt(self, sample: zenoh.Sample) -> None:
        peer, data = str(sample.key_expr).split("/")[4], sample.payload.to_bytes()
        if peer in self._channels:
            item = ReceiptBytes(peer, data, _attachment(sample)[0])
            self._inbox.put(Class.CONTROL, item, peer, len(data))

    def _on_order(self, sample: zenoh.Sample) -> None:
        data = sample.payload.to_bytes()
        self._inbox.put(Class.CONTROL, OrderBytes(data), KIND, len(data))

    def _on_wanted(self, sample: zenoh.Sample) -> None:
        if self._sender is not None:
            self._sender.wanted(sample.payload.to_bytes())

    def _on_question(self, sample: zenoh.Sample) -> None:
        """Take it only of a channel that there is: a pong says the channel again, however long it
        is.
        """
        kind, peer = str(sample.key_expr).split("/")[3:5]
        channel = sample.payload.to_bytes()
        if channel in self._channels.get(peer, ()):
            ping = Ping(peer, channel, pong=kind == "pong")
            self._inbox.put(Class.CONTROL, ping, peer, len(channel))

    def _on_token(self, sample: zenoh.Sample) -> None:
        agent, chunk = str(sample.key_expr).split("/")[-2:]
        found = parse_life(chunk)
        if agent in self._channels and found is not None:
            incarnation, journal = found
            alive = sample.kind == zenoh.SampleKind.PUT
            self._inbox.put(Class.LIFE, Token(agent, incarnation, alive, journal), agent)


def _attachment(sample: zenoh.Sample) -> Attached:
    attached = sample.attachment
    return NOTHING if attached is None else _attached(attached.to_bytes())


@lru_cache(KNOWN_NAMES)
def _attached(attached: bytes) -> Attached:
    """The names of both journals, and which message a durable one follows (Arrived)."""
    parts = (*attached[:LONGEST_NAMES].decode("ascii", "replace").split("/"), "", "", "")
    own, believed, after, heard = parts[:4]
    with suppress(ValueError):
        return (own, believed), bytes.fromhex(after), number_of(heard) or 0
    return (own, believed), NOBODYS, 0

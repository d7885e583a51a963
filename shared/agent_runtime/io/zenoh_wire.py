"""The one place that speaks Zenoh: a client session to the fleet's router, which hands on what it hears, and sends.

Every communicate is a put on its own key; receipts, pings and pongs are puts beside them; a liveliness token says
which incarnation of the agent is alive. Settings and their reasons: scouting off (no way around the router's rights),
lease 2 s (a frozen process is seen in 1.6-2.0 s, a pause of 1.2 s is not), fast reconnect, a frozen peer holds nobody
up for more than 0.1 s, no message beyond LONGEST, shared memory off (852 kB in a third of the time, but messages of one
process were lost after another was killed, and nobody was told). All measured with eclipse-zenoh 1.10.2.
"""

import ctypes
import json
import socket
import time
from collections.abc import Callable
from typing import Any, Protocol

import msgspec
import zenoh

from agent_runtime.core.control import KIND
from agent_runtime.core.effects import Receipt
from agent_runtime.core.wiring import Delivery, Wiring, service_key
from agent_runtime.io.inbox import Class
from fipa_codec.communicate import MAX_BYTES, Communicate, encode
from fipa_codec.errors import LocalProtocolError

BULK_BYTES = 16 * 1024
"""Volatile content from here on goes at low priority, so that it delays nobody else (estimate)."""
LEASE_MS = 2000
KNOWN_KEYS = 1024
"""Keys that are known; estimate: an agent hears on some dozen."""
KEPT_BYTES = 128 * 1024 * 1024
"""Free memory that a process keeps (estimate: some dozen of the largest messages, MAX_BYTES, with their copies)."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # glibc's malloc.h; its largest mmap threshold is 32 MB
_QUEUE = {"interactive_high": 16, "data": 16, "data_low": 16}
"""Batches (64 kB each) of a priority that may be on the way; the default of 2 holds an answer of 852 kB up by 20 %."""
ROUTER_PATIENCE_MS, CLIENT_PATIENCE_MS = 100, LEASE_MS
"""Longest time that a receiver that takes nothing delays its senders, before its session is closed.

The router must lose its patience well before a client does: while it waits for a slow monitor, it reads nothing from
the sender either. With 500 ms at both the sender's session was closed, and a healthy receiver got 45, 88, 150 of 150
messages of 852 kB; so all 150, three times (measured).
"""
LONGEST = 2 * MAX_BYTES
"""Bytes of a message that are put together again; more of it is dropped, the session stays (Zenoh's default: 1 GiB).

Rights are looked at afterwards, so this bounds what a session can have the router keep. Estimate: twice the longest
communicate leaves room for its key and Zenoh's own words.
"""
_FIRST, _SECOND, _LAST = zenoh.Priority.INTERACTIVE_HIGH, zenoh.Priority.DATA, zenoh.Priority.DATA_LOW
_BLOCK = zenoh.CongestionControl.BLOCK
_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
_NO_SCOUTING = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}


class Bytes(msgspec.Struct, frozen=True):
    """A communicate as it came off the wire, not decoded yet; `told`: what its key says of it.

    That is sender, receiver, protocol and performative.
    """

    key: str
    told: tuple[str, ...]
    data: bytes


class ReceiptBytes(msgspec.Struct, frozen=True):
    """A receipt of `peer` as it came."""

    peer: str
    data: bytes


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


class RouterSeen(msgspec.Struct, frozen=True):
    """The transport to the router opened (`up`) or closed."""

    up: bool


def client_config(endpoint: str, tls: dict[str, Any] | None = None) -> zenoh.Config:
    """Configuration of every agent. `endpoint` like tcp/127.0.0.1:7447; with `tls` (secured.client_tls) tls/..."""
    parts = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": 0, "retry": _RETRY},
        "scouting": _NO_SCOUTING,
        "transport": _transport(tls, CLIENT_PATIENCE_MS),
    }
    return zenoh.Config.from_json5(json.dumps(parts))


def router_config(
    endpoint: str,
    tls: dict[str, Any] | None = None,
    access_control: dict[str, Any] | None = None,
    links: tuple[str, ...] = (),
) -> zenoh.Config:
    """Configuration of the fleet's router. With keys (secured.router_tls) it grants the rights of `access_control`.

    `endpoint`: several, comma between, are independent: a flood of handshakes at one locks that one alone.
    `links`: endpoints of other routers; it listens whether they are there or not, and joins them whenever they are.
    """
    parts: dict[str, Any] = {
        "mode": "router",
        "listen": {"endpoints": endpoint.split(",")},
        "connect": {"endpoints": list(links), "timeout_ms": -1, "exit_on_failure": False, "retry": _RETRY},
        "scouting": _NO_SCOUTING,
        "transport": _transport(tls, ROUTER_PATIENCE_MS),
        "adminspace": {"enabled": True},
    }
    if access_control is not None:
        parts["access_control"] = access_control
    return zenoh.Config.from_json5(json.dumps(parts))


def _transport(tls: dict[str, Any] | None, patience_ms: int) -> dict[str, Any]:
    waiting = {"block": {"wait_before_close": patience_ms * 1000}}
    link: dict[str, Any] = {
        "tx": {"lease": LEASE_MS, "keep_alive": 4, "queue": {"size": _QUEUE, "congestion_control": waiting}},
        "rx": {"max_message_size": LONGEST},
    }
    return {"link": link if tls is None else link | {"tls": tls}, "shared_memory": {"enabled": False}}


def keep_memory() -> None:
    """Let the C library keep memory that large messages need repeatedly; else each page is mapped again each time.

    An answer of 852 kB through two agents takes two thirds of the time with it (benchmarks/communicates.py). Of glibc;
    elsewhere nothing happens.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_TRIM_THRESHOLD, KEPT_BYTES)
        mallopt(_M_MMAP_THRESHOLD, KEPT_BYTES // 4)


def open_router(
    endpoint: str,
    tls: dict[str, Any] | None = None,
    access_control: dict[str, Any] | None = None,
    links: tuple[str, ...] = (),
) -> zenoh.Session:
    """A router in this process; when this returns it listens. Raises zenoh.ZError where the address is taken."""
    keep_memory()
    return zenoh.open(router_config(endpoint, tls, access_control, links))


def open_client(
    endpoint: str, give_up: Callable[[], bool], every_s: float = 0.1, tls: dict[str, Any] | None = None
) -> zenoh.Session | None:
    """A session, as soon as the router is there; None when `give_up` says so first. Blocks for one try at a time."""
    keep_memory()
    while not give_up():
        try:
            return zenoh.open(client_config(endpoint, tls))
        except zenoh.ZError:
            time.sleep(every_s)  # a try without a router ends after 6 ms
    return None


def free_endpoint() -> str:
    """A loopback endpoint whose port nobody uses now."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{one.getsockname()[1]}"


class Entrance(Protocol):
    """The place in which the wire leaves samples: an Inbox, or the Floor before one."""

    def put(self, kind: Class, item: Any) -> object:
        """Take it, or keep it, or drop it; must not wait."""


class ZenohWire:
    """The session of one agent. All callbacks put into `inbox` and return."""

    def __init__(self, session: zenoh.Session, wiring: Wiring, incarnation: int, inbox: Entrance) -> None:
        """Declare what the agent listens to, then its token."""
        self._session, self._wiring, self._inbox = session, wiring, inbox
        self._routes: dict[tuple[str, str, str], tuple[zenoh.KeyExpr, Any, Any]] = {}
        self._known: dict[str, tuple[Class, tuple[str, ...]]] = {}
        system, me = wiring.system, wiring.agent
        # References are kept: a dropped declaration is undeclared.
        self._declared: list[Any] = [
            # Nothing is put by these. A router keeps the way of a key that somebody declared a publisher on, and finds
            # that of any other again each time: a tenth of a way there and back. The sender's own would do as well, but
            # they drop what they put until the router tells of a subscriber, which no agent has the right to learn.
            *(session.declare_publisher(key) for key in wiring.heard_keys()),
            session.info.declare_transport_events_listener(self._on_transport, history=True),
            *(session.declare_subscriber(key, self._on_communicate) for key in wiring.inbox_keys()),
            session.declare_subscriber(service_key(system, "receipt", "*", me), self._on_receipt),
            session.declare_subscriber(service_key(system, "ping", "*", me), self._on_ping),
            session.declare_subscriber(service_key(system, "pong", "*", me), self._on_pong),
            session.declare_subscriber(service_key(system, KIND, "*", me), self._on_order),
            # history: a token declared in the same instant was missed without it in 4 of 9 runs.
            session.liveliness().declare_subscriber(
                service_key(system, "alive", "*", "*"), self._on_token, history=True
            ),
            session.liveliness().declare_token(service_key(system, "alive", me, str(incarnation))),
        ]

    # --- out ----------------------------------------------------------------------------------------------------------

    def send(self, communicate: Communicate) -> int:
        """Put a communicate; its size in bytes."""
        data = encode(communicate)
        act = (communicate.receiver, communicate.protocol, communicate.performative)
        route = self._routes.get(act)
        if route is None:
            route = self._routes[act] = self._route(communicate)
        key, priority, bulky = route
        self._put(key, data, priority if len(data) < BULK_BYTES else bulky)
        return len(data)

    def _route(self, communicate: Communicate) -> tuple[zenoh.KeyExpr, Any, Any]:
        """Key and priorities. One for a whole stream: an overtaking message would only be dropped as a gap."""
        link = self._wiring.required(communicate.receiver, communicate.protocol)
        key = self._session.declare_keyexpr(self._wiring.key(communicate))
        return (key, _FIRST, _FIRST) if link.delivery is Delivery.DURABLE else (key, _SECOND, _LAST)

    def send_receipt(self, receipt: Receipt) -> None:
        """Put a receipt."""
        key = service_key(self._wiring.system, "receipt", self._wiring.agent, receipt.peer)
        self._put(key, msgspec.msgpack.encode(receipt), _FIRST)

    def ping(self, peer: str, channel: bytes, *, pong: bool = False) -> None:
        """Ask whether `peer` is there on a channel, or answer its question."""
        key = service_key(self._wiring.system, "pong" if pong else "ping", self._wiring.agent, peer)
        self._put(key, channel, _SECOND)

    def publish(self, kind: str, data: bytes) -> None:
        """Put something for people: dropped where it would have to wait. LocalProtocolError where it is too long."""
        if len(data) > MAX_BYTES:  # the router would drop it, and tell nobody
            raise LocalProtocolError(kind, f"has {len(data)} bytes, at most {MAX_BYTES} are published")
        key = service_key(self._wiring.system, kind, self._wiring.agent)
        if not self._session.is_closed():
            self._session.put(key, data, congestion_control=zenoh.CongestionControl.DROP)

    def close(self) -> None:
        """Close the session; the token vanishes at once."""
        self._session.close()  # type: ignore[no-untyped-call]
        self._declared.clear()

    def _put(self, key: zenoh.KeyExpr | str, data: bytes, priority: Any) -> None:
        self._session.put(key, data, priority=priority, congestion_control=_BLOCK)

    # --- in: on Zenoh's threads ---------------------------------------------------------------------------------------

    def _on_communicate(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        kind, told = self._known.get(key) or self._told(key)
        self._inbox.put(kind, Bytes(key, told, sample.payload.to_bytes()))

    def _told(self, key: str) -> tuple[Class, tuple[str, ...]]:
        """Return the parts of a key, cached up to a bound, since strangers may make up keys without end."""
        chunks = key.split("/")
        link = self._wiring.link(chunks[3], chunks[5])
        durable = link is not None and link.delivery is Delivery.DURABLE
        found = Class.STREAM if durable else Class.VOLATILE, tuple(chunks[3:])
        if len(self._known) < KNOWN_KEYS:
            self._known[key] = found
        return found

    def _on_receipt(self, sample: zenoh.Sample) -> None:
        self._inbox.put(Class.CONTROL, ReceiptBytes(_owner(sample), sample.payload.to_bytes()))

    def _on_order(self, sample: zenoh.Sample) -> None:
        self._inbox.put(Class.CONTROL, OrderBytes(sample.payload.to_bytes()))

    def _on_ping(self, sample: zenoh.Sample) -> None:
        self._inbox.put(Class.CONTROL, Ping(_owner(sample), sample.payload.to_bytes(), False))

    def _on_pong(self, sample: zenoh.Sample) -> None:
        self._inbox.put(Class.CONTROL, Ping(_owner(sample), sample.payload.to_bytes(), True))

    def _on_token(self, sample: zenoh.Sample) -> None:
        agent, incarnation = str(sample.key_expr).split("/")[-2:]
        if incarnation.isascii() and incarnation.isdigit():
            self._inbox.put(Class.CONTROL, Token(agent, int(incarnation), sample.kind == zenoh.SampleKind.PUT))

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        self._inbox.put(Class.CONTROL, RouterSeen(event.kind == zenoh.SampleKind.PUT))


def _owner(sample: zenoh.Sample) -> str:
    return str(sample.key_expr).split("/")[4]

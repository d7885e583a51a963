"""Other agents played from a script: to one real agent its peers are there, hear and receipt it, and say what they are
told to.

One session is linked with the agent for all of them; groups speak at the router. They have tokens, answer pings and
number their durable streams, but no behaviour, no memory and no journal. `Stage` is the router: nobody else's.
"""

import time
from collections.abc import Iterator
from queue import Empty
from typing import Any

import msgspec
import zenoh

from agent_runtime.core.effects import Receipt
from agent_runtime.core.errors import RuntimeFault
from agent_runtime.core.streams import RESEND_FIRST, parse_observation
from agent_runtime.core.wiring import Delivery, Wiring, communicate_key, service_key
from agent_runtime.io.message_size import put
from agent_runtime.io.one_reader import OneReaderQueue
from agent_runtime.io.sessions import free_endpoint, open_links, open_router
from agent_runtime.testing.stand_in import opened
from fipa_codec.communicate import UNREADABLE, Communicate, decode, encode, number_of
from fipa_codec.errors import FipaError

FIRST_LIFE = "1"


class LivingError(RuntimeFault):
    """`agents` live in the `system` on whose keys something was to be put."""

    def __init__(self, system: str, agents: tuple[str, ...], where: str) -> None:
        self.system, self.agents = system, agents
        super().__init__(
            f"{', '.join(agents)} live in system {system!r} at {where}: what is replayed there would be taken for"
            " their peers' words and move the robot; name another --system, or leave --connect away"
        )


class Stage:
    """A system's keys on a router: one of its own, on a free loopback port, or the one at `endpoint`."""

    def __init__(self, system: str, endpoint: str = "", *, patience_s: float = 5.0) -> None:
        """Raises StandInError where no router answers in time, LivingError where agents live in this system."""
        self.system, self.endpoint = system, endpoint or free_endpoint()
        self._router = None if endpoint else open_router(self.endpoint)
        self._session = session = opened(self.endpoint, patience_s)
        self._born = OneReaderQueue[str]()
        self._watch = session.liveliness().declare_subscriber(service_key(system, "alive", "*", "*"), self._seen)
        there = tuple(sorted(set(self._tokens())))
        if there:
            self.close()
            raise LivingError(system, there, self.endpoint)

    def put(self, key: str, data: bytes) -> None:
        """Say it. `key`: without the first two chunks. Raises LivingError if an agent of the system started."""
        if len(self._born):
            raise LivingError(self.system, (self._born.get(),), self.endpoint)
        put(self._session, f"roco/{self.system}/{key}", data, congestion_control=zenoh.CongestionControl.BLOCK)

    def close(self) -> None:
        """End it, and the own router."""
        for session in (self._session, self._router):
            if session is not None:
                session.close()  # type: ignore[no-untyped-call]

    def _tokens(self) -> list[str]:
        replies = self._session.liveliness().get(service_key(self.system, "alive", "*", "*"), timeout=1.0)
        return [str(reply.ok.key_expr).split("/")[4] for reply in replies if reply.ok is not None]

    def _seen(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self._born.put(str(sample.key_expr).split("/")[4])


class Cast:
    """The peers of the agent of `wiring`. `agents`: the endpoints with which that agent is to be started."""

    def __init__(self, wiring: Wiring, router: str, *, patience_s: float = 5.0) -> None:
        """Raises StandInError where no router answers in time: the groups of a design speak there."""
        at, own = free_endpoint(), free_endpoint()
        self.agents = dict.fromkeys(wiring.peers, at) | {wiring.agent: own}
        self._wiring = wiring
        linked = open_links(at, (own,))
        routed = opened(router, patience_s) if wiring.groups else linked
        self._sessions = {peer: routed if peer in wiring.groups else linked for peer in wiring.peers}
        self._heard = OneReaderQueue[Communicate]()
        self._numbers = dict.fromkeys(wiring.peers, 0)
        self._taken = dict.fromkeys(wiring.peers, 0)
        self._outbox: dict[str, dict[int, tuple[str, bytes]]] = {peer: {} for peer in wiring.peers}
        self._known: set[tuple[str, str]] = set()
        self._due = 0.0
        self._declared = [one for peer in wiring.peers for one in self._heard_as(peer)]

    def _heard_as(self, peer: str) -> Iterator[Any]:
        """Hear what the agent says to this peer, and be alive to it as the peer."""
        system, me, session = self._wiring.system, self._wiring.agent, self._sessions[peer]
        yield session.declare_subscriber(f"roco/{system}/*/{me}/{peer}/*/*", self._on_said)
        yield session.declare_subscriber(service_key(system, "ping", me, peer), self._on_ping)
        yield session.declare_subscriber(service_key(system, "receipt", me, peer), self._on_receipt)
        yield session.liveliness().declare_token(service_key(system, "alive", peer, FIRST_LIFE))

    def say(self, communicate: Communicate) -> Communicate:
        """Say it as its sender, with the next number where its stream is durable; what was said.

        Its m_w becomes the number, too, where it was its id. Sent again until it is receipted.
        """
        peer = communicate.sender
        link = self._wiring.required(peer, communicate.protocol)
        one = communicate
        if link.delivery is Delivery.DURABLE:
            self._numbers[peer] += 1
            id = str(self._numbers[peer])
            label = id if one.reply_with == one.id else one.reply_with
            one = msgspec.structs.replace(one, id=id, reply_with=label)
        key = communicate_key(self._wiring.system, link.channel, peer, one.receiver, one.protocol, one.performative)
        data = encode(one)
        if link.delivery is Delivery.DURABLE:
            self._outbox[peer][self._numbers[peer]] = (key, data)
            self._due = time.monotonic() + RESEND_FIRST
        self._put(peer, key, data)
        return one

    def hear(self, timeout_s: float) -> Communicate | None:
        """Return the agent's next message, each once and in the order of each stream; None: nothing in time."""
        until = time.monotonic() + timeout_s
        while True:
            left = until - time.monotonic()
            try:
                one = self._heard.get(min(left, RESEND_FIRST))
            except Empty:
                one = None
            self._resend()
            if one is not None and self._fresh(one):
                return one
            if left <= 0:
                return None

    def close(self) -> None:
        """Leave; the tokens vanish."""
        for session in set(self._sessions.values()):
            session.close()  # type: ignore[no-untyped-call]

    def _fresh(self, one: Communicate) -> bool:
        """Whether it is the next of its stream, or none of a stream; receipts what wants a receipt."""
        peer, me = one.receiver, self._wiring.agent
        link = self._wiring.link(peer, one.protocol)
        if link is None:
            return True
        observed = parse_observation(one.id) if link.delivery is Delivery.LATEST else None
        if observed is not None:
            self._receipt(peer, Receipt(me, subject=observed[0], version=observed[1]))
        number = number_of(one.id) if link.delivery is Delivery.DURABLE else None
        if number is None:
            new = (peer, one.id) not in self._known
            self._known.add((peer, one.id))
            return new
        fresh = number == self._taken[peer] + 1
        self._taken[peer] += fresh
        self._receipt(peer, Receipt(me, taken=self._taken[peer]))
        return fresh

    def _receipt(self, peer: str, receipt: Receipt) -> None:
        key = service_key(self._wiring.system, "receipt", peer, self._wiring.agent)
        self._put(peer, key, msgspec.msgpack.encode(receipt))

    def _resend(self) -> None:
        if time.monotonic() >= self._due:
            for peer, sent in self._outbox.items():
                for key, data in list(sent.values()):
                    self._put(peer, key, data)
            self._due = time.monotonic() + RESEND_FIRST

    def _put(self, peer: str, key: str, data: bytes) -> None:
        put(self._sessions[peer], key, data, congestion_control=zenoh.CongestionControl.BLOCK)

    # --- on Zenoh's threads -------------------------------------------------------------------------------------------

    def _on_said(self, sample: zenoh.Sample) -> None:
        try:
            self._heard.put(decode(sample.payload.to_bytes()))
        except FipaError:
            return

    def _on_ping(self, sample: zenoh.Sample) -> None:
        peer = str(sample.key_expr).split("/")[5]
        self._put(peer, service_key(self._wiring.system, "pong", peer, self._wiring.agent), sample.payload.to_bytes())

    def _on_receipt(self, sample: zenoh.Sample) -> None:
        peer = str(sample.key_expr).split("/")[5]
        try:
            receipt = msgspec.msgpack.decode(sample.payload.to_bytes(), type=Receipt)
        except UNREADABLE:
            return
        for number in [one for one in list(self._outbox.get(peer, {})) if one <= receipt.taken]:
            self._outbox[peer].pop(number, None)

"""A person in an agent's place: a life of the agent without its behaviour, or a mere voice beside
it.

A stand-in holds the agent's own journal, so that it numbers its streams on from the agent's last
life, and the agent's next life from it: no peer sees a number twice or misses one. What is said to
it, it takes and receipts, and the agent will not see it. It keeps no conversation: the agent's next
life knows of none.
"""

import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from queue import Empty
from typing import Any

import msgspec
import zenoh

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.core.events import Receipt
from agent_runtime.core.peers import begin_again
from agent_runtime.core.state import Outgoing, Record
from agent_runtime.core.streams import (
    RESEND_FIRST,
    covered,
    digest_of,
    note,
    parse_observation,
    preceding,
    receipt,
)
from agent_runtime.core.wiring import Delivery, Wiring, communicate_key, parse_life, service_key
from agent_runtime.io.inbox import Inbox, OneReaderQueue
from agent_runtime.io.journal import Journal, journal_file, new_name
from agent_runtime.io.sessions import (
    Links,
    free_endpoint,
    open_client,
    open_links,
    open_router,
    put,
)
from agent_runtime.io.zenoh_wire import NAMELESS, Bytes, Ping, ReceiptBytes, Token, ZenohWire
from fipa_codec.communicate import (
    UNREADABLE,
    Communicate,
    decode,
    decode_strictly,
    encode,
    encode_strictly,
    number_of,
)
from fipa_codec.errors import FipaError, MalformedError

FIRST_MEMORY = msgspec.Raw(b"\x80")
"""An empty map: memory of an agent that never lived, each field its default."""
LOOK_S = 1.0
"""Longest wait for liveliness tokens [s]; estimate: they come within ms, and links within 0.2 s."""


class StandInError(RuntimeFault):
    """The agent `lives`, or (else) nobody answers."""

    def __init__(self, what: str, *, lives: bool) -> None:
        self.what, self.lives = what, lives
        super().__init__(what)


class Voice:
    """Puts communicates on keys and hears what is said on others. No agent: it has no token, number
    or journal.
    """

    def __init__(
        self,
        endpoint: str,
        keys: tuple[str, ...],
        *,
        patience_s: float = 5.0,
        tls: dict[str, Any] | None = None,
    ) -> None:
        """Dial a router, or the agent that is to hear. `tls`: secured.client_tls of whose voice it
        is.

        Raises StandInError where nobody answers in time.
        """
        self._session = opened(endpoint, patience_s, tls)
        self._heard = OneReaderQueue[bytes]()
        self._declared = [
            self._session.declare_subscriber(
                key, lambda sample: self._heard.put(sample.payload.to_bytes())
            )
            for key in keys
        ]

    def put(self, key: str, communicate: Communicate) -> int:
        """Say it; its size in bytes."""
        data = encode_strictly(communicate)
        put(self._session, key, data, congestion_control=zenoh.CongestionControl.BLOCK)
        return len(data)

    def hear(self, until: float) -> Iterator[Communicate]:
        """The next message heard until then [unix s]."""
        while (left := until - time.time()) > 0:
            try:
                yield decode_strictly(self._heard.get(left))
            except (Empty, MalformedError):
                continue

    def close(self) -> None:
        """Say and hear no more."""
        self._session.close()  # type: ignore[no-untyped-call]


class StandIn:
    """A life of the agent of `wiring`; `start` is its first state, for a journal that is not there
    yet.
    """

    def __init__(
        self,
        wiring: Wiring,
        start: str,
        run: Path,
        links: Links,
        *,
        router: str = "",
        patience_s: float = 5.0,
        tls: dict[str, Any] | None = None,
    ) -> None:
        """`links`: the agent's own; `router`: where groups of the design are spoken to, with the
        keys `tls`.

        Raises JournalError where the agent's process has the journal, StandInError where it lives
        elsewhere.
        """
        self._wiring, self._inbox, self._early = wiring, Inbox(), deque[Any]()
        try:
            self._session = links.open()
        except zenoh.ZError as error:
            raise StandInError(f"{wiring.agent} lives: {links.at} is taken", lives=True) from error
        try:
            there = living(self._session, wiring.system, wiring.agent)
            if there:
                life = max(there[wiring.agent])
                raise StandInError(f"{wiring.agent} lives, as incarnation {life}", lives=True)
            self._journal = Journal(journal_file(run, wiring.agent))
        except RuntimeFault:
            self._session.close()  # type: ignore[no-untyped-call]
            raise
        self._record = _record(self._journal.last, wiring.agent, start)
        self._record.incarnation += 1
        self._keep()
        session, incarnation = self._session, self._record.incarnation
        self._wire = ZenohWire(session, wiring, incarnation, self._inbox, self._record.journal)
        self._wire.knows(self._record.journals)
        self._due = 0.0
        if router and wiring.groups:
            self._wire.join(opened(router, patience_s, tls))
        self._meet(time.time() + LOOK_S)

    @property
    def incarnation(self) -> int:
        """The number of this life of the agent."""
        return self._record.incarnation

    def name(self) -> str:
        """A fresh id for a conversation or a volatile message."""
        self._record.counter += 1
        return f"{self._record.agent}-{self._record.incarnation}-{self._record.counter}"

    def unreceipted(self, peer: str) -> int:
        """The number of durable messages without a receipt; the next life sends them again."""
        return len(self._record.outbox.get(peer, ()))

    def say(self, communicate: Communicate, *, labelled: bool) -> Communicate:
        """Say it, with an id and the time put in; `labelled`: its m_w is its id. On the disk before
        it leaves.
        """
        link = self._wiring.required(communicate.receiver, communicate.protocol)
        peer, durable = communicate.receiver, link.delivery is Delivery.DURABLE
        number = self._record.issued.get(peer, 0) + 1
        id = str(number) if durable else self.name()
        label = communicate.reply_with or (id if labelled else "")
        one = msgspec.structs.replace(communicate, id=id, reply_with=label, sent=time.time())
        encode_strictly(one)  # LocalProtocolError before anything is kept
        if durable:
            self._record.issued[peer] = number
            self._record.outbox[peer] = (*self._record.outbox.get(peer, ()), Outgoing(number, one))
        self._keep()
        self._wire.send(one, *preceding(self._record, one))
        self._due = time.time() + RESEND_FIRST
        return one

    def hear(self, until: float, *, unless_receipted: str = "") -> Iterator[Communicate]:
        """Messages to the agent, each once, until then [unix s]; meanwhile it pongs, receipts and
        sends again.

        `unless_receipted`: no longer than this peer owes a receipt.
        """
        seen: set[tuple[str, str]] = set()
        while (left := until - time.time()) > 0 and (
            not unless_receipted or self.unreceipted(unless_receipted)
        ):
            wait = min(left, max(0.0, self._due - time.time()) or left)
            item = self._early.popleft() if self._early else self._inbox.get(wait)
            match item:
                case Bytes():
                    one = self._taken(item)
                    if one is not None and (one.sender, one.id) not in seen:
                        seen.add((one.sender, one.id))
                        yield one
                case ReceiptBytes():
                    self._settle(item)
                case Token(alive=True):
                    self._met(item)
                case Ping(pong=False):
                    self._wire.ping(item.peer, item.channel, pong=True)
            self._resend()

    def _meet(self, until: float) -> None:
        """Wait until all neighbours are linked. A volatile message that is said before reaches
        nobody.
        """
        missing = set(self._wiring.peers) - self._wiring.groups
        while (
            missing
            and (left := until - time.time()) > 0
            and (item := self._inbox.get(left)) is not None
        ):
            self._early.append(item)
            if isinstance(item, Token) and item.alive:
                missing.discard(item.agent)

    def close(self) -> None:
        """Die in order."""
        self._keep()
        self._wire.close()
        self._journal.close()

    def _met(self, token: Token) -> None:
        """Note a peer's journal. With a peer that lost its own, the streams begin again."""
        known = self._record.journals.get(token.agent)
        if token.agent not in self._wiring.peers or not token.journal or token.journal == known:
            return
        if known is not None:
            begin_again(self._record, token.agent, f"{token.agent} lost its memory")
        self._record.journals = self._record.journals | {token.agent: token.journal}
        self._wire.knows(self._record.journals)
        self._keep()

    def _fits(self, peer: str, journals: tuple[str, str]) -> bool:
        """Whether something is between the present journals of both."""
        known = (self._record.journals.get(peer), self._record.journal)
        return journals in (NAMELESS, known)

    def _keep(self) -> None:
        self._journal.append(msgspec.msgpack.encode(self._record))

    def _taken(self, item: Bytes) -> Communicate | None:
        """A communicate of a volatile kind, or the next one of a durable stream, which is
        receipted.
        """
        try:
            one = decode_strictly(item.data)
        except MalformedError:
            return None
        link = self._wiring.link(one.sender, one.protocol)
        if link is None or link.delivery is not Delivery.DURABLE:
            return one
        if not self._fits(one.sender, item.journals):
            return None
        before = self._record.taken.get(one.sender, 0)
        number = number_of(one.id)
        if number is None:
            return None
        if number == before + 1:
            note(self._record, one.sender, number, digest_of(one))
            self._keep()
        if number <= before + 1:
            self._wire.send_receipt(receipt(self._record, one.sender))
        return one if number == before + 1 else None

    def _settle(self, item: ReceiptBytes) -> None:
        try:
            came = msgspec.msgpack.decode(item.data, type=Receipt)
        except UNREADABLE:
            return
        if not self._fits(item.peer, item.journals):
            return
        sent = self._record.outbox.get(item.peer, ())
        taken = covered(sent, came.taken, came.digest)
        if came.life and not came.answer:
            known = receipt(self._record, item.peer)
            self._wire.send_receipt(msgspec.structs.replace(known, life=came.life, answer=True))
        rest = tuple(one for one in sent if one.number > taken)
        if len(rest) < len(sent):
            self._record.heard[item.peer] = taken
        if rest:
            self._record.outbox[item.peer] = rest
        else:
            self._record.outbox.pop(item.peer, None)

    def _resend(self) -> None:
        if time.time() >= self._due:
            for sent in self._record.outbox.values():
                for outgoing in sent:
                    self._wire.send(
                        outgoing.communicate, *preceding(self._record, outgoing.communicate)
                    )
            self._due = time.time() + RESEND_FIRST


def living(session: zenoh.Session, system: str, agent: str) -> dict[str, list[int]]:
    """The incarnations, by agent, whose tokens are there; `agent` "*": of all."""
    replies = session.liveliness().get(service_key(system, "alive", agent, "*"), timeout=LOOK_S)
    found: dict[str, list[int]] = {}
    for reply in replies:
        if reply.ok is not None:
            name, chunk = str(reply.ok.key_expr).split("/")[-2:]
            life = parse_life(chunk)
            if life is not None:
                found.setdefault(name, []).append(life[0])
    return found


def opened(endpoint: str, patience_s: float, tls: dict[str, Any] | None = None) -> zenoh.Session:
    """A session at a router, or with an agent. Raise StandInError where nobody answers in time."""
    until = time.monotonic() + patience_s
    session = open_client(endpoint, lambda: time.monotonic() > until, tls=tls)
    if session is None:
        raise StandInError(f"nobody answers at {endpoint}", lives=False)
    return session


def _record(last: bytes | None, agent: str, start: str) -> Record:
    if last is not None:
        return msgspec.msgpack.decode(last, type=Record)
    return Record(
        agent=agent, incarnation=0, counter=0, state=start, memory=FIRST_MEMORY, journal=new_name()
    )


# --- Other agents played from a script ------------------------------------------------------------
# One real agent finds its peers there: they hear it, receipt what it says, and say what they are
# told to.
#
# One session is linked with the agent for all of them; groups speak at the router. They have
# tokens, answer pings and number their durable streams, but no behaviour, no memory and no journal.
# `Stage` is the router: nobody else's.


FIRST_LIFE = "1"


class LivingError(RuntimeFault):
    """`agents` live in the `system` on whose keys something was to be put."""

    def __init__(self, system: str, agents: tuple[str, ...], where: str) -> None:
        self.system, self.agents = system, agents
        super().__init__(
            f"{', '.join(agents)} live in system {system!r} at {where}: what is replayed there"
            " would be taken for their peers' words and move the robot; name another --system, or"
            " leave --connect away"
        )


class Stage:
    """A system's keys on a router: one of its own, on a free loopback port, or the one at
    `endpoint`.
    """

    def __init__(self, system: str, endpoint: str = "", *, patience_s: float = 5.0) -> None:
        """Raises StandInError where no router answers in time, LivingError where agents live in
        this system.
        """
        self.system, self.endpoint = system, endpoint or free_endpoint()
        self._router = None if endpoint else open_router(self.endpoint)
        self._session = session = opened(self.endpoint, patience_s)
        self._born = OneReaderQueue[str]()
        self._watch = session.liveliness().declare_subscriber(
            service_key(system, "alive", "*", "*"), self._seen
        )
        there = tuple(sorted(living(session, system, "*")))
        if there:
            self.close()
            raise LivingError(system, there, self.endpoint)

    def put(self, key: str, data: bytes) -> None:
        """Say it. `key`: without the first two chunks. Raises LivingError if an agent of the system
        started.
        """
        if len(self._born):
            raise LivingError(self.system, (self._born.get(),), self.endpoint)
        congestion_control = zenoh.CongestionControl.BLOCK
        put(self._session, f"roco/{self.system}/{key}", data, congestion_control=congestion_control)

    def close(self) -> None:
        """End it, and the own router."""
        for session in (self._session, self._router):
            if session is not None:
                session.close()  # type: ignore[no-untyped-call]

    def _seen(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self._born.put(str(sample.key_expr).split("/")[4])


class Cast:
    """The peers of the agent of `wiring`. `agents`: the endpoints with which that agent is to be
    started.
    """

    def __init__(self, wiring: Wiring, router: str, *, patience_s: float = 5.0) -> None:
        """Raises StandInError where no router answers in time: the groups of a design speak
        there.
        """
        at, own = free_endpoint(), free_endpoint()
        self.agents = dict.fromkeys(wiring.peers, at) | {wiring.agent: own}
        self._wiring = wiring
        linked = open_links(at, (own,))
        routed = opened(router, patience_s) if wiring.groups else linked
        self._sessions = {
            peer: routed if peer in wiring.groups else linked for peer in wiring.peers
        }
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
        system, channel = self._wiring.system, link.channel
        key = communicate_key(system, channel, peer, one.receiver, one.protocol, one.performative)
        data = encode(one)
        if link.delivery is Delivery.DURABLE:
            self._outbox[peer][self._numbers[peer]] = (key, data)
            self._due = time.monotonic() + RESEND_FIRST
        self._put(peer, key, data)
        return one

    def hear(self, timeout_s: float) -> Communicate | None:
        """The agent's next message, each once and in the order of each stream; None: nothing in
        time.
        """
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
        """Whether it is the next of its stream, or none of a stream; receipts what wants a
        receipt.
        """
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

    # --- on Zenoh's threads -----------------------------------------------------------------------

    def _on_said(self, sample: zenoh.Sample) -> None:
        try:
            self._heard.put(decode(sample.payload.to_bytes()))
        except FipaError:
            return

    def _on_ping(self, sample: zenoh.Sample) -> None:
        peer = str(sample.key_expr).split("/")[5]
        key = service_key(self._wiring.system, "pong", peer, self._wiring.agent)
        self._put(peer, key, sample.payload.to_bytes())

    def _on_receipt(self, sample: zenoh.Sample) -> None:
        peer = str(sample.key_expr).split("/")[5]
        try:
            receipt = msgspec.msgpack.decode(sample.payload.to_bytes(), type=Receipt)
        except UNREADABLE:
            return
        for number in [one for one in list(self._outbox.get(peer, {})) if one <= receipt.taken]:
            self._outbox[peer].pop(number, None)

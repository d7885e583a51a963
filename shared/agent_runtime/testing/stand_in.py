"""A person in an agent's place: a life of the agent without its behaviour, or a mere voice beside it.

A stand-in holds the agent's own journal, so that it numbers its streams on from the agent's last life, and the agent's
next life from it: no peer sees a number twice or misses one. What is said to it, it takes and receipts, and the agent
will not see it. It keeps no conversation: the agent's next life knows of none.
"""

import queue
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from agent_runtime.core.effects import Receipt
from agent_runtime.core.errors import RuntimeFault
from agent_runtime.core.state import Outgoing, Record
from agent_runtime.core.streams import RESEND_FIRST
from agent_runtime.core.wiring import Delivery, Wiring, service_key
from agent_runtime.io.inbox import Inbox
from agent_runtime.io.journal import Journal
from agent_runtime.io.zenoh_wire import Bytes, Ping, ReceiptBytes, ZenohWire, open_client
from fipa_codec.communicate import Communicate, decode_strictly, encode_strictly
from fipa_codec.errors import MalformedError

FIRST_MEMORY = msgspec.Raw(b"\x80")
"""An empty map: memory of an agent that never lived, each field its default."""
LOOK_S = 1.0
"""Longest wait for liveliness tokens [s]; estimate: the router answers within ms."""


class StandInError(RuntimeFault):
    """The agent `lives`, or (else) no router answers."""

    def __init__(self, what: str, *, lives: bool) -> None:
        self.what, self.lives = what, lives
        super().__init__(what)


class Voice:
    """Puts communicates on keys and hears what is said on others. No agent: it has no token, number or journal."""

    def __init__(
        self, endpoint: str, keys: tuple[str, ...], *, patience_s: float = 5.0, tls: dict[str, Any] | None = None
    ) -> None:
        """Raises StandInError where no router answers in time. `tls`: secured.client_tls of whose voice it is."""
        self._session = _opened(endpoint, patience_s, tls)
        self._heard: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._declared = [
            self._session.declare_subscriber(key, lambda sample: self._heard.put(sample.payload.to_bytes()))
            for key in keys
        ]

    def put(self, key: str, communicate: Communicate) -> int:
        """Say it; its size in bytes."""
        data = encode_strictly(communicate)
        self._session.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK)
        return len(data)

    def hear(self, until: float) -> Iterator[Communicate]:
        """Return the next message heard until then [unix s]."""
        while (left := until - time.time()) > 0:
            try:
                yield decode_strictly(self._heard.get(timeout=left))
            except (queue.Empty, MalformedError):
                continue

    def close(self) -> None:
        """Say and hear no more."""
        self._session.close()  # type: ignore[no-untyped-call]


class StandIn:
    """A life of the agent of `wiring`; `start` is its first state, for a journal that is not there yet."""

    def __init__(
        self,
        wiring: Wiring,
        start: str,
        run: Path,
        endpoint: str,
        *,
        patience_s: float = 5.0,
        tls: dict[str, Any] | None = None,
    ) -> None:
        """Raises JournalError where the agent's process has the journal, StandInError where it lives elsewhere."""
        self._wiring, self._inbox = wiring, Inbox()
        self._session = _opened(endpoint, patience_s, tls)
        try:
            there = living(self._session, wiring.system, wiring.agent)
            if there:
                raise StandInError(f"{wiring.agent} lives, as incarnation {max(there)}", lives=True)
            self._journal = Journal(run / "journal" / f"{wiring.agent}.journal")
        except RuntimeFault:
            self._session.close()  # type: ignore[no-untyped-call]
            raise
        self._record = _record(self._journal.last, wiring.agent, start)
        self._record.incarnation += 1
        self._keep()
        self._wire = ZenohWire(self._session, wiring, self._record.incarnation, self._inbox)
        self._due = 0.0

    @property
    def incarnation(self) -> int:
        """Return the number of this life of the agent."""
        return self._record.incarnation

    def name(self) -> str:
        """A fresh id for a conversation or a volatile message."""
        self._record.counter += 1
        return f"{self._record.agent}-{self._record.incarnation}-{self._record.counter}"

    def unreceipted(self, peer: str) -> int:
        """Return the number of durable messages without a receipt; the next life sends them again."""
        return len(self._record.outbox.get(peer, ()))

    def say(self, communicate: Communicate, *, labelled: bool) -> Communicate:
        """Say it, with an id and the time put in; `labelled`: its m_w is its id. On the disk before it leaves."""
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
        self._wire.send(one)
        self._due = time.time() + RESEND_FIRST
        return one

    def hear(self, until: float, *, unless_receipted: str = "") -> Iterator[Communicate]:
        """Return messages to the agent, each once, until then [unix s]; meanwhile it pongs, receipts and sends again.

        `unless_receipted`: no longer than this peer owes a receipt.
        """
        seen: set[tuple[str, str]] = set()
        while (left := until - time.time()) > 0 and (not unless_receipted or self.unreceipted(unless_receipted)):
            item = self._inbox.get(min(left, max(0.0, self._due - time.time()) or left))
            match item:
                case Bytes():
                    one = self._taken(item)
                    if one is not None and (one.sender, one.id) not in seen:
                        seen.add((one.sender, one.id))
                        yield one
                case ReceiptBytes():
                    self._settle(item)
                case Ping(pong=False):
                    self._wire.ping(item.peer, item.channel, pong=True)
            self._resend()

    def close(self) -> None:
        """Die in order."""
        self._keep()
        self._wire.close()
        self._journal.close()

    def _keep(self) -> None:
        self._journal.append(msgspec.msgpack.encode(self._record))

    def _taken(self, item: Bytes) -> Communicate | None:
        """A communicate of a volatile kind, or the next one of a durable stream, which is receipted."""
        try:
            one = decode_strictly(item.data)
        except MalformedError:
            return None
        link = self._wiring.link(one.sender, one.protocol)
        if link is None or link.delivery is not Delivery.DURABLE:
            return one
        before = self._record.taken.get(one.sender, 0)
        number = int(one.id) if one.id.isascii() and one.id.isdigit() else before + 2
        if number == before + 1:
            self._record.taken[one.sender] = number
            self._keep()
        if number <= before + 1:
            self._wire.send_receipt(Receipt(one.sender, taken=self._record.taken[one.sender]))
        return one if number == before + 1 else None

    def _settle(self, item: ReceiptBytes) -> None:
        try:
            receipt = msgspec.msgpack.decode(item.data, type=Receipt)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
            return
        rest = tuple(one for one in self._record.outbox.get(item.peer, ()) if one.number > receipt.taken)
        if rest:
            self._record.outbox[item.peer] = rest
        else:
            self._record.outbox.pop(item.peer, None)

    def _resend(self) -> None:
        if time.time() >= self._due:
            for sent in self._record.outbox.values():
                for outgoing in sent:
                    self._wire.send(outgoing.communicate)
            self._due = time.time() + RESEND_FIRST


def living(session: zenoh.Session, system: str, agent: str) -> list[int]:
    """The incarnations of an agent whose tokens are there."""
    replies = session.liveliness().get(service_key(system, "alive", agent, "*"), timeout=LOOK_S)
    names = [str(reply.ok.key_expr).rsplit("/", 1)[-1] for reply in replies if reply.ok is not None]
    return [int(name) for name in names if name.isascii() and name.isdigit()]


def _opened(endpoint: str, patience_s: float, tls: dict[str, Any] | None) -> zenoh.Session:
    until = time.monotonic() + patience_s
    session = open_client(endpoint, lambda: time.monotonic() > until, tls=tls)
    if session is None:
        raise StandInError(f"no router answers at {endpoint}", lives=False)
    return session


def _record(last: bytes | None, agent: str, start: str) -> Record:
    if last is not None:
        return msgspec.msgpack.decode(last, type=Record)
    return Record(agent=agent, incarnation=0, counter=0, state=start, memory=FIRST_MEMORY)

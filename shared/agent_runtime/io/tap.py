"""Listening beside the agents: heartbeats, telemetry, orders and liveliness tokens of one or more
systems, one session.

Takes part in nothing: it sends no receipt and declares no token, so nobody waits for it. What
agents say to each other it does not hear; their step logs have that. What guests say and are told
it hears. Callbacks of Zenoh call `on_sample`, which must only enqueue: while it works, every other
sample waits.
"""

import threading
import time
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from queue import Empty

import msgspec
import zenoh

from agent_runtime.core.control import KIND
from agent_runtime.core.wiring import service_key
from agent_runtime.io.inbox import OneReaderQueue
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import close, open_client, put

RECORDER = "monitor"
"""The identity that hears everything, where there are keys."""
LATEST_S = 60.0
"""Longest time from the router to here for which its stamp is believed; estimate: pauses of a
minute are tried.
"""


class Sample(msgspec.Struct, frozen=True):
    """Something said on `key` at `at` [unix s]. `token`: a liveliness token, declared or (`gone`)
    withdrawn.

    `size`: bytes of a communicate of which `data` has all but the content, since nobody took it;
    else 0. `broken`: why bytes that reached an agent, and are not known, were no communicate.
    """

    key: str
    data: bytes
    at: float
    token: bool = False
    gone: bool = False
    size: int = 0
    broken: str = ""

    @property
    def system(self) -> str:
        """The system it belongs to."""
        return self.key.split("/")[1]


class Tap:
    """The open subscriptions."""

    def __init__(
        self,
        session: zenoh.Session,
        systems: tuple[str, ...],
        on_sample: Callable[[Sample], None],
        guests: Collection[str] = (),
    ) -> None:
        self._session = session

        def heard(sample: zenoh.Sample) -> None:
            on_sample(Sample(str(sample.key_expr), sample.payload.to_bytes(), _passed(sample)))

        def lived(sample: zenoh.Sample) -> None:
            gone = sample.kind == zenoh.SampleKind.DELETE
            on_sample(Sample(str(sample.key_expr), b"", time.time(), token=True, gone=gone))

        # References are kept: a dropped declaration is undeclared. Of keys that name a peer orders
        # alone are heard.
        keys = [
            key
            for system in systems
            for key in (
                service_key(system, "*", "*"),
                service_key(system, KIND, "*", "*"),
                *(f"roco/{system}/*/{guest}/*/*/*" for guest in guests),
                *(f"roco/{system}/*/*/{guest}/*/*" for guest in guests),
            )
        ]
        self._declared = (
            *(session.declare_subscriber(key, heard) for key in keys),
            *(
                session.liveliness().declare_subscriber(
                    service_key(system, "alive", "*", "*"), lived, history=True
                )
                for system in systems
            ),
        )

    def put(self, key: str, data: bytes) -> None:
        """Say something to an agent."""
        if not self._session.is_closed():
            put(self._session, key, data)

    def close(self) -> None:
        """Hear no more."""
        close(self._session)


class Ear:
    """The open subscriptions to single keys, of who has the right to no more."""

    def __init__(self, session: zenoh.Session, key: str, on_data: Callable[[bytes], None]) -> None:
        """`on_data` gets what is put, from Zenoh's threads."""
        self._session = session
        self._declared = [self._heard(key, on_data)]

    def hear(self, key: str, on_data: Callable[[bytes], None]) -> None:
        """Hear another key, too."""
        self._declared.append(self._heard(key, on_data))

    def put(self, key: str, data: bytes) -> None:
        """Say something, where the router is reached."""
        if not self._session.is_closed():
            put(self._session, key, data)

    def _heard(self, key: str, on_data: Callable[[bytes], None]) -> zenoh.Subscriber[None]:
        return self._session.declare_subscriber(
            key, lambda sample: on_data(sample.payload.to_bytes())
        )

    def close(self) -> None:
        """Hear no more."""
        close(self._session)


def open_ear(
    options: Options,
    key: str,
    on_data: Callable[[bytes], None],
    give_up: Callable[[], bool],
    identity: str,
) -> Ear | None:
    """An ear, as soon as the router is there; None when `give_up` says so first. `identity`: with
    keys, whose.
    """
    tls = client_tls(options.keys, identity) if options.keys else None
    session = open_client(options.connect, give_up, tls=tls)
    return None if session is None else Ear(session, key, on_data)


def _passed(sample: zenoh.Sample) -> float:
    """When it passed the router [unix s], whose clock stamps it, however late it is read here.

    A stamp that cannot be (another host's clock, or a sender's own) counts for nothing.
    """
    now, stamp = time.time(), sample.timestamp
    if stamp is None:
        return now
    passed = stamp.get_time().timestamp()
    return passed if now - LATEST_S < passed <= now else now


def open_tap(
    options: Options,
    on_sample: Callable[[Sample], None],
    give_up: Callable[[], bool],
    identity: str = RECORDER,
    told: Callable[[str], None] = lambda why: None,
    guests: Collection[str] = (),
) -> Tap | None:
    """A tap, as soon as the router is there; None when `give_up` says so first. `identity`: with
    keys, whose.

    `told` gets the reason where it takes longer. `guests`: those of the design; what they say and
    are told stands in no step log, so it is heard, too.
    """
    tls = client_tls(options.keys, identity) if options.keys else None
    session = open_client(options.connect, give_up, tls=tls, told=told)
    return None if session is None else Tap(session, options.all_systems, on_sample, guests)


# --- Samples of a tap that wait for the one thread that takes them: bounded, so that a slow reader
# costs no memory


MOST_WAITING = 100_000
"""Samples that may wait; beyond that they are dropped and counted. Estimate: minutes of traffic."""
MOST_BYTES = 256 * 1024 * 1024
"""All of their data together; estimate: a hundred seconds of a pour have 25 MB."""


class Waiting:
    """Samples that wait; `dropped`: how many were too many; `stopped`: no more are wanted."""

    def __init__(self) -> None:
        self._queue = OneReaderQueue[Sample | None]()
        self._lock = threading.Lock()
        self._bytes = 0
        self.dropped = 0
        self.stopped = False

    def put(self, sample: Sample) -> None:
        """From Zenoh's threads; never blocks."""
        size = len(sample.data)
        with self._lock:
            if len(self._queue) >= MOST_WAITING or self._bytes + size > MOST_BYTES:
                self.dropped += 1
                return
            self._bytes += size
        self._queue.put(sample)

    def fill(self, lines: Iterable[bytes]) -> None:
        """From a thread of its own: put samples that another process wrote, a JSON object a line;
        then stop.
        """
        decoder = msgspec.json.Decoder(Sample)
        for line in lines:
            with suppress(msgspec.DecodeError):  # the last one may be cut off
                self.put(decoder.decode(line))
        self.stop()

    def stop(self, *_: object) -> None:
        """From a signal: takes no lock that the interrupted thread might hold."""
        self.stopped = True
        self._queue.put(None)

    def get(self, timeout_s: float) -> Sample | None:
        """The oldest sample; None: stop, or none came in time."""
        try:
            sample = self._queue.get(timeout_s)
        except Empty:
            return None
        if sample is not None:
            with self._lock:
                self._bytes -= len(sample.data)
        return sample

    def left(self) -> list[Sample]:
        """The waiting samples."""
        left = []
        while len(self._queue):
            sample = self.get(0.0)
            if sample is not None:
                left.append(sample)
        return left

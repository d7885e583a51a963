"""Listening to everything of one or more systems, for recorders: one session, a subscription each, no agent.

Takes part in nothing: it sends no receipt and declares no token, so nobody waits for it. Callbacks of Zenoh call
`on_sample`, which must only enqueue: while it works, every other sample waits.
"""

import time
from collections.abc import Callable

import msgspec
import zenoh

from agent_runtime.core.wiring import HOUSE, service_key
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import close, open_client

RECORDER = "monitor"
"""The identity that hears everything, where there are keys."""
LATEST_S = 60.0
"""Longest time from the router to here for which its stamp is believed; estimate: pauses of a minute are tried."""


class Sample(msgspec.Struct, frozen=True):
    """A sample on `key` at `at` [unix s]. `token`: a liveliness token, declared or (`gone`) withdrawn; no data then.

    `deaf_since`: nothing came by (no key), but from then on [unix s] the tap had no router, and heard nothing; with
    `missed`, a key, only not all that its sender said. `source`, `number`: who put it, and as its which one (gaps.py);
    0: it was not numbered. `log`: no tap heard it, the step log of this agent has it.
    """

    key: str
    data: bytes
    at: float
    token: bool = False
    gone: bool = False
    deaf_since: float = 0.0
    log: str = ""
    source: str = ""
    number: int = 0
    missed: str = ""

    @property
    def system(self) -> str:
        """The system it belongs to; "" if it concerns all of them."""
        key = self.key or self.missed
        return key.split("/")[1] if key else ""

    @property
    def sender(self) -> str:
        """The sender, or the name of what was not heard; "" if nobody is named."""
        return sender_of(self.key or self.missed)


def sender_of(key: str) -> str:
    """Return the sender that a key names, of a communicate or beside them; "" where it names none."""
    chunks = key.split("/")
    place = 4 if len(chunks) > 2 and chunks[2] == HOUSE else 3
    return chunks[place] if len(chunks) > place else ""


class Tap:
    """The open subscriptions."""

    def __init__(
        self,
        session: zenoh.Session,
        systems: tuple[str, ...],
        on_sample: Callable[[Sample], None],
        router: Callable[[bool, float], None] | None = None,
    ) -> None:
        """`router` gets each coming and going of the router, and when; else a sample tells of the time without one."""
        self._session, self._deaf_since, self._heard_at = session, 0.0, 0.0

        def heard(sample: zenoh.Sample) -> None:
            source, number = _numbered(sample)
            one = Sample(str(sample.key_expr), sample.payload.to_bytes(), _passed(sample), source=source, number=number)
            self._heard_at = one.at
            on_sample(one)

        def lived(sample: zenoh.Sample) -> None:
            gone = sample.kind == zenoh.SampleKind.DELETE
            on_sample(Sample(str(sample.key_expr), b"", time.time(), token=True, gone=gone))

        def linked(event: zenoh.TransportEvent) -> None:
            (router or told)(event.kind == zenoh.SampleKind.PUT, time.time())

        def told(up: bool, now: float) -> None:
            if not up:
                self._deaf_since = min(self._heard_at or now, now)
            elif self._deaf_since:
                on_sample(Sample("", b"", now, deaf_since=self._deaf_since))
                self._deaf_since = 0.0

        tokens = [service_key(system, "alive", "*", "*") for system in systems]
        # References are kept: a dropped declaration is undeclared.
        self._declared = (
            *(session.declare_subscriber(f"roco/{system}/**", heard) for system in systems),
            *(session.liveliness().declare_subscriber(key, lived, history=True) for key in tokens),
            session.info.declare_transport_events_listener(linked, history=True),
        )

    def close(self) -> None:
        """Hear no more."""
        close(self._session)


class Ear:
    """The open subscription to one key, of who has the right to no more."""

    def __init__(self, session: zenoh.Session, key: str, on_data: Callable[[bytes], None]) -> None:
        """`on_data` gets what is put, from Zenoh's threads."""
        self._session = session
        self._declared = session.declare_subscriber(key, lambda sample: on_data(sample.payload.to_bytes()))

    def close(self) -> None:
        """Hear no more."""
        close(self._session)


def open_ear(
    options: Options, key: str, on_data: Callable[[bytes], None], give_up: Callable[[], bool], identity: str
) -> Ear | None:
    """An ear, as soon as the router is there; None when `give_up` says so first. `identity`: with keys, whose."""
    tls = client_tls(options.keys, identity) if options.keys else None
    session = open_client(options.connect, give_up, tls=tls)
    return None if session is None else Ear(session, key, on_data)


def _numbered(sample: zenoh.Sample) -> tuple[str, int]:
    info = sample.source_info
    return ("", 0) if info is None else (str(info.source_id.zid), info.source_sn)


def _passed(sample: zenoh.Sample) -> float:
    """Return when it passed the router [unix s], whose clock stamps it, however late it is read here.

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
    router: Callable[[bool, float], None] | None = None,
) -> Tap | None:
    """A tap, as soon as the router is there; None when `give_up` says so first. `identity`: with keys, whose.

    `told` gets the reason where it takes longer; `router` as Tap has it.
    """
    tls = client_tls(options.keys, identity) if options.keys else None
    session = open_client(options.connect, give_up, tls=tls, told=told)
    return None if session is None else Tap(session, options.all_systems, on_sample, router)

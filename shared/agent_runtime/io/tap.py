"""Listening to everything of one or more systems, for recorders: one session, a subscription each, no agent.

Takes part in nothing: it sends no receipt and declares no token, so nobody waits for it. Callbacks of Zenoh call
`on_sample`, which must only enqueue: while it works, every other sample waits.
"""

import time
from collections.abc import Callable

import msgspec
import zenoh

from agent_runtime.core.wiring import service_key
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.zenoh_wire import open_client

RECORDER = "monitor"
"""The identity that hears everything, where there are keys."""


class Sample(msgspec.Struct, frozen=True):
    """A sample on `key` at `at` [unix s]. `token`: a liveliness token, declared or (`gone`) withdrawn; no data then.

    `deaf_since`: nothing came by (no key), but from then on [unix s] the tap had no router, and heard nothing.
    """

    key: str
    data: bytes
    at: float
    token: bool = False
    gone: bool = False
    deaf_since: float = 0.0

    @property
    def system(self) -> str:
        """Whose it is; "" where nothing came by."""
        return self.key.split("/")[1] if self.key else ""


class Tap:
    """The open subscriptions."""

    def __init__(self, session: zenoh.Session, systems: tuple[str, ...], on_sample: Callable[[Sample], None]) -> None:
        self._session = session

        def heard(sample: zenoh.Sample) -> None:
            on_sample(Sample(str(sample.key_expr), sample.payload.to_bytes(), time.time()))

        def lived(sample: zenoh.Sample) -> None:
            gone = sample.kind == zenoh.SampleKind.DELETE
            on_sample(Sample(str(sample.key_expr), b"", time.time(), token=True, gone=gone))

        def linked(event: zenoh.TransportEvent) -> None:
            now = time.time()
            if event.kind == zenoh.SampleKind.DELETE:
                self._deaf_since = now
            elif self._deaf_since:
                on_sample(Sample("", b"", now, deaf_since=self._deaf_since))
                self._deaf_since = 0.0

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
        self._session.close()  # type: ignore[no-untyped-call]


def open_tap(
    options: Options, on_sample: Callable[[Sample], None], give_up: Callable[[], bool], identity: str = RECORDER
) -> Tap | None:
    """A tap, as soon as the router is there; None when `give_up` says so first. `identity`: with keys, whose."""
    tls = client_tls(options.keys, identity) if options.keys else None
    session = open_client(options.connect, give_up, tls=tls)
    return None if session is None else Tap(session, options.all_systems, on_sample)

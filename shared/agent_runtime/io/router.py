"""Serving as the fleet's router: the body of services.router, here because only this package speaks Zenoh."""

import signal
import threading
import time
from pathlib import Path
from typing import Any

import zenoh

from agent_runtime.io.logs import Log
from agent_runtime.io.options import Options
from agent_runtime.io.pulse import PERIOD_S, Pulse
from agent_runtime.io.secured import ROUTER, KeysError, key_file, rights_of, router_tls
from agent_runtime.io.zenoh_wire import open_router

KEYS_S = 10.0
"""Keys take a tenth of a second to make; some seconds on a machine that is busy with much else (measured)."""


def serve(options: Options) -> int:
    """Listen until SIGTERM or SIGINT. 0: stopped in order; 1: the address or the keys cannot be had.

    With keys it grants the rights that are beside them, and Zenoh writes each session it refuses to standard error.
    Where the keys are renewed it listens again, with the new ones; its clients reconnect by themselves and read theirs.
    """
    run = options.run_dir
    run.mkdir(parents=True, exist_ok=True)
    log = Log("router", options.log_level, run / "logs" / "router.jsonl")
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    ready, pulse = run / "router.ready", Pulse(run, "router")
    try:
        while not ended.is_set():
            _listen(options, log, ready, pulse, ended)
    except (zenoh.ZError, KeysError) as error:
        log.write("cannot listen", level="error", at=options.listen, why=str(error))
        return 1
    finally:
        ready.unlink(missing_ok=True)
    log.write("stopped")
    log.close()
    return 0


def _listen(options: Options, log: Log, ready: Path, pulse: Pulse, ended: threading.Event) -> None:
    """Be the router until the end is asked for, or other keys are there. Raises zenoh.ZError, KeysError."""
    keys = _awaited(options, ended)
    if ended.is_set():
        return
    session = _opened(options)
    ready.write_text(options.listen)
    log.write("listening", at=options.listen, links=options.links)
    told = _tell_links(session, log)
    while not ended.wait(PERIOD_S) and _age(options) in (keys, None):
        pulse.beat()
    if not ended.is_set():
        log.write("the keys were renewed")
    told.undeclare()
    session.close()  # type: ignore[no-untyped-call]


def _awaited(options: Options, ended: threading.Event) -> int | None:
    """The age of the keys, which may be in the making."""
    until = time.monotonic() + KEYS_S
    while options.keys is not None and _age(options) is None and time.monotonic() < until and not ended.wait(0.01):
        pass
    return _age(options)


def _age(options: Options) -> int | None:
    """Return when the router's key, the last of all keys made together, was written. None: there is none (now)."""
    if options.keys is None:
        return None
    try:
        return key_file(options.keys, ROUTER).stat().st_mtime_ns
    except OSError:
        return None


def _opened(options: Options) -> zenoh.Session:
    if options.keys is None:
        return open_router(options.listen, links=options.links)
    zenoh.init_log_from_env_or("warn")
    rights = rights_of(options.keys, *options.all_systems)
    return open_router(
        options.listen, router_tls(options.keys, joins=bool(options.links)), rights.access_control, options.links
    )


def _tell_links(session: zenoh.Session, log: Log) -> Any:
    """Log each other router that is joined or lost, in either direction of the connection."""

    def linked(event: zenoh.TransportEvent) -> None:
        if event.transport.whatami == zenoh.WhatAmI.ROUTER:
            joined = event.kind == zenoh.SampleKind.PUT
            words = ("another router joined", "info") if joined else ("another router is lost", "warning")
            log.write(words[0], level=words[1], router=str(event.transport.zid))

    return session.info.declare_transport_events_listener(linked, history=True)

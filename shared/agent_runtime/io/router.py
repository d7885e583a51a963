"""Serving as the fleet's router: the body of services.router, here because only this package speaks
Zenoh.
"""

import signal
import time
from contextlib import suppress
from pathlib import Path

import zenoh

from agent_runtime.io.logs import Log
from agent_runtime.io.one_reader import OneReaderEvent
from agent_runtime.io.options import Options
from agent_runtime.io.process_heartbeat import PERIOD_S, ProcessHeartbeat
from agent_runtime.io.run_files import make_run
from agent_runtime.io.secured import ROUTER, KeysError, age, granted, revoked, rights_of, router_tls
from agent_runtime.io.sessions import close, open_router

KEYS_S = 10.0
"""Keys take a tenth of a second to make; some seconds on a machine that is busy with much else
(measured).
"""


def serve(options: Options) -> int:
    """Listen until SIGTERM or SIGINT. 0: stopped in order; 1: the address or the keys cannot be
    had.

    With keys it grants the rights that are beside them, and Zenoh writes each session it refuses to
    standard error. Where the keys are renewed, or one is revoked, it listens again; its clients
    reconnect and read theirs.
    """
    run = options.run_dir
    make_run(run)
    log = Log(ROUTER, options.log_level, run / "logs" / f"{ROUTER}.jsonl")
    ended = OneReaderEvent()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    ready, pulse = run / f"{ROUTER}.ready", ProcessHeartbeat(run, ROUTER)
    try:
        while not ended.is_set():
            _listen(options, log, ready, pulse, ended)
    except (zenoh.ZError, KeysError) as error:
        log.write("cannot listen", level="error", at=_at(options), why=str(error))
        return 1
    finally:
        ready.unlink(missing_ok=True)
    log.write("stopped")
    log.close()
    return 0


def _listen(
    options: Options, log: Log, ready: Path, pulse: ProcessHeartbeat, ended: OneReaderEvent
) -> None:
    """Be the router until the end is asked for, or other keys are there. Raises zenoh.ZError,
    KeysError.
    """
    keys = _awaited(options, pulse, ended)
    if ended.is_set():
        return
    session = _opened(options)
    ready.unlink(missing_ok=True)  # of an earlier life; its time of change counts
    _tell_ready(ready, options)
    denied = revoked(options.keys) if options.keys is not None else ()
    log.write("listening", at=_at(options), revoked=" ".join(denied))
    while not ended.wait(PERIOD_S) and _age(options) in (keys, None):
        pulse.beat()
        _tell_ready(ready, options)
    if not ended.is_set():
        log.write("the keys were renewed, or one was revoked")
    close(session)


def _tell_ready(ready: Path, options: Options) -> None:
    """Write the ready file where it is not there; on a full disk it waits for the next turn, and
    nothing else does.
    """
    if not ready.exists() or not ready.stat().st_size:
        with suppress(OSError):
            ready.write_text(_at(options))


def _awaited(
    options: Options, pulse: ProcessHeartbeat, ended: OneReaderEvent
) -> tuple[int, int] | None:
    """The age of the keys, which may be in the making."""
    until = time.monotonic() + KEYS_S
    while (
        options.keys is not None
        and _age(options) is None
        and time.monotonic() < until
        and not ended.wait(0.01)
    ):
        pulse.beat()
    return _age(options)


def _age(options: Options) -> tuple[int, int] | None:
    """The age of the router's keys, of those that are made together the last ones; None: there are
    none.
    """
    return None if options.keys is None else age(options.keys, ROUTER)


def _opened(options: Options) -> zenoh.Session:
    if options.keys is None:
        return open_router(_at(options))
    zenoh.init_log_from_env_or("warn")
    rights = rights_of(options.keys, *options.all_systems)
    rules = granted(rights.access_control, revoked(options.keys))
    return open_router(_at(options), router_tls(options.keys), rules)


def _at(options: Options) -> str:
    return options.listen or options.connect

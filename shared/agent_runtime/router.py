"""Serving as the fleet's router: the body of services.router, here because only this package speaks Zenoh."""

import signal
import threading

import zenoh

from agent_runtime.logs import Log
from agent_runtime.options import Options
from agent_runtime.secured import KeysError, rights_of, router_tls
from agent_runtime.zenoh_wire import open_router


def serve(options: Options) -> int:
    """Listen until SIGTERM or SIGINT. 0: stopped in order; 1: the address or the keys cannot be had.

    With keys it grants the rights that are beside them, and Zenoh writes each session it refuses to standard error.
    """
    run = options.run_dir
    run.mkdir(parents=True, exist_ok=True)
    log = Log("router", options.log_level, run / "logs" / "router.jsonl")
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    try:
        session = _opened(options)
    except (zenoh.ZError, KeysError) as error:
        log.write("cannot listen", level="error", at=options.listen, why=str(error))
        return 1
    ready = run / "router.ready"
    ready.write_text(options.listen)
    log.write("listening", at=options.listen)
    ended.wait()
    ready.unlink(missing_ok=True)
    session.close()  # type: ignore[no-untyped-call]
    log.write("stopped")
    log.close()
    return 0


def _opened(options: Options) -> zenoh.Session:
    if options.keys is None:
        return open_router(options.listen)
    zenoh.init_log_from_env_or("warn")
    rights = rights_of(options.keys, options.system)
    return open_router(options.listen, router_tls(options.keys), rights.access_control)

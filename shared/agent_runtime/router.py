"""Serving as the fleet's router: the body of services.router, here because only this package speaks Zenoh."""

import signal
import threading

import zenoh

from agent_runtime.logs import Log
from agent_runtime.options import Options
from agent_runtime.zenoh_wire import open_router


def serve(options: Options) -> int:
    """Listen until SIGTERM or SIGINT. 0: stopped in order; 1: the address cannot be had."""
    run = options.run_dir
    run.mkdir(parents=True, exist_ok=True)
    log = Log("router", options.log_level, run / "logs" / "router.jsonl")
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    try:
        session = open_router(options.listen)
    except zenoh.ZError as error:
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

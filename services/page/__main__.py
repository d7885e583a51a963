"""The person's page as a process: `python -m services.page --help`. Browsers reach it as docs/page.md says."""

import asyncio
import contextlib
import os
import secrets
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import msgspec

from agent_runtime.io import cli
from agent_runtime.io.heartbeat import ready_file
from agent_runtime.io.logs import Log
from agent_runtime.io.options import USAGE_ERROR, Options
from agent_runtime.io.pulse import Pulse
from agent_runtime.io.run_files import listen_at, make_run, write_secret
from companion.loopback import HERE
from companion.run_files import PAGE_FILE, HiEvent, PageAddress, Tasks

NAME = "page"
LOOK_S = 0.2
"""Between two looks at the stop flag, which `roco stop` sets, too."""
SENT_BYTES = 131_072
"""That may wait in the system for one browser: some pictures; what is older than that, nobody wants (estimate)."""
GRACE_S = 2
"""Longest for requests in hand at the end."""
PAIRED_FILE = "page.paired"


def serve(options: Options) -> int:
    """Run until a signal; return the exit code.

    ROCO_PAGE says where browsers reach it (default: loopback, a free port). ROCO_HI_DIR: the folder of hi.json, where
    that is not the run folder; ROCO_HI: the host of hi.
    """
    try:
        host, port = listen_at(os.environ.get("ROCO_PAGE", ""))
    except ValueError as error:
        print(f"ROCO_PAGE: {error}", file=sys.stderr)
        return USAGE_ERROR
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        print(f"page: {error}; pip install 'robot-companion[page]'", file=sys.stderr)
        return USAGE_ERROR
    make_run(options.run_dir)
    before = _before(options.run_dir)
    listener = _listener(host, port, before)
    address = PageAddress(listener.getsockname()[1], before.token if before else secrets.token_urlsafe(24))
    write_secret(options.run_dir / PAGE_FILE, msgspec.json.encode(address))
    with listener:
        asyncio.run(_serve(options, listener, address))
    return 0


def _before(run: Path) -> PageAddress | None:
    """The address of the process before this one: browsers that are open find the page there again."""
    try:
        return msgspec.json.decode((run / PAGE_FILE).read_bytes(), type=PageAddress)
    except (OSError, msgspec.DecodeError):
        return None


def _listener(host: str, port: int, before: PageAddress | None) -> socket.socket:
    """A bound socket, at the port of before where none is asked for and it is free. Raise OSError."""
    if before is not None and not port:
        with contextlib.suppress(OSError):
            return _bound(host, before.port)
    return _bound(host, port)


def _bound(host: str, port: int) -> socket.socket:
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        why = f"{host}:{port} cannot be listened at: {error.strerror}; ROCO_PAGE names another address"
        raise OSError(error.errno, why) from error
    return listener


async def _serve(options: Options, listener: socket.socket, address: PageAddress) -> None:
    import uvicorn

    from services.page.app import Page
    from services.page.following import Following
    from services.page.guard import Guard
    from services.page.hi_client import Hi
    from services.page.limits import settings
    from services.page.pairing import Pairs
    from services.page.robot_eye import RobotEye
    from services.page.robot_stop import RobotStop
    from services.page.robot_word import RobotWord

    class Server(uvicorn.Server):
        """A server whose signals are the loop's."""

        @contextlib.contextmanager
        def capture_signals(self) -> Iterator[None]:
            """Leave signals alone."""
            yield

    run = options.run_dir
    log = Log(NAME, options.log_level, run / "logs" / f"{NAME}.jsonl")
    hi = Hi(Path(os.environ.get("ROCO_HI_DIR") or run), os.environ.get("ROCO_HI") or HERE)
    stop, pairs, loop = RobotStop(run), Pairs(run / PAIRED_FILE), asyncio.get_running_loop()
    page = Page(hi, stop, RobotWord(options), pairs, address.port, address.token)

    def soon(call: Callable[[], None]) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(call)

    def told(tasks: Tasks | None, news: tuple[HiEvent, ...]) -> None:
        found = {"tasks": tasks.tasks, "wishes": tasks.wishes, "news": news} if tasks else {}
        soon(partial(page.hear, hi=tasks is not None, **found))

    following = Following(hi, told)
    eye = RobotEye(
        options, lambda *picture: soon(partial(page.see, *picture)), lambda mode: soon(partial(page.hear, mode=mode))
    )
    config = uvicorn.Config(
        Guard(page.app(), address.port, pairs), lifespan="off", log_config=None, access_log=False,
        timeout_graceful_shutdown=GRACE_S, server_header=False, **settings(),
    )  # fmt: skip
    server = Server(config)

    def end() -> None:
        page.streams.close()
        server.should_exit = True

    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, end)
    following.start()
    eye.start()
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    try:
        pulse, ready = Pulse(run, NAME), ready_file(run, NAME)
        ready.unlink(missing_ok=True)  # of the process before this one
        log.write("listening", at=f"http://127.0.0.1:{address.port}")
        while not serving.done():
            if server.started and not ready.exists():
                ready.touch()
            pulse.beat()
            held = stop.held if stop.here else page.heard.mode == "stopped"
            if held != page.heard.held:
                page.hear(held=held)
            await asyncio.wait((serving,), timeout=LOOK_S)
        await serving
    finally:
        following.close()
        eye.close()


if __name__ == "__main__":
    cli.run(NAME, "page: shows people what the robot does, and takes their words, in a browser.", serve)

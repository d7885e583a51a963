"""The person's page as a process: `python -m services.page --help`. Browsers reach it as
docs/page.md says.
"""

import asyncio
import contextlib
import os
import secrets
import signal
import socket
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from agent_runtime.io import cli
from agent_runtime.io.logs import Log
from agent_runtime.io.options import USAGE_ERROR, Options
from agent_runtime.io.run_files import (
    ProcessHeartbeat,
    listen_at,
    make_run,
    ready_file,
    write_secret,
)
from companion.loopback import HERE, Hi, HiError
from companion.loopback_server import RobotStop, Server, listener
from companion.run_files import HI_FILE, PAGE_FILE, HiEvent, PageAddress, Tasks
from services.page.app import Page
from services.page.guard import Guard, Pairs
from services.page.robot import RobotEye, RobotWord

WAIT_S = 10.0
"""hi holds the answer so long, until there is something to tell; what only a file tells is seen by
the page itself.
"""
AGAIN_S = 0.5
MOST_NEWS = 60


class Following:
    """Calls `told(tasks, news)` after each change, `told(None, ())` when hi has gone; from its own
    thread.
    """

    def __init__(self, hi: Hi, told: Callable[[Tasks | None, tuple[HiEvent, ...]], None]) -> None:
        self._hi, self._told = hi, told
        self._over = threading.Event()
        self._news: tuple[HiEvent, ...] = ()
        self._thread = threading.Thread(target=self._serve, name="following", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End soon: a wait for hi is not cut short, and holds no process."""
        self._over.set()

    def _serve(self) -> None:
        since, wait_s = 0, 0.0
        while not self._over.is_set():
            try:
                events = self._hi.events(since, wait_s)
                self._news = (*self._news, *events.events)[-MOST_NEWS:]
                self._told(self._hi.told(), self._news)
                since, wait_s = events.next, WAIT_S
            except HiError:
                self._told(None, self._news)
                self._over.wait(AGAIN_S)
                wait_s = 0.0  # to tell at once that it is back


NAME = "page"
LOOK_S = 0.2
"""Between two looks at the stop flag, which `roco stop` sets, too."""
PATIENCE_S = 6.0
"""Longest wait for hi, which answers within 5 s, be it that it is busy; a person has a browser
before them.
"""
PAIRED_FILE = "page.paired"


def serve(options: Options) -> int:
    """Run until a signal; return the exit code.

    ROCO_PAGE says where browsers reach it (default: loopback, a free port). ROCO_HI_DIR: the folder
    of hi.json, where that is not the run folder; ROCO_HI: the host of hi.
    """
    try:
        host, port = listen_at(os.environ.get("ROCO_PAGE", ""))
    except ValueError as error:
        print(f"ROCO_PAGE: {error}", file=sys.stderr)
        return USAGE_ERROR
    make_run(options.run_dir)
    before = _before(options.run_dir)
    listening = _listening(host, port, before)
    address = PageAddress(
        listening.getsockname()[1], before.token if before else secrets.token_urlsafe(24)
    )
    write_secret(options.run_dir / PAGE_FILE, msgspec.json.encode(address))
    with listening:
        asyncio.run(_serve(options, listening, address))
    return 0


def _before(run: Path) -> PageAddress | None:
    """The address of the process before this one: browsers that are open find the page there
    again.
    """
    try:
        return msgspec.json.decode((run / PAGE_FILE).read_bytes(), type=PageAddress)
    except (OSError, msgspec.DecodeError):
        return None


def _listening(host: str, port: int, before: PageAddress | None) -> socket.socket:
    """A socket, at the port of before where none is asked for and it is free. Raise OSError."""
    if before is not None and not port:
        with contextlib.suppress(OSError):
            return listener(host, before.port, "ROCO_PAGE")
    return listener(host, port, "ROCO_PAGE")


async def _serve(options: Options, listening: socket.socket, address: PageAddress) -> None:
    run = options.run_dir
    log = Log(NAME, options.log_level, run / "logs" / f"{NAME}.jsonl")
    file = Path(os.environ.get("ROCO_HI_DIR") or run) / HI_FILE
    hi = Hi(file, os.environ.get("ROCO_HI") or HERE, PATIENCE_S)
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
        options,
        lambda *picture: soon(partial(page.see, *picture)),
        lambda mode: soon(partial(page.hear, mode=mode)),
    )
    server = Server(Guard(page.app(), address.port, pairs))

    def end() -> None:
        page.streams.close()
        server.should_exit = True

    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, end)
    following.start()
    eye.start()
    serving = asyncio.create_task(server.serve(sockets=[listening]))
    try:
        pulse, ready = ProcessHeartbeat(run, NAME), ready_file(run, NAME)
        ready.unlink(missing_ok=True)  # of the process before this one
        log.write("listening", at=f"http://127.0.0.1:{address.port}")
        while not serving.done():
            if server.started and not ready.exists():
                ready.touch()
            pulse.beat()
            eye.watch(page.watched())
            held = stop.held if stop.here else page.heard.mode == "stopped"
            if held != page.heard.held:
                page.hear(held=held)
            await asyncio.wait((serving,), timeout=LOOK_S)
        await serving
    finally:
        following.close()
        eye.close()


if __name__ == "__main__":
    cli.run(
        NAME, "page: shows people what the robot does, and takes their words, in a browser.", serve
    )

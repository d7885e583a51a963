"""The person's page as a process: `python -m services.page --help`. Browsers reach it as
docs/page.md says.
"""

import asyncio
import contextlib
import ipaddress
import os
import secrets
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec

from agent_runtime.io import cli
from agent_runtime.io.logs import Log
from agent_runtime.io.options import USAGE_ERROR, Options
from agent_runtime.io.run_files import (
    LOOPBACK,
    ProcessHeartbeat,
    listen_at,
    make_run,
    ready_file,
    write_secret,
)
from companion.loopback import HERE, Hi, HiError
from companion.loopback_server import RobotStop, Server, listener
from companion.run_files import HI_FILE, PAGE_FILE, PAGE_KEYS, HiEvent, PageAddress, Tasks
from services.page.app import Page
from services.page.guard import Guard, Pairs
from services.page.robot import RobotEye, RobotWord

if TYPE_CHECKING:
    from services.page.certificate import Certificate

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


class Tablet(NamedTuple):
    """Where the page listens for tablets: host:port `at`, as a request must name it."""

    listening: socket.socket
    at: str
    certificate: "Certificate"


def serve(options: Options) -> int:
    """Run until a signal; return the exit code.

    ROCO_PAGE says where browsers reach it (default: loopback, a free port). ROCO_HI_DIR: the folder
    of hi.json, where that is not the run folder; ROCO_HI: the host of hi.
    """
    try:
        host, port = listen_at(os.environ.get("ROCO_PAGE", ""))
        outside = for_tablets(host, published="ROCO_HI" in os.environ)
    except ValueError as error:
        print(f"ROCO_PAGE: {error}", file=sys.stderr)
        return USAGE_ERROR
    make_run(options.run_dir)
    before = _before(options.run_dir)
    with contextlib.ExitStack() as open_ones:
        here = LOOPBACK if outside else (host, port)
        listening = open_ones.enter_context(_listening(*here, before))
        tablet = None
        if outside:
            # it needs a library of 10 MB, which nothing else here does
            from services.page.certificate import Certificate

            reached = open_ones.enter_context(listener(host, port, "ROCO_PAGE"))
            at = f"{host.lower()}:{reached.getsockname()[1]}"
            tablet = Tablet(reached, at, Certificate(options.run_dir / PAGE_KEYS, host.lower()))
        address = PageAddress(
            listening.getsockname()[1],
            before.token if before else secrets.token_urlsafe(24),
            tablet.at if tablet else "",
        )
        write_secret(options.run_dir / PAGE_FILE, msgspec.json.encode(address))
        asyncio.run(_serve(options, listening, tablet, address))
    return 0


def for_tablets(host: str, *, published: bool) -> bool:
    """Whether a host is of the network, where the page is served with TLS alone; else it is of this
    machine. `published`: of a container whose ports are published on loopback. Raise ValueError.
    """
    try:
        found = ipaddress.IPv4Address(socket.gethostbyname(host))
    except OSError as error:
        raise ValueError(f"{host!r} has no IPv4 address here: {error.strerror}") from error
    if found.is_unspecified and not published:
        raise ValueError(
            f"{host} is every address of this machine; name the one that the tablet reaches, such"
            " as 192.168.1.20:8351 (`ip -brief address` lists them): the page has TLS there"
        )
    if found.is_loopback and host not in ("localhost", str(found)):
        raise ValueError(
            f"{host!r} is {found} here, which no tablet reaches; name the machine's address in the"
            " network, such as 192.168.1.20:8351"
        )
    return not (found.is_loopback or found.is_unspecified)


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


async def _serve(
    options: Options, listening: socket.socket, tablet: Tablet | None, address: PageAddress
) -> None:
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
        found = (
            {"tasks": tasks.tasks, "wishes": tasks.wishes, "hands": tasks.hands, "news": news}
            if tasks
            else {}
        )
        soon(partial(page.hear, hi=tasks is not None, **found))

    following = Following(hi, told)
    eye = RobotEye(
        options,
        lambda *picture: soon(partial(page.see, *picture)),
        lambda mode: soon(partial(page.hear, mode=mode)),
    )
    app = page.app()
    servers = [(Server(Guard(app, address.port, pairs)), listening)]
    if tablet is not None:
        guard = Guard(app, address.port, pairs, tablet.at)
        servers.append((Server(guard, tablet.certificate.context), tablet.listening))

    def end() -> None:
        page.streams.close()
        for server, _ in servers:
            server.should_exit = True

    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, end)
    following.start()
    eye.start()
    serving = [asyncio.create_task(server.serve(sockets=[one])) for server, one in servers]
    try:
        pulse, ready = ProcessHeartbeat(run, NAME), ready_file(run, NAME)
        ready.unlink(missing_ok=True)  # of the process before this one
        log.write("listening", at=f"http://127.0.0.1:{address.port}", tablet=address.tablet)
        while not any(one.done() for one in serving):
            if all(server.started for server, _ in servers) and not ready.exists():
                ready.touch()
            pulse.beat()
            eye.watch(page.watched())
            held = stop.held if stop.here else page.heard.mode == "stopped"
            if held != page.heard.held:
                page.hear(held=held)
            if tablet is not None:
                with contextlib.suppress(OSError):  # such as a full disk; it is tried again
                    tablet.certificate.renew(time.time())
            await asyncio.wait(serving, timeout=LOOK_S, return_when=asyncio.FIRST_COMPLETED)
        end()
        await asyncio.gather(*serving)
    finally:
        following.close()
        eye.close()


if __name__ == "__main__":
    cli.run(
        NAME, "page: shows people what the robot does, and takes their words, in a browser.", serve
    )

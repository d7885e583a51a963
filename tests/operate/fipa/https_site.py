"""A server of ours in a thread, and folders of certificates as `roco fipa --tls` takes them."""

import asyncio
import contextlib
import datetime as dt
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

from agent_runtime.io.issuing import Issuer, authority, certify, publish
from operate.guests.fipa_http import HttpServer, Reply, Tls

TAKEN = Reply(200)


class Site:
    """A server in a thread of its own; `taken`: what was posted."""

    def __init__(self, tls: Tls | None = None, reply: Reply = TAKEN) -> None:
        self.taken: list[tuple[str, bytes]] = []
        self.reply = reply
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._listening.setblocking(False)
        self.port = self._listening.getsockname()[1]
        self.url = f"{'https' if tls else 'http'}://localhost:{self.port}/acc"
        self._loop, self._ended = asyncio.new_event_loop(), asyncio.Event()
        self._thread = threading.Thread(
            target=lambda: self._loop.run_until_complete(self._serve(tls))
        )
        self._thread.start()

    async def _serve(self, tls: Tls | None) -> None:
        server = HttpServer(self._take, tls)
        await server.start(self._listening)
        await self._ended.wait()
        await server.close()

    async def _take(self, what: str, body: bytes) -> Reply:
        self.taken.append((what, body))
        return self.reply

    def close(self) -> None:
        """End it."""
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()
        self._loop.close()


@contextlib.contextmanager
def site(tls: Tls | None = None, reply: Reply = TAKEN) -> Iterator[Site]:
    """One that ends."""
    made = Site(tls, reply)
    try:
        yield made
    finally:
        made.close()


def keys(folder: Path, issuer: Issuer | None = None) -> Issuer:
    """A folder as --tls names one; the issuer."""
    begin = dt.datetime.now(dt.UTC)
    end = begin + dt.timedelta(days=1)
    issuer = issuer or authority("lab", begin, end)
    publish(folder, issuer, None)
    certify(folder, issuer, "certificate", begin, end, ("localhost",), joins=True)
    (folder / "certificate.key").rename(folder / "key.pem")
    return issuer

"""HTTP as FIPA's platforms speak it (SC00084): takes what is posted to any path, and posts.

Plain HTTP is for loopback alone, both ways; everywhere else both sides show a certificate of one
authority. Each request has a connection of its own, a bounded size and a bounded time. Must not
know: what is posted.
"""

import asyncio
import ipaddress
import socket
import ssl
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from urllib.parse import SplitResult, urlsplit

import h11

MAX_BODY = 131_072
"""Bytes of a request; estimate: messages of JADE have 2 kB, the longest command of a guest 10."""
MAX_HEAD = 16_384
"""Bytes of its head (h11's default)."""
REQUEST_S = 10.0
"""A request is whole within this time, and an answer to ours; estimate: on loopback it takes
milliseconds.
"""
CLOSE_S = 1.0
"""Time to end a connection, or what is under way at the end (estimate: it takes milliseconds)."""
LOOKUP_S = 2.0
"""Longest time to look up a host (estimate)."""
MOST_CONNECTIONS = 64
"""Beyond them the oldest one ends (estimate: one for each conversation of a busy peer)."""


class Reply(NamedTuple):
    """What a request is answered: status, and the reason where it is not 200."""

    status: int
    text: str = ""


Receive = Callable[[str, bytes], Awaitable[Reply]]
"""What is done with content type and body of a request."""


class AddressError(OSError):
    """An address to which nothing is posted, and which would be right."""


class Tls(NamedTuple):
    """How this side shows its certificate, and asks for the other's."""

    server: ssl.SSLContext
    client: ssl.SSLContext


def mutual(folder: Path) -> Tls:
    """From certificate.pem, key.pem and authority.pem of a folder. Raise OSError, ssl.SSLError."""
    authority = folder / "authority.pem"
    made = Tls(
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=authority),
        ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=authority),
    )
    made.server.verify_mode = ssl.CERT_REQUIRED
    for context in made:
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.load_cert_chain(folder / "certificate.pem", folder / "key.pem")
    return made


def is_loopback(host: str) -> bool:
    """Whether a host is this machine, by all of its addresses. Raise OSError: it has none."""
    found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    return all(ipaddress.ip_address(one[4][0]).is_loopback for one in found)


async def _close(writer: asyncio.StreamWriter) -> None:
    """End a connection; where the peer does not follow, it is cut."""
    writer.close()
    try:
        async with asyncio.timeout(CLOSE_S):
            await writer.wait_closed()
    except (TimeoutError, asyncio.CancelledError):
        writer.transport.abort()
    except OSError:  # the peer ended it first
        pass


# --- in -------------------------------------------------------------------------------------------


class HttpServer:
    """Listens on a socket until `close`."""

    def __init__(self, take: Receive, tls: Tls | None = None) -> None:
        self._take, self._tls = take, tls
        self._server: asyncio.Server | None = None
        self._open: dict[asyncio.Task[None], None] = {}

    async def start(self, listening: socket.socket) -> None:
        """Take requests from now on."""
        tls = self._tls.server if self._tls else None
        handshake = REQUEST_S if tls else None
        self._server = await asyncio.start_server(
            self._connected, sock=listening, ssl=tls, ssl_handshake_timeout=handshake
        )

    async def close(self) -> None:
        """Listen no more; requests that are under way have a moment to end."""
        if self._server is not None:
            self._server.close()
        if self._open:
            await asyncio.wait(self._open, timeout=CLOSE_S)
        for task in tuple(self._open):
            task.cancel()
        await asyncio.gather(*self._open, return_exceptions=True)

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        if len(self._open) >= MOST_CONNECTIONS:
            oldest = next(iter(self._open))
            del self._open[oldest]
            oldest.cancel()
        self._open[task] = None
        try:
            with suppress(OSError, h11.ProtocolError, asyncio.CancelledError):
                await self._serve(reader, writer)
        finally:
            await _close(writer)
            self._open.pop(task, None)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        http = h11.Connection(h11.SERVER, max_incomplete_event_size=MAX_HEAD)
        try:
            async with asyncio.timeout(REQUEST_S):
                posted = await self._posted(http, reader, writer)
            reply = posted if isinstance(posted, Reply) else await self._take(*posted)
        except TimeoutError:
            reply = Reply(408, f"the request is not whole within {REQUEST_S:g} s")
        except h11.RemoteProtocolError as error:
            reply = Reply(error.error_status_hint, str(error))
        if http.our_state not in (h11.IDLE, h11.SEND_RESPONSE):
            return
        text = f"{reply.text}\n".encode("ascii", "replace") if reply.text else b""
        headers = [
            ("Content-Type", "text/plain"),
            ("Content-Length", str(len(text))),
            ("Connection", "close"),
        ]
        for event in (
            h11.Response(status_code=reply.status, headers=headers),
            h11.Data(data=text),
            h11.EndOfMessage(),
        ):
            writer.write(http.send(event) or b"")
        async with asyncio.timeout(REQUEST_S):
            await writer.drain()

    async def _posted(
        self, http: h11.Connection, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> Reply | tuple[str, bytes]:
        """Content type and body, or why they are not taken."""
        what, body = "", bytearray()
        while True:
            event = http.next_event()
            if event is h11.NEED_DATA:
                if http.they_are_waiting_for_100_continue:
                    go_on = h11.InformationalResponse(status_code=100, headers=[])
                    writer.write(http.send(go_on) or b"")
                http.receive_data(await reader.read(65_536))
            elif isinstance(event, h11.Request):
                head = {name: value.decode("latin-1") for name, value in event.headers}
                if event.method != b"POST":
                    return Reply(405, "messages are posted (SC00084)")
                if b"origin" in head:  # each browser sends it with a post, and no platform does
                    return Reply(403, "no page of a browser may post here")
                if int(head.get(b"content-length", "0")) > MAX_BODY:
                    return Reply(413, f"a message has at most {MAX_BODY} bytes")
                what = head.get(b"content-type", "")
            elif isinstance(event, h11.Data):
                body += event.data
                if len(body) > MAX_BODY:
                    return Reply(413, f"a message has at most {MAX_BODY} bytes")
            elif isinstance(event, h11.EndOfMessage):
                return what, bytes(body)
            else:
                raise ConnectionError("the peer left")


# --- out ------------------------------------------------------------------------------------------


class _Place(NamedTuple):
    """An address, looked up: `ip` is dialled, `host` is in the certificate."""

    ip: str
    host: str
    port: int
    path: str


class Poster:
    """Posts to other platforms. Follows no redirect."""

    def __init__(self, tls: Tls | None = None) -> None:
        self._tls = tls
        # names come from strangers, and a lookup may hang: of threads of their own
        self._lookups = ThreadPoolExecutor(4, "lookup")

    async def usable(self, addresses: Sequence[str]) -> tuple[str, ...]:
        """Those to which something may be posted. Raise AddressError where none is one."""
        found: list[str] = []
        whys: list[str] = []
        for address in addresses[:4]:
            try:
                await self._looked_up(address)
                found.append(address)
            except OSError as error:
                whys.append(str(error))
        if not found:
            raise AddressError("; ".join(whys) or "the sender has no address to answer to")
        return tuple(found)

    async def post(self, addresses: Sequence[str], what: str, body: bytes) -> None:
        """Post to the first address that takes it. Raise OSError where none does."""
        whys: list[str] = []
        for address in addresses:
            try:
                async with asyncio.timeout(REQUEST_S):
                    await self._post(await self._looked_up(address), what, body)
                return
            except AddressError as error:
                whys.append(str(error))
            except (OSError, h11.ProtocolError) as error:
                whys.append(f"{address}: {error or 'no answer in time'}")
        raise OSError("; ".join(whys))

    def close(self) -> None:
        """Look up nothing more."""
        self._lookups.shutdown(wait=False, cancel_futures=True)

    async def _looked_up(self, address: str) -> _Place:
        place, host, port = self._read(address)
        try:
            async with asyncio.timeout(LOOKUP_S):
                found = await asyncio.get_running_loop().run_in_executor(
                    self._lookups,
                    lambda: socket.getaddrinfo(host, port, type=socket.SOCK_STREAM),
                )
        except (OSError, UnicodeError) as error:
            raise AddressError(f"{address}: {host} is not found") from error
        ips = [str(one[4][0]) for one in found]
        if self._tls is None and not all(ipaddress.ip_address(ip).is_loopback for ip in ips):
            raise AddressError(
                f"{address} is not on this machine ({', '.join(ips)}); without certificates only"
                " loopback is posted to: give the platform an address there (JADE:"
                " -local-host 127.0.0.1), or use --tls"
            )
        return _Place(
            ips[0], host, port, (place.path or "/") + (f"?{q}" if (q := place.query) else "")
        )

    def _read(self, address: str) -> tuple[SplitResult, str, int]:
        wanted = "https" if self._tls else "http"
        try:
            place = urlsplit(address)
            host, port = place.hostname, place.port or (443 if self._tls else 80)
        except ValueError as error:
            raise AddressError(f"{address} is no address: {error}") from error
        if place.scheme != wanted or not host or not address.isascii():
            raise AddressError(
                f"{address} is none of {wanted}://HOST:PORT/PATH, which is posted to"
            )
        return place, host, port

    async def _post(self, to: _Place, what: str, body: bytes) -> None:
        tls = self._tls.client if self._tls else None
        name = to.host if tls else None
        reader, writer = await asyncio.open_connection(
            to.ip, to.port, ssl=tls, server_hostname=name
        )
        try:
            http = h11.Connection(h11.CLIENT, max_incomplete_event_size=MAX_HEAD)
            host = f"[{to.host}]" if ":" in to.host else to.host
            headers = [
                ("Host", f"{host}:{to.port}"),
                ("Content-Type", what),
                ("Content-Length", str(len(body))),
                ("Cache-Control", "no-cache"),
                ("Mime-Version", "1.0"),
                # JADE's answer has no Content-Length
                ("Connection", "close"),
            ]
            request = h11.Request(method="POST", target=to.path, headers=headers)
            for part in (request, h11.Data(data=body), h11.EndOfMessage()):
                writer.write(http.send(part) or b"")
            await writer.drain()
            while True:
                event = http.next_event()
                if event is h11.NEED_DATA:
                    http.receive_data(await reader.read(MAX_HEAD))
                elif isinstance(event, h11.Response):
                    break
                elif isinstance(event, h11.ConnectionClosed):
                    raise ConnectionError("closed without an answer")
            if not 200 <= event.status_code < 300:
                raise ConnectionError(f"answered {event.status_code}")
        finally:
            await _close(writer)

"""The HTTP server of what people use on this machine, hi and the page, and over TLS from a tablet:
who may connect, how long and how much.

h11 bounds a head only while it is not whole: one that comes in one piece may be as long as the
piece. uvicorn waits for ever for a head that does not end, and for a client that does not read;
asyncio gives a TLS handshake 60 s, and takes as many at once as come. All of this is ended here.
The figures are estimates for programs and browsers of this machine, which take milliseconds. Must
not know: what is asked.
"""

import asyncio
import contextlib
import hmac
import re
import socket
import ssl
from collections.abc import Iterator
from pathlib import Path

import h11
import msgspec
import uvicorn
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from agent_runtime.io.fleet_processes import set_stop
from agent_runtime.io.run_files import STOP_FILE, STOP_HELD
from companion.run_files import SLOTS_FILE, Problem

# --- Bounds on connections: no head and no reader keeps a place for long --------------------------

LOOK_S = 3.0
"""Between two looks at a connection without a request; the second one that finds it so ends it."""
READS_S = 5.0
"""Longest that what was written may lie unread."""
MOST = 128
"""Connections; beyond that the oldest without a request goes. 24 streams and a few requests of each
browser.
"""
HEAD_BYTES = 8192
"""Of a request before its body, up to the blank line; a browser's has 1000, that of `roco` 200."""
SENT_BYTES = 131_072
"""That may wait in the system for one browser: some pictures; what is older than that, nobody wants
(estimate).
"""
GRACE_S = 2
"""Longest for requests in hand at the end."""
HANDSHAKE_S = 6.0
"""Longest for a TLS handshake, and for the farewell at its end: as for a head."""
HANDSHAKES = 64
"""Under way at once; beyond that the oldest goes (estimate: a tablet begins six)."""
TAKEN_EACH_S = 0.02
"""Between two connections that are taken over TLS. A handshake takes 2.8 ms of processor, which the
robot's loop shares: so a flood of them takes 13 % of a core (measured 2026-11-30, load 7 to 9).
"""
REST_S = 0.5
"""After a connection that could not be taken, such as for want of file descriptors."""
BUFFER_BYTES = 65_536
"""Written, and not yet with the system: as asyncio bounds a connection without TLS. With TLS it
would be 512 KiB.
"""
_END = re.compile(rb"\n\r?\n")


class BoundedProtocol(H11Protocol):
    """HTTP/1.1 with these bounds."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection; where there are too many, the oldest without a request goes."""
        super().connection_made(transport)
        transport.set_write_buffer_limits(BUFFER_BYTES)
        self._idle = 0
        self._unread: asyncio.TimerHandle | None = None
        self._since = self.loop.time()
        self._look: asyncio.TimerHandle | None = self.loop.call_later(LOOK_S, self._looked)
        if len(self.connections) <= MOST:
            return
        # Those that are ended leave `connections` later: of many that come at once each must end
        # another one.
        ours = (one for one in self.connections if isinstance(one, BoundedProtocol))
        there = [one for one in ours if not one.transport.is_closing()]
        idle = [one for one in there if one.idle] if len(there) > MOST else []
        if idle:
            min(idle, key=lambda one: one._since).transport.abort()

    def handle_events(self) -> None:
        """Serve what has come; a head that is too long is refused, also one behind another
        request.
        """
        waiting, _ = self.conn.trailing_data
        end = _END.search(waiting)
        if self.conn.their_state is h11.IDLE and (end.end() if end else len(waiting)) > HEAD_BYTES:
            self.send_400_response(f"the head of a request has at most {HEAD_BYTES} bytes")
        else:
            super().handle_events()

    def send_400_response(self, msg: str) -> None:
        """Refuse what is not HTTP as all else is refused."""
        super().send_400_response(msgspec.json.encode(Problem(msg)).decode())

    def _should_upgrade(self) -> bool:
        """To nothing: whoever asks for it gets the answer of a usual request, and no warning in the
        log.
        """
        return False

    @property
    def idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or bool(self.cycle.response_complete)

    def _looked(self) -> None:
        self._idle = self._idle + 1 if self.idle else 0
        if self._idle >= 2:
            self.transport.abort()
        else:
            self._look = self.loop.call_later(LOOK_S, self._looked)

    def pause_writing(self) -> None:
        """Begin to count: what is not read in time ends the connection."""
        super().pause_writing()
        self._unread = self.loop.call_later(READS_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: it was read."""
        super().resume_writing()
        self._read()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        super().connection_lost(exc)
        self._read()
        if self._look is not None:
            self._look.cancel()

    def _read(self) -> None:
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None


class Server(uvicorn.Server):
    """A server of `app` within these bounds, over TLS where there is a context for it; its signals
    are the caller's.
    """

    def __init__(self, app: ASGIApp, tls: ssl.SSLContext | None = None) -> None:
        super().__init__(
            uvicorn.Config(
                app, http=BoundedProtocol, ws="none", lifespan="off", server_header=False,
                access_log=False,
                # whoever connects can send what is worth a warning
                log_config=None, log_level="error",
                h11_max_incomplete_event_size=HEAD_BYTES, timeout_keep_alive=5,
                timeout_graceful_shutdown=GRACE_S,
            )
        )  # fmt: skip
        self._tls = tls
        self._taking: list[asyncio.Task[None]] = []
        self._handshakes: dict[asyncio.Task[None], None] = {}  # oldest first

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen at these sockets."""
        if self._tls is None:
            return await super().startup(sockets)
        await super().startup([])
        for one in sockets or ():
            one.setblocking(False)
            taking = asyncio.create_task(self._take(one, self._tls))
            taking.add_done_callback(self._end)
            self._taking.append(taking)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more connections, and end those that are there."""
        over = (*self._taking, *self._handshakes)
        for task in over:
            task.cancel()
        await asyncio.gather(*over, return_exceptions=True)
        await super().shutdown(sockets)

    async def _take(self, listening: socket.socket, tls: ssl.SSLContext) -> None:
        """Take connections. A client without an end of its handshake has no place among those that
        ask.
        """
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, _ = await loop.sock_accept(listening)
            except OSError:
                await asyncio.sleep(REST_S)
                continue
            begun = loop.create_task(self._shake_hands(connection, tls))
            self._handshakes[begun] = None
            begun.add_done_callback(lambda task: self._handshakes.pop(task, None))
            if len(self._handshakes) > HANDSHAKES:
                next(iter(self._handshakes)).cancel()
            await asyncio.sleep(TAKEN_EACH_S)

    async def _shake_hands(self, connection: socket.socket, tls: ssl.SSLContext) -> None:
        def protocol() -> BoundedProtocol:
            return BoundedProtocol(self.config, self.server_state, self.lifespan.state)

        with contextlib.suppress(OSError):  # no TLS, too late, or gone
            await asyncio.get_running_loop().connect_accepted_socket(
                protocol,
                connection,
                ssl=tls,
                ssl_handshake_timeout=HANDSHAKE_S,
                ssl_shutdown_timeout=HANDSHAKE_S,
            )

    def _end(self, _: asyncio.Task[None]) -> None:
        """End the server: it takes no connections any more."""
        self.should_exit = True

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals alone."""
        yield


def listener(host: str, port: int, variable: str) -> socket.socket:
    """Return a socket that listens there, port 0 for a free one; `variable` names the address.
    Raise OSError.
    """
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
    try:
        made.bind((host, port))
        made.listen(MOST)
    except OSError as error:
        made.close()
        taken = f"{host}:{port} cannot be listened at: {error.strerror}"
        why = f"{taken}; {variable} names another address"
        raise OSError(error.errno, why) from error
    return made


# --- Requests: who may ask, and how much ----------------------------------------------------------

LONGEST_BODY = 4096
DRAINED = 65536
"""Bytes of a body that is too long that are read and dropped, so that its sender reads the answer
(estimate).
"""
BODY_S = 5.0


class Refused(Exception):
    """A request that is answered by a status and a sentence. `whole`: it was read; else its
    connection ends.
    """

    def __init__(self, status: int, text: str, *, whole: bool = True) -> None:
        self.status, self.headers = status, {} if whole else {"connection": "close"}
        super().__init__(text)


def loopback_hosts(port: int) -> tuple[str, ...]:
    """What a request to this port of this machine's loopback says as Host."""
    return f"127.0.0.1:{port}", f"localhost:{port}"


def check_host(headers: Headers, hosts: tuple[str, ...]) -> None:
    """Raise Refused for a request that was sent to another name: no page of elsewhere gets here by
    one that it made.
    """
    if len(sent := headers.getlist("host")) != 1 or sent[0] not in hosts:
        raise Refused(403, f"Host must be {' or '.join(hosts)}")


def has_token(headers: Headers, token: str) -> bool:
    """Whether a request shows the token of the address file."""
    return hmac.compare_digest(
        headers.get("authorization", "").encode(), f"Bearer {token}".encode()
    )


async def whole_body(request: Request) -> bytes:
    """The body of a request. Raise Refused for one that is too long, or not whole in time."""
    data, length = b"", 0
    try:
        async with asyncio.timeout(BODY_S):
            async for chunk in request.stream():
                length += len(chunk)
                data += chunk if length <= LONGEST_BODY else b""
                if length > DRAINED:
                    break
    except TimeoutError:
        raise Refused(408, f"a body must be whole within {BODY_S:g} s", whole=False) from None
    except ClientDisconnect:
        raise Refused(400, "the connection ended before the body", whole=False) from None
    if length > LONGEST_BODY:
        raise Refused(413, f"a body has at most {LONGEST_BODY} bytes", whole=False)
    return data


# --- The stop flag: a byte in the run folder (docs/run-folder.md), which the robot's loop reads ---


class RobotStop:
    """The stop flag of the robot whose control loop shares this run folder, if one does: no agent
    or key is needed.

    In containers and across hosts the loop has another run folder, and its flag is out of reach.
    """

    def __init__(self, run: Path) -> None:
        self._run = run

    def hold(self, held: bool) -> bool:
        """Stop the robot, or let it go. Return whether its loop reads the flag; raise OSError if it
        cannot be written.

        Where a supervisor made a flag it is written even if there is no loop yet, which then begins
        with it.
        """
        if (self._run / STOP_FILE).exists() or self.here:
            set_stop(self._run, held)
        return self.here

    @property
    def here(self) -> bool:
        """Whether the robot's loop has had this run folder's flag mapped."""
        return (self._run / SLOTS_FILE).exists()

    @property
    def held(self) -> bool:
        """Whether the flag is set."""
        try:
            return (self._run / STOP_FILE).read_bytes()[:1] == STOP_HELD
        except OSError:
            return False

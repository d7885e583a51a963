"""hi's HTTP service over a real socket: any bytes get an answer in HTTP and JSON, or the end of the
connection.
"""

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from companion import loopback_server
from companion.run_files import TaskLine
from services.human_interface import server
from services.human_interface.device_messages import Answer

HOST, TOKEN = b"127.0.0.1:8350", b"TOKEN"
"""Placeholders in an input for the address and the token of the running service."""
WITHIN_S = 8.0
"""Longer than any wait of the service but for an answer of an agent, which comes at once here."""
LINE = TaskLine("hi-1-3", "waiting", "I will look around.", "look around", 1.0)


def _request(line: bytes, body: bytes = b"", more: bytes = b"") -> bytes:
    head = (
        line
        + b" HTTP/1.1\r\nHost: "
        + HOST
        + b"\r\nAuthorization: Bearer "
        + TOKEN
        + b"\r\n"
        + more
    )
    return head + (b"Content-Length: %d\r\n" % len(body) if body else b"") + b"\r\n" + body


REQUESTS = (
    _request(b"POST /say", b'{"text": "look around"}'),
    _request(b"POST /cancel", b'{"task": "hi-1-3"}'),
    _request(b"GET /tasks"),
    _request(b"GET /events?since=0&wait=0"),
    _request(b"GET /events?since=18446744073709551615&wait=0.0", more=b"Connection: close\r\n"),
    _request(
        b"POST /say",
        b'{"text": "%C3%A4"}',
        b"Expect: 100-continue\r\nTransfer-Encoding: chunked\r\n",
    ),
)


@contextmanager
def serving(folder: Path) -> Iterator[Callable[[bytes], None]]:
    """The service with an agent that answers at once."""
    # a changed wait=9 would be a wait of 9 s, as asked
    longest, server.LONGEST_WAIT_S = server.LONGEST_WAIT_S, 0.02
    bounds = loopback_server.LOOK_S, loopback_server.BODY_S
    loopback_server.LOOK_S, loopback_server.BODY_S = 0.02, 0.05  # else half a request is waited for
    desk = server.HttpDevice(lambda word, delay=0.0: desk.tell(Answer(word.ticket, LINE)), folder)

    def ask(data: bytes) -> None:
        port, token = desk.address.port, desk.address.token.encode()
        assert_http(said(port, data.replace(HOST, b"127.0.0.1:%d" % port).replace(TOKEN, token)))

    try:
        yield ask
    finally:
        server.LONGEST_WAIT_S = longest
        loopback_server.LOOK_S, loopback_server.BODY_S = bounds
        desk.close()


def said(port: int, data: bytes) -> bytes:
    """Return all that is answered until the end of the connection."""
    with socket.create_connection(("127.0.0.1", port), WITHIN_S) as connection:
        found = b""
        try:
            connection.sendall(data)
            while piece := connection.recv(65536):
                found += piece
        except OSError as error:  # it need not read all that is wrong
            if isinstance(error, TimeoutError):
                raise
            pass
        return found


def assert_http(answer: bytes) -> None:
    """Nothing, or a status line and JSON."""
    if not answer:
        return
    assert answer.startswith(b"HTTP/1"), answer[:200]
    head, _, body = answer.partition(b"\r\n\r\n")
    while head.startswith(b"HTTP/1.1 100") or head.startswith(b"HTTP/1.0 100"):
        head, _, body = body.partition(b"\r\n\r\n")
    status = int(head.split()[1])
    assert status < 500 or status == 503, head[:200]
    if body and b"\r\n\r\n" not in body:
        decoded: Any = msgspec.json.decode(body)
        assert status == 200 or decoded["error"], body[:200]

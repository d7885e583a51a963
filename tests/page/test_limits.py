"""Nobody who can open a connection keeps people from the page: real sockets that say little, much,
or read nothing.
"""

import asyncio
import contextlib
import itertools
import signal
import socket
import ssl
import threading
import time

import pytest
from page_house import WITHIN_S, wait_for

from companion.loopback_server import HEAD_BYTES, LOOK_S, MOST, READS_S, Server, listener
from services.page.app import MOST as MOST_STREAMS
from services.page.app import Streams, sse
from services.page.certificate import Certificate

pytestmark = pytest.mark.process
CROWD = 300
PIECE = 65_536
MOST_UNREAD = 1_000_000
"""Bytes: 0.4 MB are with the two ends' systems, and some pieces with asyncio."""


def connected(page):
    """A connection that says nothing yet."""
    one = socket.create_connection(("127.0.0.1", page.address.port), timeout=WITHIN_S)
    one.settimeout(WITHIN_S)
    return one


def over(one):
    """Whether the other side has ended the connection."""
    one.setblocking(False)
    try:
        while data := one.recv(65536):
            del data
        return True
    except BlockingIOError:
        return False
    except ConnectionError:
        return True


def head(page, request, *lines):
    """The head of a request for this page, with these lines."""
    told = (f"{request} HTTP/1.1", f"Host: 127.0.0.1:{page.address.port}", *lines, "", "")
    return "\r\n".join(told).encode()


def posted(page, cookie, length, *lines):
    """The head of a sentence with a body of that length."""
    lines = (f"Origin: {page.url}", f"Cookie: {cookie}", f"Content-Length: {length}", *lines)
    return head(page, "POST /say", *lines)


def answers_of(one, until=b"\0"):
    """What is answered on a connection, to its end or to these bytes."""
    said = b""
    while until not in said and (data := one.recv(65536)):
        said += data
    return said


def stream(page, cookie):
    """A connection whose stream has begun."""
    one = connected(page)
    one.sendall(head(page, "GET /events", f"Cookie: {cookie}"))
    assert one.recv(12) == b"HTTP/1.1 200"
    return one


def rest(one):
    """All that a stream says until it says that it ends, or ends."""
    one.settimeout(WITHIN_S)
    return answers_of(one, b"event: bye")


def test_half_open_requests_keep_nobody_out(page, house):
    """300 connections with half a head, all at once: a person is served at once, and they are
    ended.
    """
    cookie = page.paired()
    came = time.monotonic()
    page.process.send_signal(signal.SIGSTOP)  # so that it takes all of them in one turn of its loop
    crowd = [connected(page) for _ in range(CROWD)]
    page.process.send_signal(signal.SIGCONT)
    for one in crowd:
        one.sendall(b"POST /stop HTTP/1.1\r\nHost: ")
    began = time.monotonic()
    assert page.form("/stop", {}, cookie)[0] == 200
    assert time.monotonic() - began < WITHIN_S / 4
    assert house.held
    wait_for(lambda: sum(map(over, crowd)) >= CROWD - MOST, "the oldest are ended at once")
    assert time.monotonic() - came < 2 * LOOK_S, "they were ended only as all that say nothing are"
    wait_for(lambda: all(map(over, crowd)), "all of them are ended")
    for one in crowd:
        one.close()


def test_a_head_that_trickles_is_ended_and_one_without_an_end_refused(page):
    """A byte now and then is not a request. Beyond 8 kB it is answered, and the connection ends."""
    with connected(page) as one:
        one.sendall(b"GET / HTTP/1.1\r\nHost: " + 20_000 * b"a")
        assert one.recv(12) == b"HTTP/1.1 400"
    one = connected(page)
    ended = False
    end = time.monotonic() + WITHIN_S
    while not ended and time.monotonic() < end:
        try:
            one.setblocking(True)
            one.sendall(b"G")
        except ConnectionError:
            ended = True
        time.sleep(0.2)
    assert ended
    one.close()


def head_of(page, bytes_):
    """A request for the door whose head has so many bytes, the blank line included."""
    begin = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{page.address.port}\r\nX-Long: ".encode()
    return begin + b"a" * (bytes_ - len(begin) - 4) + b"\r\n\r\n"


def test_a_head_has_eight_kilobytes_at_most(page):
    """To the byte, and however it comes: in one piece, or its last byte apart; also behind another
    request, on a connection that is kept.
    """
    for more, status in ((0, b"200"), (1, b"400"), (1000, b"400"), (60_000, b"400")):
        head = head_of(page, HEAD_BYTES + more)
        for pieces in ([head], [head[:-1], head[-1:]]):
            with connected(page) as one:
                one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for piece in pieces:
                    with contextlib.suppress(ConnectionError):  # it was refused before its end
                        one.sendall(piece)
                assert one.recv(12) == b"HTTP/1.1 " + status, (more, len(pieces))
    with connected(page) as one:
        one.sendall(head_of(page, 200) + head_of(page, HEAD_BYTES + 1))
        answers = answers_of(one)
        assert answers.count(b"HTTP/1.1 200") == answers.count(b"HTTP/1.1 400") == 1


def test_a_body_is_no_head(page):
    """A form of 4 kB behind its head is served, and so is what comes with it: a head as long as one
    may be.
    """
    cookie = page.paired()
    with connected(page) as one:
        one.sendall(posted(page, cookie, 4000, "Expect: 100-continue"))
        assert one.recv(65536).startswith(b"HTTP/1.1 100")
        one.sendall(b"text=" + b"a" * 3995 + head_of(page, HEAD_BYTES))
        answers = answers_of(one, b"HTTP/1.1 200")
        assert b"head of a request" not in answers
        assert b"HTTP/1.1 200" in answers


def test_a_web_socket_is_refused(page):
    """With a sentence, paired or not: there is none."""
    key = ("Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==")
    upgrade = ("Connection: Upgrade", "Upgrade: websocket", *key)
    paired = f"Cookie: {page.paired()}"
    for path, cookies in itertools.product(("/", "/events"), ((), (paired,))):
        with connected(page) as one:
            one.sendall(head(page, f"GET {path}", *cookies, *upgrade))
            answer = one.recv(65536)
            assert answer.startswith(b"HTTP/1.1 400")
            assert b"no WebSocket" in answer or b"no WebSocket" in one.recv(65536)


def test_a_body_that_is_too_large_or_never_whole_is_refused(page):
    """Of 50 MB only the first bytes are read; one that lacks is answered in time."""
    cookie = page.paired()
    one = connected(page)
    one.sendall(posted(page, cookie, 50_000_000))
    sent = 0
    try:
        while sent < 50_000_000:
            one.sendall(bytes(65536))
            sent += 65536
    except (ConnectionError, TimeoutError):
        pass
    assert sent < 5_000_000
    one.close()
    with connected(page) as slow:
        slow.sendall(posted(page, cookie, 100) + b"text=take")
        assert slow.recv(12) == b"HTTP/1.1 408"


@pytest.mark.parametrize("tls", [False, True])
def test_who_does_not_read_is_ended(tls, tmp_path):
    """A client that reads nothing of an endless answer is gone in seconds, over TLS, too; little
    waits for it.
    """
    over_now, listening = threading.Event(), listener("127.0.0.1", 0, "")
    disconnected, sent = [], []

    async def endless(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        while not (over_now.is_set() or disconnected):
            await send({"type": "http.response.body", "body": bytes(PIECE), "more_body": True})
            sent.append(PIECE)
            listening = asyncio.ensure_future(receive())
            await asyncio.wait((listening,), timeout=0.001)
            listening.cancel()
            if (
                listening.done()
                and not listening.cancelled()
                and listening.result()["type"] == "http.disconnect"
            ):
                disconnected.append(scope["path"])

    server = Server(endless, Certificate(tmp_path, "127.0.0.1").context if tls else None)
    trusting = ssl.create_default_context(cafile=tmp_path / "authority.pem") if tls else None
    serving = threading.Thread(target=asyncio.run, args=(server.serve([listening]),))
    serving.start()
    try:
        with contextlib.ExitStack() as open_ones:
            deaf = open_ones.enter_context(socket.socket())
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, PIECE)
            deaf.settimeout(WITHIN_S)
            deaf.connect(listening.getsockname())
            if trusting is not None:
                deaf = trusting.wrap_socket(deaf, server_hostname="127.0.0.1")
                open_ones.enter_context(deaf)
            deaf.sendall(b"GET /deaf HTTP/1.1\r\nHost: here\r\n\r\n")
            wait_for(lambda: disconnected == ["/deaf"], "it is ended", READS_S + WITHIN_S)
            assert sum(sent) < MOST_UNREAD
    finally:
        over_now.set()
        server.should_exit = True
        serving.join(WITHIN_S)
        listening.close()


def test_streams_are_bounded(page):
    """One more than there may be ends the oldest; the newest goes on."""
    cookie = page.paired()
    crowd = [stream(page, cookie) for _ in range(MOST_STREAMS + 2)]
    for one in crowd[:2]:
        assert b"event: bye" in rest(one)
    assert not over(crowd[-1])
    for one in crowd:
        one.close()


def test_of_many_streams_that_begin_at_once_the_oldest_end():
    """Each ends another one, though none has had a turn to end in."""

    async def said():
        streams = Streams()
        begun = [streams.listen("en") for _ in range(MOST_STREAMS + 6)]
        for one in begun:
            await anext(one)  # when to try again
            await anext(one)  # the page's clock
        streams.tell("en", "view", b"{}")
        return [await anext(one) for one in begun]

    assert asyncio.run(said()) == [sse("bye", b"")] * 6 + [sse("view", b"{}")] * MOST_STREAMS


def test_it_ends_in_order_with_open_streams(page):
    """SIGTERM ends them with a word, at once."""
    cookie = page.paired()
    one = stream(page, cookie)
    assert page.end() == 0
    assert b"event: bye" in rest(one)
    one.close()

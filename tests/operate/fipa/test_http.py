"""Server and posts of ours, over real sockets: what is taken, by whom, and to whom we post."""

import asyncio
import contextlib
import socket
import ssl

import pytest
from foreign_platform import post
from gateway_house import run
from https_site import keys, site
from hypothesis import given
from hypothesis import strategies as st

from operate.guests import fipa_http
from operate.guests.fipa_http import (
    MAX_BODY,
    MOST_CONNECTIONS,
    AddressError,
    Poster,
    Reply,
    is_loopback,
    mutual,
)

pytestmark = pytest.mark.timeout(60)


@pytest.fixture(scope="module")
def one_site():
    with site() as made:
        yield made


@pytest.mark.parametrize("path", ["/acc", "/", "/any/path?x=1"])
def test_a_post_to_any_path_is_taken(one_site, path):
    """And answered by an empty 200."""
    one_site.taken.clear()
    assert post(one_site.url, "multipart/mixed ; boundary=b", b"body", path=path) == 200
    assert one_site.taken == [("multipart/mixed ; boundary=b", b"body")]


def raw(port, data):
    """What is answered to bytes."""
    with socket.create_connection(("127.0.0.1", port), timeout=20.0) as made:
        made.sendall(data)
        made.shutdown(socket.SHUT_WR)
        answer = b""
        with contextlib.suppress(ConnectionError):
            while more := made.recv(4096):
                answer += more
    return answer


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"GET /acc HTTP/1.1\r\nHost: x\r\n\r\n", 405),
        (b"POST /acc HTTP/1.1\r\n\r\n", 400),
        (b"\x16\x03\x01\x02\x00\x01\r\n\r\n", 400),
        (b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n" % (MAX_BODY + 1), 413),
        (b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n", 400),
        (b"POST / HTTP/1.1\r\nHost: x\r\nOrigin: http://evil\r\nContent-Length: 0\r\n\r\n", 403),
        (b"POST / HTTP/1.1\r\nX: " + b"x" * 70_000 + b"\r\n\r\n", 431),
        (
            b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
            + b"10000\r\n" + b"x" * 65_536 + b"\r\n10000\r\n" + b"x" * 65_536 + b"\r\n1\r\nx\r\n",
            413,
        ),
    ],
)  # fmt: skip
def test_other_requests_are_refused(one_site, data, status):
    """A page of a browser, too: each browser names its origin."""
    one_site.taken.clear()
    assert raw(one_site.port, data).split(b" ")[1] == str(status).encode()
    assert one_site.taken == []


def test_a_request_that_is_not_whole_in_time_is_ended(one_site, monkeypatch):
    """Whoever sends slowly keeps no place."""
    monkeypatch.setattr(fipa_http, "REQUEST_S", 0.1)
    with socket.create_connection(("127.0.0.1", one_site.port), timeout=20.0) as made:
        made.sendall(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nx")
        assert made.recv(4096).split(b" ")[1] == b"408"


@given(data=st.binary(max_size=200))
def test_any_bytes_are_answered_or_the_connection_ends(one_site, data):
    """And the next post is taken."""
    answer = raw(one_site.port, data)
    assert not answer or 400 <= int(answer.split(b" ")[1]) < 500
    assert post(one_site.url, "x", b"") == 200


def test_who_holds_connections_keeps_nobody_out(one_site):
    """The oldest one ends."""
    held = [
        socket.create_connection(("127.0.0.1", one_site.port)) for _ in range(2 * MOST_CONNECTIONS)
    ]
    try:
        assert post(one_site.url, "x", b"") == 200
        held[0].settimeout(20.0)
        with contextlib.suppress(ConnectionError):
            assert held[0].recv(1) == b""
    finally:
        for one in held:
            one.close()


def test_what_is_posted_arrives_and_what_is_refused_is_an_error(one_site):
    """By the first address that takes it."""

    async def test():
        poster = Poster()
        dead = f"http://127.0.0.1:{free()}/acc"
        await poster.post((dead, one_site.url), "x/y", b"hello")
        assert one_site.taken[-1] == ("x/y", b"hello")
        with pytest.raises(OSError, match=str(dead)):
            await poster.post((dead,), "x/y", b"")
        with site(None, Reply(503)) as busy, pytest.raises(OSError, match="answered 503"):
            await poster.post((busy.url,), "x/y", b"")
        poster.close()

    run(test())


def free():
    """A port at which nobody listens."""
    with socket.create_server(("127.0.0.1", 0)) as made:
        return made.getsockname()[1]


@pytest.mark.parametrize(
    "address",
    [
        "http://192.0.2.1/acc",
        "http://[2001:db8::1]:80/acc",
        "http://0.0.0.0:80/acc",
        "http://nobody.invalid/acc",
        "https://127.0.0.1/acc",
        "file:///etc/passwd",
        "http://",
        "http://127.0.0.1:99999/",
        "http://[::1/",
        "http://127.0.0.1@192.0.2.1/",
        "http://x\ud800/",
        "",
    ],
)
def test_without_certificates_nothing_is_posted_beyond_this_machine(address):
    """The reason names the address."""

    async def test():
        poster = Poster()
        with pytest.raises(AddressError):
            await poster.usable((address,))
        with pytest.raises(OSError, match=r"none of|not on|is no|not found"):
            await poster.post((address,), "x", b"")
        assert await poster.usable((address, "http://127.0.0.1:1/")) == ("http://127.0.0.1:1/",)
        with pytest.raises(AddressError, match="no address"):
            await poster.usable(())
        poster.close()

    run(test())


def test_loopback_is_told_from_other_places():
    """By all addresses of a name."""
    assert is_loopback("127.0.0.1")
    assert is_loopback("localhost")
    assert not is_loopback("192.0.2.1")
    assert not is_loopback("0.0.0.0")


# --- certificates of both sides -------------------------------------------------------------------


def test_both_sides_show_a_certificate_of_one_authority(tmp_path):
    """Then it is taken; else neither side says a word."""
    issuer = keys(tmp_path / "ours")
    keys(tmp_path / "theirs", issuer)
    keys(tmp_path / "others")
    ours, theirs, others = (mutual(tmp_path / name) for name in ("ours", "theirs", "others"))
    assert ours.server.verify_mode == ours.client.verify_mode == ssl.CERT_REQUIRED
    nobody = ssl.create_default_context(cafile=tmp_path / "ours/authority.pem")

    async def test(url):
        await Poster(theirs).post((url,), "x", b"hello")
        for stranger in (others, others._replace(client=nobody)):
            with pytest.raises(OSError, match=url):
                await Poster(stranger).post((url,), "x", b"hello")
        with pytest.raises(OSError, match="IP address mismatch"):
            await Poster(theirs).post((url.replace("localhost", "127.0.0.1"),), "x", b"")
        plain = url.replace("https", "http")
        with pytest.raises(AddressError, match="https"):
            await Poster(theirs).usable((plain,))
        assert await asyncio.to_thread(post, plain, "x", b"") == 0

    with site(ours) as made:
        run(test(made.url))
        assert made.taken == [("x", b"hello")]

"""hi's port under people who mean no good: slow connections without a token do not keep a person out."""

import socket
import threading
import time

import pytest

from services.human_interface import server

pytestmark = pytest.mark.timeout(60)
FLOOD = 300
SAY = ("POST", "/say", b'{"text": "look around"}')


def connected(client):
    """A connection."""
    return socket.create_connection(("127.0.0.1", client.address.port), timeout=30.0)


def begun(client):
    """A connection that began a request, and says no more."""
    one = connected(client)
    one.sendall(b"P")
    return one


def threads():
    """The threads that serve requests."""
    return [one for one in threading.enumerate() if "process_request_thread" in one.name]


def ended(one):
    """Whether the other side ends the connection; without it the time-out is a failure."""
    try:
        return one.recv(1) == b""
    except ConnectionError:
        return True


def ends(one, drip, within_s=20.0):
    """Whether the other side ends the connection while this one keeps saying `drip`."""
    one.settimeout(0.05)
    until = time.monotonic() + within_s
    while time.monotonic() < until:
        try:
            one.sendall(drip)
            if one.recv(1) == b"":
                return True
        except TimeoutError:
            continue
        except ConnectionError:
            return True
    return False


def test_a_person_is_served_beside_a_flood_of_slow_connections(client):
    """The oldest that have not said who they are go; threads stay few."""
    flood = []
    most = 0
    try:
        for _ in range(FLOOD):
            flood.append(begun(client))
            most = max(most, len(threads()))
        assert client.ask(*SAY)[0] == 200
        assert most < 2 * server.MOST_STRANGERS  # one that is sent away may take a moment to end
        assert all(ended(one) for one in flood[: FLOOD - server.MOST_STRANGERS])
    finally:
        for one in flood:
            one.close()


def test_who_showed_the_token_is_not_sent_away(client):
    """A request that waits for news keeps its place while strangers come and go."""
    answers = []
    waiter = threading.Thread(target=lambda: answers.append(client.ask("GET", "/events?wait=10")[0]))
    waiter.start()
    while client.desk._server.room._value == server.AT_ONCE:
        time.sleep(0.001)
    flood = [begun(client) for _ in range(2 * server.MOST_STRANGERS)]
    assert ended(flood[0])
    client.desk.close()
    waiter.join(30.0)
    assert answers == [200]
    for one in flood:
        one.close()


def test_a_head_is_whole_within_its_time_or_the_connection_ends(client, monkeypatch):
    """However often a byte of it comes."""
    monkeypatch.setattr(server, "REQUEST_S", 0.5)
    with connected(client) as one:
        one.sendall(b"GET /tasks HTTP/1.0\r\nX: ")
        assert ends(one, b"x")


def test_a_body_is_whole_within_its_time_or_it_is_refused(client, monkeypatch):
    """408, also to who has the token."""
    monkeypatch.setattr(server, "REQUEST_S", 0.5)
    with connected(client) as one:
        port, token = client.address.port, client.address.token
        head = ("POST /say HTTP/1.0", f"Host: 127.0.0.1:{port}", f"Authorization: Bearer {token}", "Content-Length: 9")
        one.sendall("\r\n".join((*head, "", "{")).encode())
        answer = b""
        while part := one.recv(4096):
            answer += part
    assert b" 408 " in answer.splitlines()[0]
    assert b"whole within" in answer
    assert client.words == []


def test_a_head_without_end_is_cut(client):
    """Its bytes are bounded, not only the bytes of a line: fewer lines than HTTP libraries take."""
    with connected(client) as one:
        one.sendall(b"GET /tasks HTTP/1.0\r\n")
        assert ends(one, b"X: " + b"x" * 60_000 + b"\r\n", within_s=2.0)

"""A platform of our own that speaks as JADE 4.6.5 was observed to (2026-11-22): what it posts, how
it answers what is posted, and its AMS.
"""

import contextlib
import http.server
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from jade import as_jade

from fipa_codec.acl_string import AclMessage, Aid, parse
from fipa_codec.envelope import unpack
from fipa_codec.performatives import Performative as P

DEADLINE_S = 60.0


def wait_for(condition: Callable[[], object], what: str) -> None:
    """Look until it is so."""
    until = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < until, f"not within {DEADLINE_S} s: {what}"
        time.sleep(0.01)


def posted(message: AclMessage, sender: Aid, receivers: tuple[Aid, ...]) -> tuple[str, bytes]:
    """Content type and body, as JADE writes them."""

    def aid(one: Aid) -> str:
        urls = "".join(f"<url>{url}</url>" for url in one.addresses)
        return (
            f"<agent-identifier><name>{one.name}</name><addresses>{urls}</addresses>"
            "</agent-identifier>"
        )

    text = as_jade(message).encode("ascii", "replace")
    to = "".join(map(aid, receivers))
    xml = (
        f'<?xml version="1.0"?>\n<envelope><params index="1"><to>{to}</to>'
        f"<from>{aid(sender)}</from>"
        "<acl-representation>fipa.acl.rep.string.std</acl-representation>"
        f"<payload-length>{len(text)}</payload-length><date>20260101Z000000000</date>"
        f"<intended-receiver>{to}</intended-receiver></params></envelope>"
    ).encode()
    line = b"---------------------------b0b1b2"
    body = (
        b"This is not part of the MIME multipart encoded message.\r\n--" + line
        + b"\r\nContent-Type: application/xml\r\n\r\n" + xml
        + b"\r\n--" + line + b"\r\nContent-Type: application/text\r\n\r\n" + text
        + b"\r\n--" + line + b"--\r\n"
    )  # fmt: skip
    return f'multipart/mixed ; boundary="{line.decode()}"', body


def post(address: str, what: str, body: bytes, *, more: str = "", path: str = "/acc") -> int:
    """The status by which somebody answers; 0 for none."""
    host, _, port = address.removeprefix("http://").partition("/")[0].rpartition(":")
    head = (
        f"POST {path} HTTP/1.1\r\nCache-Control: no-cache\r\nMime-Version: 1.0\r\n"
        f"Host: {host}:{port}\r\nContent-Type: {what}\r\nContent-Length: {len(body)}\r\n"
        f"{more}Connection: Keep-Alive\r\n\r\n"
    )
    with socket.create_connection((host, int(port)), timeout=DEADLINE_S) as made:
        made.sendall(head.encode("latin-1") + body)
        answer = b""
        with contextlib.suppress(ConnectionError):
            while b"\r\n" not in answer and (more_ := made.recv(4096)):
                answer += more_
    return int(answer.split(b" ")[1]) if answer else 0


class Platform:
    """Agents are added by name; `heard` has what each was told, in order."""

    def __init__(self, port: int = 0) -> None:
        platform = self
        self.status = 200
        self._lock = threading.Lock()
        self.all: list[AclMessage] = []
        self.agents = {"buyer"}

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                # no Content-Length, no body, and the end of the connection
                words = f"HTTP/1.1 {platform.status} OK\r\nCache-Control: no-cache\r\n\r\n"
                platform._took(self.headers["Content-Type"], body)
                self.wfile.write(words.encode())

            def log_message(self, *_: Any) -> None:
                """Say nothing."""

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._server.daemon_threads = True
        self.port = self._server.server_port
        self.address = f"http://127.0.0.1:{self.port}/acc"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """It is gone; its agents are not."""
        self._server.shutdown()
        self._server.server_close()

    def aid(self, agent: str = "buyer") -> Aid:
        """One of its agents."""
        return Aid(f"{agent}@lab:1099/JADE", (self.address,))

    def _took(self, what: str, body: bytes) -> None:
        if self.status != 200:
            return
        envelope, text = unpack(what, body)
        message = parse(text)
        with self._lock:
            self.all.append(message)
        (receiver,) = envelope.intended  # without it JADE loses the message
        agent = receiver.name.partition("@")[0]
        if agent in self.agents or message.sender is None:
            return
        content = (
            f"( (action ( agent-identifier :name {message.sender.name} ) (ACLMessage) )"
            f" (MTS-error ( agent-identifier :name {receiver.name} )"
            ' (internal-error "Agent not found: getContainerID() failed to find agent")))'
        )
        failure = AclMessage(
            performative=P.FAILURE,
            sender=self.aid("ams"),
            receiver=(message.sender,),
            content=content,
            language="fipa-sl",
            protocol=message.protocol,
            conversation_id=message.conversation_id,
            in_reply_to=message.reply_with,
        )
        post(message.sender.addresses[0], *posted(failure, self.aid("ams"), (message.sender,)))

    def heard(self, conversation: str) -> list[AclMessage]:
        """What came in a conversation, in order. What a gateway says again that was killed before
        it noted that it had said so has the same id: it counts once.
        """
        with self._lock:
            mine = [one for one in self.all if one.conversation_id == conversation]
        ids = [one.user.get("X-id") for one in mine]
        return [one for n, one in enumerate(mine) if ids[n] is None or ids[n] not in ids[:n]]

    def acts(self, conversation: str) -> list[str]:
        """The acts of that."""
        return [str(one.performative) for one in self.heard(conversation)]

    def say(self, act: P, to: Aid, conversation: str, agent: str = "buyer", **fields: Any) -> int:
        """Post a message; the status of its answer. `reply_with` is the name and milliseconds."""
        sender = self.aid(agent)
        label = f"{sender.name}{int(time.time() * 1000)}"
        words = {"reply_with": label, "protocol": "fipa-request", **fields}
        message = AclMessage(
            performative=act,
            sender=sender,
            receiver=(to,),
            conversation_id=conversation,
            **words,
        )
        return post(to.addresses[0], *posted(message, sender, (to,)))


@contextlib.contextmanager
def platform(port: int = 0) -> Iterator[Platform]:
    """One that is gone at the end."""
    made = Platform(port)
    try:
        yield made
    finally:
        made.close()

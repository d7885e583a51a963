"""Two systems side by side: agents' wires of both, linked, and one router for tools, in this
process.

And a link to a router that can go silent, as a cable that is pulled: whoever is connected notices
nothing at first.
"""

import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

import zenoh

from agent_runtime.core.events import Receipt
from agent_runtime.core.wiring import service_key
from agent_runtime.io.inbox import Inbox
from agent_runtime.io.secured import client_tls, links_of, links_tls
from agent_runtime.io.sessions import client_config, free_endpoint, open_links
from agent_runtime.io.steplog import StepLogs
from agent_runtime.io.zenoh_wire import ZenohWire
from companion.design import wiring
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative

KINDS = ("state",)
"""Kinds of signals that every agent may write."""


class Pair:
    """co and ta of one system: two linked sessions, two inboxes. `heard`: everything that came, per
    agent.
    """

    def __init__(
        self, system: str, endpoint: str, keys: Path | None = None, logs: Path | None = None
    ) -> None:
        """`endpoint`: the router's. `keys`: of the site (agent_runtime.io.issuing), where it has
        some. `logs`: folder of the step logs.
        """
        self.system = system
        self._logs = None if logs is None else StepLogs(logs)
        if logs is not None:
            for name in ("co", "ta"):
                (logs / "steps").mkdir(parents=True, exist_ok=True)
                (logs / "steps" / f"{name}.steps").touch()
        own = keys and keys / system
        scheme = "tls/" if own else "tcp/"
        self.ends = {name: free_endpoint().replace("tcp/", scheme) for name in ("co", "ta")}
        self.sessions = {}
        for name, at in self.ends.items():
            rules = own and links_tls(own, name), own and links_of(own, name)
            others = tuple(set(self.ends.values()) - {at})
            self.sessions[name] = open_links(at, others, *rules)
        self.inboxes = {name: Inbox() for name in self.sessions}
        self.heard: dict[str, list[object]] = {name: [] for name in self.sessions}
        self.wires, life = {}, 1 if system == "velma1" else 2
        for name, session in self.sessions.items():
            log = logs and logs / "steps" / f"{name}.steps"
            wires = wiring(name, system)
            self.wires[name] = ZenohWire(session, wires, life, self.inboxes[name], log=log)
        for name, wire in self.wires.items():
            wire.join(zenoh.open(client_config(endpoint, own and client_tls(own, name))))

    def talk(self, text: str) -> None:
        """Say one of everything that an agent can say, both ways, with this text in it."""
        for me, peer, act in (
            ("co", "ta", Performative.REQUEST),
            ("ta", "co", Performative.INFORM),
        ):
            wire = self.wires[me]
            one = Communicate(
                performative=act, protocol="coordinate", language="SW", conversation=text,
                sender=me, receiver=peer,
                id=text, sent=time.time(),
            )  # fmt: skip
            wire.send(one)
            if self._logs is not None:
                self._logs.passed(one, time.time())
            wire.send_receipt(Receipt(peer, 0, text, 0))
            wire.ping(peer, text.encode())
            wire.ping(peer, text.encode(), pong=True)
            for kind in KINDS:
                wire.publish(kind, text.encode())

    def fence(self, name: str, text: bytes) -> None:
        """The last word to an agent: what was said before in its session has been decided when it
        is there.
        """
        peer = "ta" if name == "co" else "co"
        self.sessions[peer].put(service_key(self.system, "receipt", peer, name), text)

    def listen(self, name: str) -> list[object]:
        """Return the objects that an agent received so far."""
        while (item := self.inboxes[name].get(0.0)) is not None:
            self.heard[name].append(item)
        return self.heard[name]

    def close(self) -> None:
        """End both sessions."""
        for wire in self.wires.values():
            wire.close()


class Cable:
    """Forwards connections from a port of its own to an endpoint; `pulled`: it takes and gives
    nothing, and says so to nobody.
    """

    def __init__(self, endpoint: str) -> None:
        self._to = ("127.0.0.1", int(endpoint.rpartition(":")[2]))
        self._in = threading.Event()
        self._in.set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        self._ends: list[socket.socket] = [self._listener]
        threading.Thread(target=self._accept, daemon=True).start()

    def pull(self) -> None:
        """From now on nothing goes through."""
        self._in.clear()

    def plug(self) -> None:
        """It goes through again, with what waited."""
        self._in.set()

    def close(self) -> None:
        """Cut everything."""
        self._in.set()
        for end in self._ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                self._in.wait()
                try:
                    far = socket.create_connection(self._to)
                except OSError:
                    near.close()
                    continue
                self._ends += [near, far]
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=(one, other), daemon=True).start()

    def _forward(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while data := one.recv(65536):
                self._in.wait()
                other.sendall(data)
        for end in (one, other):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

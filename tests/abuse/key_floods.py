"""Floods of a rightful key: what it puts, and a peer of the flooded agent that wants an answer
meanwhile.
"""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import zenoh
from secured_fleet import SYSTEM, listens, serve, session
from toy_fleet import Fleet, wait_for

from agent_runtime.io.shell import HEARTBEAT_S
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative

REQUEST = f"roco/{SYSTEM}/C2/hi/co/request/request"
PATIENCE_S = 20.0
"""For an answer amid a flood, which takes some ms (benchmarks/floods.py), on a machine that is busy
with much else.

What found no room in time is dropped, so the question is asked again as agents do.
"""


def request(number: int, sender: str = "hi", conversation: str = "") -> bytes:
    """A request without content, under a number of the stream."""
    return encode(
        Communicate(
            performative=Performative.REQUEST,
            sender=sender,
            receiver="co",
            protocol="request",
            conversation=conversation or f"hi-1-{number}",
            id=str(number),
        )
    )


def co(router: Fleet) -> None:
    """Start co, and wait until it listens and is at the router."""
    serve(router, "co", "services.coordinator")
    wait_for(lambda: listens(router, "co"), f"co is there\n{router.logs()}")


def log(router: Fleet) -> list[dict[str, object]]:
    """The lines of co's log."""
    return [
        json.loads(line) for line in (router.run / "logs" / "co.jsonl").read_text().splitlines()
    ]


def memory_mb(pid: int) -> float:
    """Memory of a process now."""
    line = next(
        line
        for line in Path(f"/proc/{pid}/status").read_text().splitlines()
        if line.startswith("VmRSS")
    )
    return int(line.split()[1]) / 1024


class Peer:
    """ta, of which only this is there: it asks co whether it is there, and waits for the answer."""

    def __init__(self, fleet: Fleet) -> None:
        self._session = session(fleet, "ta", "co")
        self._answered = threading.Event()
        key = f"roco/{SYSTEM}/_/pong/co/ta"
        self._declared = self._session.declare_subscriber(key, lambda sample: self._answered.set())

    def asks(self) -> bool:
        """Whether co answers."""
        self._answered.clear()
        return any(self._asked() for _ in range(round(PATIENCE_S / HEARTBEAT_S)))

    def _asked(self) -> bool:
        self._session.put(
            f"roco/{SYSTEM}/_/ping/ta/co", b"C1", congestion_control=zenoh.CongestionControl.BLOCK
        )
        return self._answered.wait(HEARTBEAT_S)

    def close(self) -> None:
        """End the session."""
        self._declared.undeclare()
        self._session.close()  # type: ignore[no-untyped-call]


@contextmanager
def flooding(
    thief: zenoh.Session, key: str, said: Callable[[int], bytes], at_least: int
) -> Iterator[None]:
    """Put as fast as possible, until the end of it, and at least that many."""
    over, put = threading.Event(), 0

    def flood() -> None:
        nonlocal put
        while not over.is_set() or put < at_least:
            thief.put(key, said(put), congestion_control=zenoh.CongestionControl.BLOCK)
            put += 1

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        wait_for(lambda: put > at_least // 10, "it is a flood")
        yield
    finally:
        over.set()
        thread.join()

"""Floods of a rightful key: what it puts, and a peer of the flooded agent that wants an answer
meanwhile.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from secured_fleet import KeyHolder
from toy_fleet import Fleet, wait_for

from agent_runtime.io.shell import HEARTBEAT_S
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative

REQUEST, PING = "C2/hi/co/request/request", "_/ping/hi/co"
"""Keys of hi."""
PATIENCE_S = 20.0
"""For an answer amid a flood, which takes some ms (benchmarks/floods.py), on a machine that is busy
with much else.

What found no room in time is dropped, so the question is asked again as agents do.
"""


def request(number: int, sender: str = "hi", conversation: str = "") -> bytes:
    """A request without content, under a number of the stream."""
    return encode(
        Communicate(
            performative=Performative.REQUEST, sender=sender, receiver="co", protocol="request",
            conversation=conversation or f"hi-1-{number}", id=str(number),
        )
    )  # fmt: skip


def memory_mb(pid: int, what: str = "VmRSS") -> float:
    """Memory of a process now; `what` VmHWM: the most so far."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(what)) / 1024


class Peer(KeyHolder):
    """ta, of which only this is there: it asks co whether it is there, and waits for the answer."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet, "ta")
        self._answered = threading.Event()
        self.hears("_/pong/co/ta", lambda _: self._answered.set())

    def asks(self) -> bool:
        """Whether co answers."""
        self._answered.clear()
        return any(self._asked() for _ in range(round(PATIENCE_S / HEARTBEAT_S)))

    def _asked(self) -> bool:
        self.put("_/ping/ta/co", b"C1")
        return self._answered.wait(HEARTBEAT_S)


@contextmanager
def repeated(do: Callable[[int], None], at_least: int, of_these: int) -> Iterator[None]:
    """Do it as fast as it goes, until the end of the block and at least that often; the block
    begins after some.
    """
    over, done = threading.Event(), 0

    def repeat() -> None:
        nonlocal done
        while not over.is_set() or done < at_least:
            do(done)
            done += 1

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        wait_for(lambda: done > of_these, "it is a flood")
        yield
    finally:
        over.set()
        thread.join()

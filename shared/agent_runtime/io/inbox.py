"""Inbox that holds events of callbacks and devices until the loop thread takes them: in turns,
bounded for each sender.

A callback that worked or waited would hold up every other subscriber of the session, silently; so
callbacks only put. Each sender has a lane of each class, and the lanes are served in turns: whoever
floods waits behind its own. What is beyond a bound is dropped and counted, and nothing is lost by
it for good: streams are re-sent, questions asked again, receipts repeated.
"""

import threading
from collections import Counter, deque
from enum import StrEnum
from queue import Empty
from time import monotonic
from typing import Any

import msgspec

from agent_runtime.io.one_reader import OneReaderQueue


class Class(StrEnum):
    """Classes of entries; those of others are bounded for each sender."""

    OWN = "own"
    """The own side: its devices, the link to the router. Never dropped."""
    LIFE = "life"
    """Liveliness tokens."""
    CONTROL = "control"
    """Receipts, pings, orders: the newest is worth most."""
    STREAM = "stream"
    VOLATILE = "volatile"


class Bound(msgspec.Struct, frozen=True):
    """`waiting`: most entries of a sender; beyond it the newest is dropped, or (`latest`) the
    oldest.

    `rate`: how many a second are taken from a sender, after `burst` at once; more are dropped
    before they cost a step.
    """

    waiting: int
    rate: float
    burst: float
    latest: bool = False


BOUNDS = {
    Class.LIFE: Bound(1024, rate=4000.0, burst=4000.0),
    Class.CONTROL: Bound(64, rate=1000.0, burst=1000.0, latest=True),
    Class.STREAM: Bound(64, rate=1000.0, burst=1000.0),
    Class.VOLATILE: Bound(256, rate=4000.0, burst=4000.0),
}
"""Waiting: 16 unreceipted messages with copies; some seconds of questions; all of Peers' tokens
(estimates).

Rates: whoever asks, and asks again when the answer is there, says 900 things a second (1.1 ms,
benchmarks/README.md); a machine four times as fast was assumed. What is durable waits for a disk,
and its receipt with it (estimate).
"""
MOST_BYTES = 16 * 1024 * 1024
"""Of what waits in a lane; estimate: four of the longest messages."""
_Lane = tuple[Class, str]


class _Interrupt(msgspec.Struct, frozen=True):
    """An entry that was left by a signal handler."""

    item: Any


class Inbox:
    """A queue for many writers and one reader. `dropped`: how many entries of which sender and
    class.
    """

    def __init__(self) -> None:
        self._turns = OneReaderQueue[_Lane | _Interrupt]()
        """Lanes in which something waits, each once."""
        self._lanes: dict[_Lane, deque[tuple[Any, int]]] = {}
        self._bytes: Counter[_Lane] = Counter()
        self._left: dict[_Lane, tuple[float, float]] = {}
        self._unfinished = 0
        self._in_hand = False
        self._lock = threading.Lock()
        self.dropped: Counter[str] = Counter()

    def admits(self, kind: Class, sender: str) -> bool:
        """Whether the sender is within its rate; else it is counted as dropped. Takes no lock."""
        bound = BOUNDS.get(kind)
        if bound is None:
            return True
        now, lane = monotonic(), (kind, sender)
        left, at = self._left.get(lane, (bound.burst, now))
        left = min(bound.burst, left + (now - at) * bound.rate)
        self._left[lane] = (left - 1.0 if left >= 1.0 else left), now
        if left < 1.0:
            self.dropped[f"{kind} of {sender}"] += 1
        return left >= 1.0

    def put(self, kind: Class, item: Any, sender: str = "", size: int = 0) -> bool:
        """Leave an entry of `size` bytes; False where its sender has too many. Never blocks.

        For the stop signal use `interrupt`.
        """
        name = (kind, sender)
        with self._lock:
            lane = self._lanes.setdefault(name, deque())
            fits = self._make_room(name, lane, size)
            if fits:
                lane.append((item, size))
                self._bytes[name] += size
                self._unfinished += 1
                if len(lane) == 1:
                    self._turns.put(name)
            return fits

    def interrupt(self, item: Any) -> None:
        """Leave an entry from a signal handler: takes no lock that the interrupted thread might
        hold.
        """
        self._turns.put(_Interrupt(item))

    @property
    def idle(self) -> bool:
        """Whether no entry waits, and the reader is done with the last one: it asked for the
        next.
        """
        return self._unfinished == 0

    def get(self, timeout_s: float | None) -> Any:
        """The oldest entry of whose turn it is; None when there is none within the time (None: wait
        for ever).
        """
        if self._in_hand:
            with self._lock:
                self._unfinished -= 1
            self._in_hand = False
        try:
            turn = self._turns.get(timeout_s)
        except Empty:
            return None
        if isinstance(turn, _Interrupt):
            return turn.item
        self._in_hand = True
        with self._lock:
            lane = self._lanes[turn]
            item, size = lane.popleft()
            self._bytes[turn] -= size
            if lane:
                self._turns.put(turn)
        return item

    def _make_room(self, name: _Lane, lane: deque[tuple[Any, int]], size: int) -> bool:
        """Whether an entry fits, perhaps after the oldest was dropped."""
        bound = BOUNDS.get(name[0])
        if bound is None or (len(lane) < bound.waiting and self._bytes[name] + size <= MOST_BYTES):
            return True
        self.dropped[f"{name[0]} of {name[1]}"] += 1
        if not bound.latest or size > MOST_BYTES:
            return False
        while len(lane) > 1 and (
            len(lane) >= bound.waiting or self._bytes[name] + size > MOST_BYTES
        ):
            self._bytes[name] -= lane.popleft()[1]
            self._unfinished -= 1
        return len(lane) < bound.waiting and self._bytes[name] + size <= MOST_BYTES

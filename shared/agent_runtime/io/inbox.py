"""Where callbacks and devices leave what happened until the loop thread takes it: bounded, with a policy per class.

A callback that worked or waited would hold up every other subscriber of the session, silently; so callbacks only put.
What is beyond a bound is dropped and counted, and nothing is lost by it for good: streams are re-sent, questions asked
again.
"""

import queue
import threading
from collections import Counter
from enum import StrEnum
from typing import Any


class Class(StrEnum):
    """Classes of entries; each has its bound."""

    CONTROL = "control"
    """Receipts, life and death, the own side, the signal to stop: never dropped."""
    STREAM = "stream"
    VOLATILE = "volatile"


BOUNDS = {Class.STREAM: 256, Class.VOLATILE: 1024}
"""Estimates: 16 unreceipted messages of each of 5 peers with copies; some seconds of queries."""


class Inbox:
    """A queue for many writers and one reader."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[tuple[Class | None, Any]] = queue.SimpleQueue()
        self._waiting: Counter[Class] = Counter()
        self._unfinished = 0
        self._in_hand = False
        self._lock = threading.Lock()
        self.dropped: Counter[Class] = Counter()

    def put(self, kind: Class, item: Any) -> bool:
        """Leave an entry; False where its class is full. Never blocks. For the stop signal use `interrupt`."""
        with self._lock:
            if self._waiting[kind] >= BOUNDS.get(kind, 1 << 30):
                self.dropped[kind] += 1
                return False
            self._waiting[kind] += 1
            self._unfinished += 1
        self._queue.put((kind, item))
        return True

    def interrupt(self, item: Any) -> None:
        """Leave an entry from a signal handler: takes no lock that the interrupted thread might hold."""
        self._queue.put((None, item))

    @property
    def idle(self) -> bool:
        """Whether no entry waits, and the reader is done with the last one: it asked for the next."""
        return self._unfinished == 0

    def get(self, timeout_s: float | None) -> Any:
        """The oldest entry; None when there is none within the time (None: wait for ever)."""
        if self._in_hand:
            with self._lock:
                self._unfinished -= 1
            self._in_hand = False
        try:
            kind, item = self._queue.get(timeout=None if timeout_s is None else max(0.0, timeout_s))
        except queue.Empty:
            return None
        if kind is not None:
            self._in_hand = True
            with self._lock:
                self._waiting[kind] -= 1
        return item

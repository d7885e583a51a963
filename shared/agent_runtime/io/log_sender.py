"""Sends an agent's step log to a recorder on another host, for as long as that asks for it.

The recorder says how much of the log it has, again and again; from there on the sender puts what is in the file, in
parts, and what is added to it. So whatever was lost on the way, or was written while no recorder was there, is sent
once more. A thread of its own: nothing waits for it. It rests, without a thread, while nobody asks.
"""

import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

KIND, WANTED = "steps", "want"
"""Kinds of signals: a part of a log, and that one is wanted."""
OFFSET = struct.Struct("<Q")
"""A place in a log [bytes]: before a part of it; alone, where the recorder has the log up to there."""
MOST_BYTES = 256 * 1024
"""Of a part (estimate: 2 ms of a network of 1 Gbit/s)."""
PAUSE_S = 0.1
"""Between two looks at the file (estimate: people see no delay)."""
LEASE_S = 5.0
"""So long is sent after it was asked for; five times the recorder's pause between two askings."""


class LogSender:
    """`put` gets each part; it may block."""

    def __init__(self, path: Path, put: Callable[[bytes], None]) -> None:
        self._path, self._put = path, put
        self._lock = threading.Lock()
        self._at = self._asked = -1
        self._until = 0.0
        self._thread: threading.Thread | None = None
        self._over = threading.Event()

    def wanted(self, data: bytes) -> None:
        """A recorder has so much of it. From Zenoh's threads; never blocks. What is no offset is ignored."""
        if len(data) != OFFSET.size:
            return
        (there,) = OFFSET.unpack(data)
        with self._lock:
            self._until = time.monotonic() + LEASE_S
            if there > self._at or there == self._asked:  # it has more, or got nothing since it asked before
                self._at = there
            self._asked = there
            if self._thread is None and not self._over.is_set():
                self._at = there
                self._thread = threading.Thread(target=self._send, name="log sender", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Send no more."""
        self._over.set()
        with self._lock:
            thread = self._thread
        if thread is not None:
            thread.join(PAUSE_S)  # a put may hang where its cable is cut; the process ends all the same

    def _send(self) -> None:
        while not self._over.is_set():
            with self._lock:
                if time.monotonic() > self._until:
                    self._thread = None
                    return
                at = self._at
            with self._path.open("rb") as file:
                file.seek(at)
                part = file.read(MOST_BYTES)
            if not part:
                self._over.wait(PAUSE_S)
                continue
            self._put(OFFSET.pack(at) + part)
            with self._lock:
                if self._at == at:
                    self._at = at + len(part)

"""Bounds on requests before their sender is known: how many, how long, how large.

Whoever reaches hi's port can open connections. So that they take neither all threads nor all memory, a request must be
whole in a given time and size, and of the connections that have not shown the token yet the oldest goes when there are
too many: a person's request is whole within milliseconds, one that is held open on purpose is old.
"""

import contextlib
import io
import socket
import threading
import time

MOST_STRANGERS = 32
"""Connections without the token (so far). With as many requests that are served, and some 20 threads of Zenoh, there is
room below the 128 processes and threads of hi's container (deploy/compose.yaml)."""
REQUEST_S = 5.0
"""Longest from a connection's begin to the end of its request; `roco` takes milliseconds (estimate: a busy machine)."""
LONGEST_REQUEST = 81_920
"""Bytes of a request: 16 KiB of head (estimate; `roco` sends 200 bytes), and `server.DRAINED` of body."""
LEAVES_S = 1.0
"""Longest that a connection which was ended keeps the next one waiting (estimate; it takes a millisecond)."""


class Doorstep:
    """The connections that have not shown the token, oldest first; at most `most`."""

    def __init__(self, most: int = MOST_STRANGERS) -> None:
        self._most = most
        self._changed = threading.Condition()
        self._strangers: dict[socket.socket, None] = {}

    def come(self, connection: socket.socket) -> None:
        """Take a new connection; where there are too many, end the oldest and wait until it has left."""
        with self._changed:
            if len(self._strangers) >= self._most:
                with contextlib.suppress(OSError):  # its other side was faster
                    next(iter(self._strangers)).shutdown(socket.SHUT_RDWR)
                self._changed.wait_for(lambda: len(self._strangers) < self._most, LEAVES_S)
            self._strangers[connection] = None

    def leave(self, connection: socket.socket) -> None:
        """Let a connection go that showed the token, or has ended; no matter how often."""
        with self._changed:
            self._strangers.pop(connection, None)
            self._changed.notify_all()


class Bounded(socket.SocketIO):
    """Bounded reader of a connection: for at most REQUEST_S, and at most LONGEST_REQUEST bytes.

    Raise TimeoutError and ConnectionAbortedError beyond.
    """

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(connection, "r")
        self._connection = connection
        self._until = time.monotonic() + REQUEST_S
        self._left = LONGEST_REQUEST

    def readinto(self, buffer: "bytearray | memoryview") -> int | None:  # type: ignore[override]
        """Read what is there, or wait for it until the time is over."""
        left_s = self._until - time.monotonic()
        if left_s <= 0.0:
            raise TimeoutError
        self._connection.settimeout(left_s)
        read = super().readinto(buffer)
        self._left -= read or 0
        if self._left < 0:
            raise ConnectionAbortedError(f"a request of more than {LONGEST_REQUEST} bytes")
        return read


def bounded(connection: socket.socket) -> io.BufferedReader:
    """Return what is read of a connection, bounded in time and size."""
    return io.BufferedReader(Bounded(connection))

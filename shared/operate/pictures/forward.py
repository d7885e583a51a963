"""Viewers' connections, passed on to Rerun's server: its ports are open before it runs, and a viewer has it started."""

import socket
import threading
import time
from contextlib import suppress

from operate.pictures.viewer_address import LOOPBACK

MOST = 64
"""Connections at a time, two threads each; further ones wait (estimate: a browser has six)."""
PART_BYTES = 256 * 1024


class Forward:
    """Passes on what connects to `listener`, to `port` of this machine."""

    def __init__(self, listener: socket.socket, port: int) -> None:
        self._listener, self._port = listener, port
        self._room, self._lock = threading.BoundedSemaphore(MOST), threading.Lock()
        self._connected, self._left = 0, time.monotonic()
        threading.Thread(target=self._serve, daemon=True).start()

    @property
    def quiet_s(self) -> float:
        """Time since the last viewer left [s]; 0 while one is connected."""
        with self._lock:
            return 0.0 if self._connected else time.monotonic() - self._left

    def _serve(self) -> None:
        while True:
            self._room.acquire()
            viewer, _ = self._listener.accept()
            self._count(1)
            threading.Thread(target=self._join, args=(viewer,), daemon=True).start()

    def _count(self, more: int) -> None:
        with self._lock:
            self._connected += more
            self._left = time.monotonic()

    def _join(self, viewer: socket.socket) -> None:
        """Pass on what either side says until one of them ends the connection."""
        with suppress(OSError), viewer, socket.create_connection((LOOPBACK, self._port)) as server:
            back = threading.Thread(target=_pass, args=(server, viewer), daemon=True)
            back.start()
            _pass(viewer, server)
            back.join()
        self._count(-1)
        self._room.release()


def _pass(source: socket.socket, sink: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(PART_BYTES):
            sink.sendall(data)
    for end in (source, sink):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)

"""Server-sent events that tell browsers of changes; the newest wins, so that a slow reader costs no memory."""

import asyncio
from collections.abc import AsyncIterator

BEAT_S = 3.0
"""Between two beats when nothing changes: a browser that misses three says that it has lost the page (page.js)."""
MOST = 24
"""Streams; another one ends the oldest (estimate: some browsers with some tabs)."""


class Streams:
    """The newest content of each channel, and who listens. For one event loop."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[int, bytes]] = {}
        self._count = 0
        self._listeners: dict[asyncio.Event, None] = {}
        self._ended: set[asyncio.Event] = set()
        self.closed = False

    def tell(self, channel: str, event: str, data: bytes) -> None:
        """Tell all listeners of a channel; `data` has no line ends."""
        if self._newest.get(channel, (0, b""))[1] == (line := sse(event, data)):
            return
        self._count += 1
        self._newest[channel] = (self._count, line)
        self._wake()

    def close(self) -> None:
        """End all streams with a word, so that browsers come back at once."""
        self.closed = True
        self._wake()

    async def listen(self, *channels: str) -> AsyncIterator[bytes]:
        """Yield what is new, as long as somebody listens."""
        woken, told = asyncio.Event(), dict.fromkeys(channels, 0)
        self._listeners[woken] = None
        if len(self._listeners) > MOST:
            oldest = next(iter(self._listeners))
            del self._listeners[oldest]  # it ends later: of many that come at once each must end another one
            self._ended.add(oldest)
            oldest.set()
        try:
            yield b"retry: 1000\n\n"
            while not (self.closed or woken in self._ended):
                woken.clear()
                for channel in channels:
                    number, line = self._newest.get(channel, (0, b""))
                    if number > told[channel]:
                        told[channel] = number
                        yield line
                try:
                    async with asyncio.timeout(BEAT_S):
                        await woken.wait()
                except TimeoutError:
                    yield sse("beat", b"")
            yield sse("bye", b"")
        finally:
            self._listeners.pop(woken, None)
            self._ended.discard(woken)

    def _wake(self) -> None:
        for one in self._listeners:
            one.set()


def sse(event: str, data: bytes) -> bytes:
    """Return an event as it is written."""
    return b"event: " + event.encode() + b"\ndata: " + data + b"\n\n"

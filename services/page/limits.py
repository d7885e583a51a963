"""Bounds on connections that uvicorn has not: no head, no body and no reader keeps a place for long.

h11 bounds a head only while it is not whole: one that comes in one piece may be as long as the piece. uvicorn waits for
ever for a head that does not end, and for a client that does not read. All of this is ended here. The figures are
estimates for browsers of this machine, which take milliseconds.
"""

import asyncio
import re
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

LOOK_S = 3.0
"""Between two looks at a connection without a request; the second one that finds it so ends it."""
READS_S = 5.0
"""Longest that what was written may lie unread."""
MOST = 128
"""Connections; beyond that the oldest without a request goes. 24 streams and a few requests of each browser."""
HEAD_BYTES = 8192
"""Of a request before its body, up to the blank line; a browser's has 1000."""
_END = re.compile(rb"\n\r?\n")


class BoundedProtocol(H11Protocol):
    """HTTP/1.1 with these bounds."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection; where there are too many, the oldest without a request goes."""
        super().connection_made(transport)
        self._idle = 0
        self._unread: asyncio.TimerHandle | None = None
        self._since = self.loop.time()
        self._look: asyncio.TimerHandle | None = self.loop.call_later(LOOK_S, self._looked)
        if len(self.connections) <= MOST:
            return
        # Those that are ended leave `connections` later: of many that come at once each must end another one.
        there = [one for one in self.connections if isinstance(one, BoundedProtocol) and not one.transport.is_closing()]
        idle = [one for one in there if one.idle] if len(there) > MOST else []
        if idle:
            min(idle, key=lambda one: one._since).transport.abort()

    def handle_events(self) -> None:
        """Serve what has come; a head that is too long is refused, also one behind another request."""
        waiting, _ = self.conn.trailing_data
        end = _END.search(waiting)
        if self.conn.their_state is h11.IDLE and (end.end() if end else len(waiting)) > HEAD_BYTES:
            self.send_400_response(f"the head of a request has at most {HEAD_BYTES} bytes")
        else:
            super().handle_events()

    def _should_upgrade(self) -> bool:
        """To nothing: a request for it is refused by services.page.guard, and not worth a warning in the log."""
        return False

    @property
    def idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or bool(self.cycle.response_complete)

    def _looked(self) -> None:
        self._idle = self._idle + 1 if self.idle else 0
        if self._idle >= 2:
            self.transport.abort()
        else:
            self._look = self.loop.call_later(LOOK_S, self._looked)

    def pause_writing(self) -> None:
        """Begin to count: what is not read in time ends the connection."""
        super().pause_writing()
        self._unread = self.loop.call_later(READS_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: it was read."""
        super().resume_writing()
        self._read()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        super().connection_lost(exc)
        self._read()
        if self._look is not None:
            self._look.cancel()

    def _read(self) -> None:
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None


def settings() -> dict[str, Any]:
    """Return the arguments of uvicorn.Config that go with it."""
    return {"http": BoundedProtocol, "ws": "none", "h11_max_incomplete_event_size": HEAD_BYTES, "timeout_keep_alive": 5}

"""Follows hi in a thread of its own, and gives what it tells to the page's loop; hi may be away, and come back."""

import threading
from collections.abc import Callable

from companion.loopback import Hi, HiError
from companion.run_files import HiEvent, Tasks

WAIT_S = 10.0
"""hi holds the answer so long, until there is something to tell; what only a file tells is seen by the page itself."""
AGAIN_S = 0.5
MOST_NEWS = 60


class Following:
    """Calls `told(tasks, news)` after each change, `told(None, ())` when hi has gone; from its own thread."""

    def __init__(self, hi: Hi, told: Callable[[Tasks | None, tuple[HiEvent, ...]], None]) -> None:
        self._hi, self._told = hi, told
        self._over = threading.Event()
        self._news: tuple[HiEvent, ...] = ()
        self._thread = threading.Thread(target=self._serve, name="following", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End soon: a wait for hi is not cut short, and holds no process."""
        self._over.set()

    def _serve(self) -> None:
        since, wait_s = 0, 0.0
        while not self._over.is_set():
            try:
                events = self._hi.events(since, wait_s)
                self._news = (*self._news, *events.events)[-MOST_NEWS:]
                self._told(self._hi.told(), self._news)
                since, wait_s = events.next, WAIT_S
            except HiError:
                self._told(None, self._news)
                self._over.wait(AGAIN_S)
                wait_s = 0.0  # to tell at once that it is back

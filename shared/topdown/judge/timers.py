"""Calls due at given times. No clock: the caller passes the time."""

import heapq
from collections.abc import Callable
from itertools import count


class Timers:
    """Calls, in the order of their times; of equal times in the order they were asked for."""

    def __init__(self) -> None:
        self._waiting: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = count()

    def later(self, at: float, then: Callable[[float], None]) -> None:
        """Have `then(at)` called once it is `at` [s]."""
        heapq.heappush(self._waiting, (at, next(self._order), then))

    def run(self, now: float) -> None:
        """It is `now` [s]: call what is due."""
        while self._waiting and self._waiting[0][0] <= now:
            at, _, then = heapq.heappop(self._waiting)
            then(at)

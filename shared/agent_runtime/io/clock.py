"""The clock of an agent: the wall time at which the process started, and from there the time that
really passed.

A wall clock may be set: back, and everything that is due waits for the hours to come again;
forward, and every deadline is over at once. This one does neither while the process lives. A
restart begins with the wall time of then: deadlines in the journal are absolute, so one that was
set before the clock was moved is off by that once.
"""

import time
from collections.abc import Callable


class Clock:
    """`now`: unix seconds, even. `wall`, `steady`: the clocks of the system."""

    def __init__(
        self, wall: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._steady = steady
        self._offset = wall() - steady()

    def now(self) -> float:
        """The time [unix s]; it never goes back."""
        return self._offset + self._steady()


now = Clock().now
"""The time of this process [unix s]."""

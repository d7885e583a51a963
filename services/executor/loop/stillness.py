"""Whether a simulated world stands still: then its cycles need not be computed.

From 2 s after its last motion on, a robot at rest under its control moves by 5e-10 rad in half a second (canonical
scene, measured 2026-11-27). Whenever the next command comes, such a world is where it would be. What creeps, topples or
has noise in its joints moves by far more, and is computed.
"""

from typing import Protocol, runtime_checkable

import numpy as np

from services.executor.loop.core import LoopCore

WINDOW = 250  # cycles, 0.5 s; estimate
STILL = 1e-7  # rad or m, by which nothing moves in a window; estimate: 200 times what was measured


@runtime_checkable
class Restable(Protocol):
    """A back-end whose time can pass without steps."""

    def pass_time(self, periods: int) -> None:
        """Let as many periods of 2 ms pass in which nothing moves; the caller knows that nothing would."""
        ...


class Stillness:
    """Watches the coordinates of a world over windows of cycles; `reached` tells whether it stands still."""

    def __init__(self, core: LoopCore, world: Restable) -> None:
        self._core, self._world = core, world
        self.restart()

    def restart(self) -> None:
        """Compute the world: something new is asked of the robot or happens to it."""
        self.reached, self._cycles = False, 0
        self._before = self._core.backend.configuration().copy()

    def computed(self) -> None:
        """Count a cycle that was computed; compare the world at the end of a window with that at its beginning."""
        self._cycles += 1
        if self._cycles == WINDOW:
            now = self._core.backend.configuration()
            still = bool(np.abs(now - self._before).max() <= STILL)
            self.restart()
            self.reached = still and not self._core.busy

    def rest(self, periods: int) -> None:
        """Let periods pass without computing them."""
        self._world.pass_time(periods)
        self._core.cycles += periods

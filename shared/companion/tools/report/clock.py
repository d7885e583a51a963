"""The simulation's clock, read off the robot's telemetry: what simulated time it was when something
was heard.
"""

import numpy as np

from companion.tools.telemetry import robot, truth
from operate.recording.history import History

LOOSE_S = 1.0
"""Further than this from any telemetry a simulated time is a guess, and not given; telemetry comes
at 20 Hz.
"""


class Clock:
    """Simulated seconds by unix seconds."""

    def __init__(self, history: History) -> None:
        pairs = [(at, state.sim_time_s) for at, state in robot(history)] or [
            (at, t.time_s) for at, t in truth(history)
        ]
        self._wall = np.array([at for at, _ in pairs])
        self._sim = np.array([sim for _, sim in pairs])

    def sim(self, wall: float) -> float | None:
        """Simulated time at `wall`; None where nothing says."""
        if not len(self._wall) or np.abs(self._wall - wall).min() > LOOSE_S:
            return None
        return float(np.interp(wall, self._wall, self._sim))

    def spent(self, spans: list[tuple[float, float]]) -> float | None:
        """Simulated time in the union of spans of wall time; None where a span's end is not
        known.
        """
        total, until = 0.0, -np.inf
        for start, end in sorted(spans):
            a, b = self.sim(max(start, until)), self.sim(end)
            if a is None or b is None:
                return None
            total += max(0.0, b - a)
            until = max(until, end)
        return total

"""A timed trajectory followed at a rate that may fall to zero: position and velocity set-points for each cycle.

Between knots the position is linear and the velocity is the central difference. The first knots are blended with the
set-point before, so that set-points never jump.
"""

import numpy as np
from numpy.typing import NDArray

from companion.skills.loop_messages import KNOT_S
from velma.errors import MotionError
from velma.names import BODY

Array = NDArray[np.float64]

BRAKE_S = 0.3  # time in which a motion comes to rest along its path, or starts again; estimate: 0.35 m/s over 5 cm
BLEND_S = 0.3
FARTHEST_START = 0.05  # rad: the largest difference that is blended; a hand is then at most 4 cm beside its path


class Track:
    """The set-points of the body over time."""

    def __init__(self, knots: Array, told: Array) -> None:
        """Raise MotionError if the knots (n, 15) do not start near `told` (15,), the last set-point."""
        self._knots, self._offset = knots, told - knots[0]
        worst = int(np.argmax(np.abs(self._offset)))
        if not abs(self._offset[worst]) <= FARTHEST_START:
            found = f"{abs(self._offset[worst]):.3f} rad from the set-point in {BODY[worst]}"
            raise MotionError("first knot", found, f"within {FARTHEST_START} rad: start at the reported set-point")
        self.duration = (len(knots) - 1) * KNOT_S
        self._time, self._since, self._rate, self._wanted, self._braked = 0.0, 0.0, 1.0, 1.0, False
        self.q, self.v = told.copy(), np.zeros_like(told)

    @property
    def ended(self) -> bool:
        """Whether it rests for good: at its last knot, or where it was braked."""
        at_end = self._time >= self.duration and not self._offset.any()
        return at_end or (self._braked and self._rate == 0.0)

    def brake(self) -> None:
        """Come to rest along the path, for good."""
        self._braked, self._wanted = True, 0.0

    def pause(self) -> None:
        """Come to rest along the path, until `resume`."""
        self._wanted = 0.0

    def resume(self) -> None:
        """Go on from where it was paused. No effect on a braked track."""
        self._wanted = 0.0 if self._braked else 1.0

    def advance(self, dt: float) -> None:
        """Advance by dt [s]; `q` and `v` (15,) are the new set-points."""
        if self._rate != self._wanted:
            change = dt / BRAKE_S
            self._rate = min(max(self._wanted, self._rate - change), self._rate + change)
        self._time = min(self.duration, self._time + self._rate * dt)
        self._since += self._rate * dt
        self._sample()
        if self._offset.any():
            self._blend()

    def _sample(self) -> None:
        knots, last = self._knots, len(self._knots) - 1
        k = min(int(self._time / KNOT_S), last)
        u = self._time / KNOT_S - k
        a, b = knots[k], knots[min(k + 1, last)]
        self.q = a + u * (b - a)
        if self._time >= self.duration:
            self.v = np.zeros_like(a)
            return
        before, after = knots[max(k - 1, 0)], knots[min(k + 2, last)]
        # One-sided at the ends, where the trajectory is at rest anyway.
        v = (1 - u) * (b - before) + u * (after - a)
        self.v = v * (self._rate / (2 * KNOT_S))

    def _blend(self) -> None:
        s = self._since / BLEND_S
        if s >= 1.0:
            self._offset = np.zeros_like(self._offset)
            return
        left = 1.0 - s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
        self.q = self.q + left * self._offset
        self.v = self.v - (30.0 * s * s * (1.0 - s) ** 2 / BLEND_S * self._rate) * self._offset

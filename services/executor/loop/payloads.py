"""The loads of the hands that the loop feeds forward; a new load is taken up gradually."""

import numpy as np
from numpy.typing import NDArray

from companion.skills.loop_messages import Payload
from velma.errors import MotionError
from velma.ranges import MOST_KG, MOST_LEVER_M

Array = NDArray[np.float64]

# kg/s. Velma takes a weight up within 1000 cycles; a bowl of 0.3 kg here in 0.2 s, so that it is lifted at once but not
# thrown. Estimate.
RATE = 1.5


class Payloads:
    """Masses (2,) kg and levers (2, 3) m in the grip frames; rows right, left."""

    def __init__(self) -> None:
        self.mass, self.lever = np.zeros(2), np.zeros((2, 3))
        self._goal = np.zeros(2)

    def take(self, row: int, payload: Payload | None) -> None:
        """Set the load of a hand; None: no change. An emptied hand keeps its lever until its mass is 0."""
        if payload is None:
            return
        self._goal[row] = payload.mass
        if payload.mass:
            self.lever[row] = payload.lever

    def advance(self, dt: float) -> None:
        """Advance by dt [s]."""
        if self.mass.tolist() != self._goal.tolist():
            step = RATE * dt
            if not (_sane(self._goal).all() and _sane(self.mass).all()):
                found = f"{self.mass} kg on the way to {self._goal}"
                self.mend()
                raise MotionError("payload", found, f"from 0 to {MOST_KG:g} kg")
            self.mass += np.clip(self._goal - self.mass, -step, step)

    def mend(self) -> None:
        """Have possible numbers: a mass that is none becomes its goal, a goal that is none what is carried now."""
        self._goal = np.where(_sane(self._goal), self._goal, np.where(_sane(self.mass), self.mass, 0.0))
        self.mass = np.where(_sane(self.mass), self.mass, self._goal)
        self.lever = np.where(np.abs(self.lever) <= MOST_LEVER_M, self.lever, 0.0)


def _sane(mass: Array) -> Array:
    return np.asarray((mass >= 0.0) & (mass <= MOST_KG))

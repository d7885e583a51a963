"""A third robot for the executor, written from docs/back-ends.md: fifteen point masses behind
encoders.

It has no geometry and no contacts. What it shows is the face: arrays made once, torques beyond
gravity, ends that stop, readings as encoders give them (steps of 0.1 mrad, speeds filtered over a
few cycles). Every number is an estimate.

    python -m pytest -p services.executor.conformance --backend point_mass:make
"""

import numpy as np

from velma.names import (
    DISTAL_UPPER,
    FINGER_UPPER,
    HEAD_LOWER,
    HEAD_UPPER,
    LOWER,
    SPREAD_UPPER,
    START,
    TORQUE,
    UPPER,
)
from velma.sim.backend import PERIOD_S, Array, Command, State, at_rest

INERTIA = TORQUE / 25.0  # kg m2: the largest torque accelerates by 25 rad/s2
FRICTION = 2.0 * INERTIA  # Nms/rad
STEP = 1e-4  # rad, of an encoder
FILTER = 0.5  # what a cycle's difference of positions adds to the speed that is told
SERVO_SPEED = 3.0  # rad/s, of head and fingers
RANGES = {"spread": SPREAD_UPPER, "proximal": FINGER_UPPER, "distal": DISTAL_UPPER}


class PointMasses:
    """Velma without a body."""

    period_s = PERIOD_S

    def __init__(self) -> None:
        self._state = at_rest()
        self._q, self._v = START.copy(), np.zeros(15)
        self._work = 0.0

    def observe(self) -> State:
        """Return the last state told by the encoders."""
        return self._state

    def step(self, command: Command) -> None:
        """The true masses move; then they are measured."""
        self._move(command.tau)
        self._measure()
        np.copyto(
            self._state.head,
            self._servo(self._state.head, np.clip(command.head, HEAD_LOWER, HEAD_UPPER)),
        )
        free = command.locked < 0.5
        for name, upper in RANGES.items():
            now, told = getattr(self._state, name), np.clip(getattr(command, name), 0.0, upper)
            now[free] = self._servo(now, told)[free]
        self._state.time += self.period_s

    def _move(self, tau: Array) -> None:
        self._v += self.period_s * (tau - FRICTION * self._v) / INERTIA
        self._q += self.period_s * self._v
        self._v[(self._q < LOWER) | (self._q > UPPER)] = 0.0
        np.clip(self._q, LOWER, UPPER, out=self._q)
        self._work += float(np.abs(tau * self._v).sum()) * self.period_s

    def _measure(self) -> None:
        told = np.round(self._q / STEP) * STEP
        self._state.v += FILTER * ((told - self._state.q) / self.period_s - self._state.v)
        np.copyto(self._state.q, told)

    def _servo(self, now: Array, told: Array) -> Array:
        reach = SERVO_SPEED * self.period_s
        return np.asarray(now + np.clip(told - now, -reach, reach))

    def configuration(self) -> Array:
        """There is no world model."""
        return np.zeros(0)

    @property
    def work_J(self) -> float:
        """Work of the body joints so far, J."""
        return self._work


def make() -> PointMasses:
    """A robot at rest."""
    return PointMasses()

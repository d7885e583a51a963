"""A mock Velma without MuJoCo: joints with heavy friction. For tests of everything but physics."""

import numpy as np

from velma.names import (
    DISTAL_UPPER,
    FINGER_SPEED,
    FINGER_UPPER,
    HEAD_LOWER,
    HEAD_UPPER,
    LOWER,
    SPEED,
    SPREAD_UPPER,
    UPPER,
)
from velma.sim.backend import PERIOD_S, Array, Command, State, at_rest

# A light joint with heavy friction: it creeps when pushed and stops at once. Per joint, kg m2 and
# Nms/rad.
INERTIA, FRICTION = 1.0, 20.0


class MockBackend:
    """Fifteen separate joints, each I dv/dt = tau - d v, with hard ends. The head follows its
    target at once, the fingers at a finite speed within their ranges.

    `grasped[row]`: finger angle [rad] at which the fingers of a row meet an object (None: no
    object). They stop there, and the servo error grows.
    """

    period_s = PERIOD_S

    def __init__(self) -> None:
        self._state = at_rest()
        self._work = 0.0
        self.grasped: list[float | None] = [None, None]

    def observe(self) -> State:
        """Return the state."""
        return self._state

    def step(self, command: Command) -> None:
        """Take the command and let 2 ms pass."""
        state, dt = self._state, PERIOD_S
        # Implicit in the friction, so that the mock stays stable at gains at which a real robot is.
        state.v[:] = (state.v + dt * command.tau / INERTIA) / (1 + dt * FRICTION / INERTIA)
        np.clip(state.v, -SPEED, SPEED, out=state.v)
        state.q += dt * state.v
        state.v[(state.q < LOWER) | (state.q > UPPER)] = 0.0
        np.clip(state.q, LOWER, UPPER, out=state.q)
        self._work += float(np.abs(command.tau * state.v).sum()) * dt
        np.clip(command.head, HEAD_LOWER, HEAD_UPPER, out=state.head)
        step = FINGER_SPEED * dt
        for row, stop in enumerate(self.grasped):
            if command.locked[row]:
                continue
            spread = np.clip(command.spread[row], 0.0, SPREAD_UPPER)
            state.spread[row] += np.clip(spread - state.spread[row], -step, step)
            end = np.clip(command.proximal[row], 0.0, FINGER_UPPER if stop is None else stop)
            state.proximal[row] += np.clip(end - state.proximal[row], -step, step)
            bent = np.clip(command.distal[row], 0.0, DISTAL_UPPER if stop is None else stop / 3.0)
            state.distal[row] += np.clip(bent - state.distal[row], -step, step)
        state.time += dt

    def configuration(self) -> Array:
        """Return an empty array: there is no world model."""
        return np.zeros(0)

    @property
    def work_J(self) -> float:
        """Work of the body joints so far, J."""
        return self._work

"""A pretended Velma without MuJoCo: joints that obey at once. For tests of everything but physics."""

import numpy as np

from velma.names import SPEED
from velma.sim.backend import PERIOD_S, Array, Command, State, at_rest

# A light joint with much friction: it creeps where it is pushed and stops at once. Per joint, kg m2 and Nms/rad.
INERTIA, FRICTION = 1.0, 20.0
FINGER_SPEED = 3.27  # rad/s, BHR


class MockBackend:
    """Fifteen separate joints, each I dv/dt = tau - d v; head and fingers go where they are told at a finite speed.

    `grasped[row]` says at which finger angle a row's fingers meet something (None: nothing there): they stop, and the
    servo's error grows as it does against an object.
    """

    period_s = PERIOD_S

    def __init__(self) -> None:
        self._state = at_rest()
        self._work = 0.0
        self.grasped: list[float | None] = [None, None]

    def observe(self) -> State:
        """The state now."""
        return self._state

    def step(self, command: Command) -> None:
        """Let 2 ms pass."""
        state, dt = self._state, PERIOD_S
        # Implicit in the friction, so that no gain of the controller makes this toy unstable before the true robot is.
        state.v[:] = (state.v + dt * command.tau / INERTIA) / (1 + dt * FRICTION / INERTIA)
        np.clip(state.v, -SPEED, SPEED, out=state.v)
        state.q += dt * state.v
        self._work += float(np.abs(command.tau * state.v).sum()) * dt
        state.head[:] = command.head
        step = FINGER_SPEED * dt
        for row, stop in enumerate(self.grasped):
            if command.locked[row]:
                continue
            state.spread[row] += np.clip(command.spread[row] - state.spread[row], -step, step)
            end = command.proximal[row] if stop is None else np.minimum(command.proximal[row], stop)
            state.proximal[row] += np.clip(end - state.proximal[row], -step, step)
            bent = command.distal[row] if stop is None else np.minimum(command.distal[row], stop / 3.0)
            state.distal[row] += np.clip(bent - state.distal[row], -step, step)
        state.time += dt

    def configuration(self) -> Array:
        """There is no world model."""
        return np.zeros(0)

    @property
    def work_J(self) -> float:
        """Work of the body joints so far, J."""
        return self._work

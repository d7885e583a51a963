"""Back-ends that are wrong on purpose, one mistake each; the kit must find each by the check that
is meant for it.
"""

import time
from collections import deque

import msgspec
import numpy as np

from velma.sim.mock_backend import MockBackend

DEG = 180.0 / np.pi


class Told(MockBackend):
    """Tells something else than it measures: `tell` changes a copy of the state."""

    def observe(self):
        state = super().observe()
        names = ("q", "v", "head", "spread", "proximal", "distal")
        copy = msgspec.structs.replace(
            state, **{name: getattr(state, name).copy() for name in names}
        )
        return self.tell(copy)


class Stale(Told):
    """Readings of six cycles ago."""

    def __init__(self):
        super().__init__()
        self.old = deque(maxlen=7)

    def step(self, command):
        super().step(command)
        state = super(Told, self).observe()
        self.old.append((state.q.copy(), state.v.copy()))

    def tell(self, state):
        if self.old:
            state.q[:], state.v[:] = self.old[0]
        return state


class Frozen(Told):
    """Positions of the beginning."""

    def tell(self, state):
        self.first = getattr(self, "first", state.q.copy())
        state.q[:] = self.first
        return state


class InDegrees(Told):
    """Positions in degrees."""

    def tell(self, state):
        state.q *= DEG
        return state


class SpeedInDegrees(Told):
    """Speeds in degrees per second."""

    def tell(self, state):
        state.v *= DEG
        return state


class SpeedTurned(Told):
    """Speeds of the wrong sign."""

    def tell(self, state):
        state.v *= -1.0
        return state


class TorqueTurned(MockBackend):
    """One drive counts the other way."""

    def step(self, command):
        command.tau[4] *= -1.0
        super().step(command)
        command.tau[4] *= -1.0


class ArmsSwapped(MockBackend):
    """The right arm's torques go to the left one."""

    def step(self, command):
        command.tau[1:] = np.roll(command.tau[1:], 7)
        super().step(command)
        command.tau[1:] = np.roll(command.tau[1:], 7)


class NoNumber(Told):
    """A sensor that drops out once."""

    def tell(self, state):
        if 0.5 < state.time < 0.51:
            state.v[6] = np.nan
        return state


class Endless(MockBackend):
    """Joints without ends."""

    def step(self, command):
        before = self._state.q.copy()
        super().step(command)
        self._state.q[:] = before + self.period_s * np.where(
            self._state.v == 0.0, np.sign(command.tau), self._state.v
        )


class EndlessFingers(MockBackend):
    """Fingers that go wherever they are told."""

    def step(self, command):
        super().step(command)
        self._state.proximal[:] = command.proximal


class Latched(MockBackend):
    """A drive that keeps the largest torque it was given."""

    def __init__(self):
        super().__init__()
        self.largest = np.zeros(15)

    def step(self, command):
        self.largest = np.where(
            np.abs(command.tau) > np.abs(self.largest), command.tau, self.largest
        )
        super().step(msgspec.structs.replace(command, tau=self.largest))


class Coasting(MockBackend):
    """Drives that let go when they are told less: nothing brakes."""

    def step(self, command):
        against = command.tau * self._state.v < 0
        speed = self._state.v.copy()
        super().step(msgspec.structs.replace(command, tau=np.where(against, 0.0, command.tau)))
        self._state.v[:] = np.where(against, speed, self._state.v)


class Sinking(MockBackend):
    """Gravity is not held."""

    def step(self, command):
        super().step(msgspec.structs.replace(command, tau=command.tau + 3.0))


class TimeGoesBack(MockBackend):
    """A clock that is set once."""

    def step(self, command):
        super().step(command)
        if abs(self._state.time - 0.3) < 1e-9:
            self._state.time -= 0.1


class TimeInMilliseconds(MockBackend):
    """Ticks instead of seconds."""

    def step(self, command):
        super().step(command)
        self._state.time += 1.0 - self.period_s


class HalfAPeriod(MockBackend):
    """Steps 1 ms and says so."""

    period_s = 0.001


class LookingTakesTime(MockBackend):
    """Every look lets a period pass."""

    def observe(self):
        self._state.time += self.period_s
        return super().observe()


class Hanging(MockBackend):
    """A step that waits for an answer that does not come."""

    def step(self, command):
        super().step(command)
        if self._state.time > 0.2:
            time.sleep(1.5)


class Slow(MockBackend):
    """Sleeps for a period by itself."""

    def step(self, command):
        super().step(command)
        time.sleep(self.period_s)


class Growing(MockBackend):
    """Keeps a history."""

    def __init__(self):
        super().__init__()
        self.history = []

    def step(self, command):
        super().step(command)
        self.history.append(self._state.q.copy())


class SinglePrecision(Told):
    """Readings as the wire has them."""

    def tell(self, state):
        state.q = state.q.astype(np.float32)
        return state


class HandsSwapped(Told):
    """Rows left, right."""

    def tell(self, state):
        state.proximal = state.proximal[::-1].copy()
        return state


class HeadSwapped(Told):
    """Tilt before pan."""

    def tell(self, state):
        state.head = state.head[::-1].copy()
        return state


class LooseLocks(MockBackend):
    """Locked fingers go on."""

    def step(self, command):
        super().step(msgspec.structs.replace(command, locked=np.zeros(2)))


class WorkGivenBack(MockBackend):
    """Braking is taken off the bill."""

    def step(self, command):
        super().step(command)
        self._work += 2 * self.period_s * min(0.0, float((command.tau * self._state.v).sum()))


class WideWorld(MockBackend):
    """Tells more coordinates than the slot has room for."""

    def configuration(self):
        return np.zeros(5000)


class ChangingWorld(MockBackend):
    """A world model that gets a thing more each second."""

    def configuration(self):
        return np.zeros(int(self._state.time))


class Unforgiving(MockBackend):
    """After one drive failure it never answers again, and says old things."""

    def step(self, command):
        if (np.abs(command.tau) > 0).any() and self._state.time > 0.4:
            raise ConnectionError("the drives are gone")
        super().step(command)

"""The back-end under test, and a bench that moves it: one cycle after the other, in real time if it
needs that.
"""

import functools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import msgspec
import numpy as np

from services.executor.loop.core import LoopCore
from services.executor.loop.link import Slot
from services.executor.loop.process import LoopProcess, Pacer
from velma.control import safety
from velma.control.dynamics import Dynamics
from velma.model.tree import ROBOT_XML
from velma.names import TORQUE, Array
from velma.sim.backend import Backend, State, no_command


class Subject(msgspec.Struct, frozen=True):
    """The back-end under test. `make` returns a new back-end, at rest, hands empty; its `close()`
    is called if it has one.

    `paced`: it lives in real time, so a step is taken every `period_s`. `gentle`: nothing is pushed
    to its end. `push`: share of the accepted torque with which a joint is moved. The last four are
    the loop around it.
    """

    make: Callable[[], Backend]
    paced: bool = False
    gentle: bool = False
    push: float = 0.1
    core: Callable[..., LoopCore] = LoopCore
    process: Callable[..., LoopProcess] = LoopProcess
    pacer: Callable[..., Pacer] = Pacer
    slot: Callable[[memoryview], Slot] = Slot


class Bench:
    """A back-end with one command, which at first holds the robot as it is."""

    def __init__(self, backend: Backend, subject: Subject) -> None:
        self.backend, self.subject, self.command = backend, subject, no_command()
        self._next = 0.0
        state = backend.observe()
        for name in ("head", "spread", "proximal", "distal"):
            getattr(self.command, name)[:] = getattr(state, name)

    def step(self) -> State:
        """Run one cycle; return the state after it, which the next one overwrites."""
        if self.subject.paced:
            self._next = max(
                self._next + self.backend.period_s, time.monotonic() - self.backend.period_s
            )
            time.sleep(max(0.0, self._next - time.monotonic()))
        self.backend.step(self.command)
        return self.backend.observe()

    def steps(self, seconds: float) -> Iterator[State]:
        """Run cycles for this time [s]; yield the state after each."""
        for _ in range(round(seconds / self.backend.period_s)):
            yield self.step()

    def push(self, joint: int, seconds: float, sign: float = 1.0) -> Iterator[State]:
        """Push one body joint and no other."""
        self.command.tau[:] = 0.0
        self.command.tau[joint] = sign * self.subject.push * TORQUE[joint]
        yield from self.steps(seconds)

    def wave(self, seconds: float) -> Iterator[State]:
        """Move all body joints back and forth, twice a second."""
        for k in range(round(seconds / self.backend.period_s)):
            self.command.tau[:] = (
                self.subject.push * TORQUE * np.sin(4 * np.pi * k * self.backend.period_s)
            )
            yield self.step()

    def calm(self, seconds: float = 0.4) -> None:
        """Brake all body joints by viscous damping, then release the torque."""
        for state in self.steps(seconds):
            self.command.tau[:] = safety.damping_torque(state.v)
        self.command.tau[:] = 0.0

    def towards(self, name: str, goal: Array, speed: float, settle_s: float = 0.5) -> State:
        """Move a servo's targets to a goal at a speed [rad/s], as the loop does."""
        target = getattr(self.command, name)
        reach = speed * self.backend.period_s
        while np.abs(goal - target).max() > 1e-9:
            target += np.clip(goal - target, -reach, reach)
            state = self.step()
        for state in self.steps(settle_s):  # noqa: B007  (the last one counts)
            pass
        return state


@contextmanager
def bench(subject: Subject) -> Iterator[Bench]:
    """Yield a new back-end on the bench; close it at the end."""
    backend = subject.make()
    try:
        yield Bench(backend, subject)
    finally:
        close = getattr(backend, "close", None)
        if close is not None:
            close()


@functools.cache
def dynamics() -> Dynamics:
    """Return the model that the control laws use; made once."""
    return Dynamics(ROBOT_XML)

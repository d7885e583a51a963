"""The doubles of these tests: a robot, which is MockBackend with hooks where a test changes it, and
the agent to which a device posts.
"""

import threading
import time
from collections.abc import Callable
from queue import Queue
from typing import Any, NoReturn

import msgspec
import numpy as np

from velma.sim.backend import Array, Command, State
from velma.sim.mock_backend import MockBackend

ARRAYS = ("q", "v", "head", "spread", "proximal", "distal")


def copied(state: State) -> State:
    """The same state with arrays of its own."""
    arrays = {name: getattr(state, name).copy() for name in ARRAYS}
    return msgspec.structs.replace(state, **arrays)


class RobotDouble(MockBackend):
    """`observed` makes what is told of a copy of the state, `asked` what the drives are told of a
    command; `moved` is called after a step, with the state before. They get the double first, may
    raise, and may be set at any time. `taus`: the torques that were asked for.
    """

    def __init__(
        self,
        observed: Callable[["RobotDouble", State], State] | None = None,
        asked: Callable[["RobotDouble", Command], Command] | None = None,
        moved: Callable[["RobotDouble", State, Command], object] | None = None,
    ) -> None:
        super().__init__()
        self.observed, self.asked, self.moved = observed, asked, moved
        self.taus: list[Array] = []

    def observe(self) -> State:
        state = super().observe()
        return state if self.observed is None else self.observed(self, copied(state))

    def step(self, command: Command) -> None:
        self.taus.append(command.tau.copy())
        if self.asked is not None:
            command = self.asked(self, command)
        before = copied(self._state)
        super().step(command)
        if self.moved is not None:
            self.moved(self, before, command)


def throws(_: RobotDouble, __: Any) -> NoReturn:
    """A hook: the sensors or the drives are gone."""
    raise RuntimeError("the bus is gone")


def reading(name: str, joint: int, value: float) -> Callable[[RobotDouble, State], State]:
    """A hook for `observed`: the reading of one joint is this value."""

    def tell(_: RobotDouble, state: State) -> State:
        getattr(state, name)[joint] = value
        return state

    return tell


def stays(robot: RobotDouble, before: State, _: Command) -> None:
    """A hook for `moved`: no joint of the body moves."""
    robot._state.q[:], robot._state.v[:] = before.q, 0.0


def all_finite(_: RobotDouble, command: Command) -> Command:
    """A hook for `asked`: a command with what is no number fails the test."""
    assert all(np.isfinite(getattr(command, name)).all() for name in command.__struct_fields__)
    return command


WITHIN_S = 120.0  # a child may have the lowest priority: on a busy machine it starts in a minute


class PostDouble:
    """Takes what a device posts, and what it publishes for people; `heard`: who takes what others
    say to it, by kind.
    """

    def __init__(self) -> None:
        self.words, self.published = Queue[Any](), Queue[tuple[str, bytes]]()
        self.heard: dict[str, Callable[[bytes], None]] = {}

    def __call__(self, content: object, delay_s: float = 0.0) -> None:
        self.words.put(content)

    def publish(self, kind: str, data: bytes, *peer: str) -> None:
        self.published.put((kind, data))

    def hear(self, kind: str, on_data: Callable[[bytes], None]) -> None:
        self.heard[kind] = on_data

    def next(self) -> Any:
        """What is posted next."""
        return self.words.get(timeout=WITHIN_S)


def eventually(there: Callable[[], object], within_s: float = WITHIN_S) -> bool:
    """Whether it is true before long; other threads run meanwhile."""
    end, waiting = time.monotonic() + within_s, threading.Event()
    while not there() and time.monotonic() < end:
        waiting.wait(0.005)
    return bool(there())

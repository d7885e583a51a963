"""The interface of a robot behind the loop: it tells its state, takes a command and steps 2 ms.

The torques of a command are beyond gravity: the drives hold the arms' own weight (the LWR does, and
the torso's axis is vertical), so a robot without torque commands is at rest. The interface is the
same for a simulated, a mock and a real robot. Sides are rows: 0 right, 1 left
(`velma.names.SIDES`).
"""

from typing import Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma.names import START

Array = NDArray[np.float64]

PERIOD_S = 0.002  # VS: the deployed loop and its simulator step 2 ms

# Drive limits of the fingers' proximal joints while closing, Nm. One and two push against three
# alone, so they take about half each (pour runs: equal limits push the jar aside); a distal joint
# takes a third of its proximal one.
PAIR_LIMIT, SINGLE_LIMIT = 0.8, 1.5
DISTAL_SHARE = 1.0 / 3.0


class State(msgspec.Struct):
    """The measured robot. Arrays belong to the back-end and are overwritten by the next
    `observe`.
    """

    time: float  # simulated s
    q: Array  # (15,) body joints, rad
    v: Array  # (15,) rad/s
    head: Array  # (2,) pan, tilt, rad
    spread: Array  # (2,) rad
    proximal: Array  # (2, 3) rad, fingers one, two, three
    distal: Array  # (2, 3) rad
    # (2, 6) N, Nm of the arm on the hand, axes of the sensor; None: no sensor
    wrist: Array | None = None


class Command(msgspec.Struct):
    """Command to the drives for the next step. The loop keeps one and overwrites its arrays."""

    tau: Array  # (15,) Nm beyond gravity
    head: Array  # (2,) rad
    spread: Array  # (2,) rad
    proximal: Array  # (2, 3) rad, targets of the servos
    distal: Array  # (2, 3) rad
    locked: Array  # (2,) 1.0 where the fingers are held by their worm gears


class Backend(Protocol):
    """A robot Velma."""

    period_s: float

    def observe(self) -> State:
        """Return the state."""
        ...

    def step(self, command: Command) -> None:
        """Take the command and let `period_s` pass."""
        ...

    def configuration(self) -> Array:
        """Return all coordinates of the world model, (nq,), for a copy of it; empty if there is
        none.
        """
        ...

    @property
    def work_J(self) -> float:
        """Work of the 15 body joints so far [J]: the integral of |torque x speed|."""
        ...


def at_rest() -> State:
    """Return a state in the start posture with open hands, without wrist sensors."""
    hands = np.zeros((2, 3))
    return State(0.0, START.copy(), np.zeros(15), np.zeros(2), np.zeros(2), hands, hands.copy())


def no_command() -> Command:
    """Return a command without torque, head ahead, hands open and unlocked."""
    return Command(
        np.zeros(15), np.zeros(2), np.zeros(2), np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2)
    )

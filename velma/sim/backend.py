"""What stands behind the loop: a Velma that says its state, takes a command and steps 2 ms.

The torques of a command are beyond gravity: the drives hold the arms' own weight (the LWR does, and the torso's axis
is vertical), so that no command at all is a robot at rest. A simulated, a pretended and a real robot look the same
from here. Sides are rows: 0 right, 1 left (`velma.names.SIDES`).
"""

from typing import Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from velma.names import START

Array = NDArray[np.float64]

PERIOD_S = 0.002  # VS: the deployed loop and its simulator step 2 ms

# Drive limits of the fingers' proximal joints while closing, Nm. One and two push against three alone, so they take
# about half each (pour runs: equal limits push the jar aside); a distal joint takes a third of its proximal one.
PAIR_LIMIT, SINGLE_LIMIT = 0.8, 1.5
DISTAL_SHARE = 1.0 / 3.0


class State(msgspec.Struct):
    """The measured robot. Arrays belong to the back-end and are overwritten by the next `observe`."""

    time: float  # simulated s
    q: Array  # (15,) body joints, rad
    v: Array  # (15,) rad/s
    head: Array  # (2,) pan, tilt, rad
    spread: Array  # (2,) rad
    proximal: Array  # (2, 3) rad, fingers one, two, three
    distal: Array  # (2, 3) rad


class Command(msgspec.Struct):
    """What the drives do during the next step. The loop keeps one and overwrites its arrays."""

    tau: Array  # (15,) Nm beyond gravity
    head: Array  # (2,) rad
    spread: Array  # (2,) rad
    proximal: Array  # (2, 3) rad, targets of the servos
    distal: Array  # (2, 3) rad
    locked: Array  # (2,) 1.0 where the fingers are held by their worm gears


class Backend(Protocol):
    """A Velma."""

    period_s: float

    def observe(self) -> State:
        """The state now."""
        ...

    def step(self, command: Command) -> None:
        """Take the command and let `period_s` pass."""
        ...

    def configuration(self) -> Array:
        """Every coordinate of the world model, for a mirror of it; empty where there is none. Shape (nq,)."""
        ...

    @property
    def work_J(self) -> float:
        """Work of the 15 body joints so far: the integral of |torque x speed|, nothing is taken back. J."""
        ...


def at_rest() -> State:
    """A state in the start posture with open hands."""
    hands = np.zeros((2, 3))
    return State(0.0, START.copy(), np.zeros(15), np.zeros(2), np.zeros(2), hands, hands.copy())


def no_command() -> Command:
    """Torque free, head ahead, hands open and unlocked."""
    return Command(np.zeros(15), np.zeros(2), np.zeros(2), np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2))

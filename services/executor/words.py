"""The words between the agent of ex and its own side: the worker that runs skills, and the loop that moves.

A word names the number of the act it belongs to, so that what a killed worker had said before is not taken for news of
the next act. Nothing here is a communicate, and nothing here leaves the computer.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray

from companion.languages import rc
from services.executor.loop.program import Motion
from services.executor.remembered import Remembered

Array = NDArray[np.float64]


class Felt(msgspec.Struct, frozen=True):
    """The loop's word on the robot: how a motion ended (phase of the loop, "" where there was none), and how it stands.

    `q`, `measured`: set-points and joints (15,) as float64 bytes [rad]. `touched`, `fingers`: per side, which fingers
    touched, mean angle [rad]. `world`: every coordinate of the world model, for the receptor's mirror only.
    """

    q: bytes
    measured: bytes
    head: tuple[float, float]
    time: float
    world: bytes = b""
    ended: str = ""
    reason: str = ""
    touched: dict[str, tuple[bool, bool, bool]] = {}
    fingers: dict[str, float] = {}

    def setpoint(self) -> Array:
        """(15,) [rad]."""
        return np.frombuffer(self.q)


class Word(msgspec.Struct, frozen=True, tag=True):
    """`number` counts acts over all lives of the agent."""

    number: int


# --- to the loop ------------------------------------------------------------------------------------------------------


class Where(Word, frozen=True):
    """How does the robot stand? -> Stands, or Lost at once."""


class Halt(Word, frozen=True):
    """Bring whatever moves to rest, wait for a loop if there is none -> Stands."""


class Do(Word, frozen=True):
    """Carry this motion out -> Moved, or Lost."""

    motion: Motion


class Brake(Word, frozen=True):
    """Bring the motion of this key to rest; its Moved still comes."""

    key: str


# --- to the worker ----------------------------------------------------------------------------------------------------


class Setup(msgspec.Struct, frozen=True):
    """To a new worker: the scene's file ("" for the canonical one), and the seed it is varied by (None: it is not)."""

    scene: str = ""
    seed: int | None = None


class Perform(Word, frozen=True):
    """Run the skill of this command -> Move or Ended."""

    command: rc.Act
    remembered: Remembered
    felt: Felt


class Feel(Word, frozen=True):
    """What came of the motion asked for last -> Move or Ended."""

    felt: Felt


class Drop(Word, frozen=True):
    """Give the act up: the worker is killed."""


# --- from them --------------------------------------------------------------------------------------------------------


class Stands(Word, frozen=True):
    """The robot stands so."""

    felt: Felt


class Moved(Word, frozen=True):
    """The motion has ended so."""

    felt: Felt


class Lost(Word, frozen=True):
    """The loop is gone, or another one: nobody knows how the motion ended."""

    reason: str


class Move(Word, frozen=True):
    """The skill wants this motion; `expected`: of the whole act from here [s, simulated]."""

    motion: Motion
    expected: float
    remembered: Remembered


class Ended(Word, frozen=True):
    """The skill has ended."""

    outcome: rc.Done | rc.NotDone
    remembered: Remembered


class Crashed(msgspec.Struct, frozen=True, tag=True):
    """The worker ended by itself with this exit status."""

    code: int


ToLoop = Where | Halt | Do | Brake
ToWorker = Perform | Feel
FromWorker = Move | Ended
Local = Stands | Moved | Lost | Move | Ended | Crashed

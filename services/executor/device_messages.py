"""Messages between ex and its devices: the process that runs skills, and the control loop.

A message carries the number of its act: what a killed process had sent before is not taken for part
of the next act. None is a communicate, none leaves the computer.
"""

from pathlib import Path

import msgspec

from companion.acts import AnyAct
from companion.eyes import Eyes
from companion.languages import rc
from companion.languages.facts import Facts
from companion.skills.loop_messages import KNOT_S, Motion
from services.executor.memory import Felt, SituationRecord
from services.executor.renderer import Blind, Saw, See
from velma.model import scene as scenes
from velma.model.scene import Scene


class Message(msgspec.Struct, frozen=True, tag=True):
    """`number` counts acts, also across restarts of the agent."""

    number: int


# --- to the loop ----------------------------------------------------------------------------------


class Where(Message, frozen=True):
    """Ask for the posture -> Stands, or Lost at once."""


class Halt(Message, frozen=True):
    """Bring the robot to rest; wait for a loop if there is none -> Stands."""


class Do(Message, frozen=True):
    """Carry this motion out -> Moved, or Lost."""

    motion: Motion


class Brake(Message, frozen=True):
    """Bring the motion of this key to rest; its Moved still comes. Also the answer of a skill to
    Glance.
    """

    key: str


class GoOn(Message, frozen=True):
    """The answer of a skill to Glance: the motion of this key goes on, the next look is due after
    `look_in_s` [s].
    """

    key: str
    look_in_s: float


# --- to the skill process -------------------------------------------------------------------------


class Setup(msgspec.Struct, frozen=True):
    """To a new child: the file of the scene ("" for the canonical one), the seed that varies it (0:
    none), the eyes.
    """

    scene: str = ""
    seed: int = 0
    eyes: Eyes = Eyes.RAYS


class Perform(Message, frozen=True):
    """Run the skill of this command -> Move or Ended."""

    command: AnyAct
    remembered: SituationRecord
    felt: Felt


class Feel(Message, frozen=True):
    """The result of the motion asked for last -> Move or Ended."""

    felt: Felt


class Glance(Message, frozen=True):
    """Look, and judge the motion under way -> GoOn or Brake."""

    felt: Felt


class Drop(Message, frozen=True):
    """Give the act up: the skill process is killed."""


# --- from them ------------------------------------------------------------------------------------


class Stands(Message, frozen=True):
    """The posture of the robot."""

    felt: Felt


class Passing(Message, frozen=True):
    """A look at the motion under way is due -> GoOn or Brake."""

    felt: Felt


class Moved(Message, frozen=True):
    """The end of a motion."""

    felt: Felt


class Lost(Message, frozen=True):
    """The loop is gone or was replaced: how the motion ended is unknown. `text`: for the log."""

    why: Facts
    text: str


class Move(Message, frozen=True):
    """The next motion of the skill; `expected`: duration of the whole act from here [s,
    simulated].
    """

    motion: Motion
    expected: float
    remembered: SituationRecord


class Ended(Message, frozen=True):
    """The skill has ended. `text`: of a motion that could not be made, for the log."""

    outcome: rc.Done | rc.NotDone
    remembered: SituationRecord
    text: str = ""


class ByRays(msgspec.Struct, frozen=True, tag=True):
    """Eyes by pixels cannot go on, and why, for the log: ex sees by rays from now on."""

    reason: str


class Crashed(msgspec.Struct, frozen=True, tag=True):
    """The skill process ended by itself, and why, for the log."""

    reason: str


ToLoop = Where | Halt | Do | GoOn | Brake
ToSkill = Perform | Feel | Glance | Saw | Blind
FromSkill = Move | GoOn | Brake | Ended | ByRays | See
Local = Stands | Passing | Moved | Lost | Move | GoOn | Brake | Ended | ByRays | Crashed


# --- The scene of the simulated world -------------------------------------------------------------


def scene_of(setup: Setup) -> Scene:
    """Return the scene of the loop: from its file or the canonical one, varied by the seed. Raises
    VelmaError.
    """
    asked = scenes.load(Path(setup.scene)) if setup.scene else scenes.load()
    return scenes.vary(asked, setup.seed)


def duration(motion: Motion) -> float:
    """Return the time of its joint path and its rest at the end [s]."""
    return len(motion.knots) / (15 * 8) * KNOT_S + motion.settle_s

"""Memory of ex between two steps: the act under way, the last measurement; from act to act the
posture, what was seen, what the hands hold; the conditions of the design.

It is plain data, kept in the journal. A new skill process starts from a SituationRecord, so neither
its death nor that of the agent makes ex forget what it holds. Must not know: geometry, the
simulator.
"""

import msgspec
import numpy as np
from msgspec.structs import replace

from companion.acts import AnyAct
from companion.languages import rc, rs
from companion.languages.facts import Facts
from companion.languages.values import BodyPosture, Pose, Side
from companion.skills.loop_messages import GripReport, Motion
from companion.skills.situation import Unfinished
from velma.names import Array


class Holding(msgspec.Struct, frozen=True):
    """The object in a hand: by which grasp, its pose in the hand (T_grip_object), the mass that is
    fed forward [kg].

    `steady`, `apart`, `slipped`: as of companion.skills.situation.Held.
    """

    object: str
    grasp: str
    pose: Pose
    mass: float
    steady: Pose | None = None
    apart: int = 0
    slipped: bool = False


class SituationRecord(msgspec.Struct, frozen=True):
    """`q`: set-points of torso, right arm, left arm (15,) [rad], () before the first message of the
    loop.

    `fingers`: angle per side [rad]. `seen`: last pose of each thing in the world (of a held one:
    before it was taken). `placed`: things that a hand let go of and that were not seen since, by id
    the time [s]; `seen` has where. `unfinished`: moves of content that were begun and not ended, by
    source. `time`: simulated [s]. `epoch`: name of the simulated world in which all that is so, ""
    of a real one. `ill`: sensors whose readings could not be true at the last look.
    """

    q: tuple[float, ...] = ()
    head: tuple[float, float] = (0.0, 0.0)
    fingers: dict[Side, float] = {}
    seen: dict[str, rs.Seen] = {}
    held: dict[Side, Holding] = {}
    placed: dict[str, float] = {}
    unfinished: dict[str, Unfinished] = {}
    time: float = 0.0
    epoch: str = ""
    ill: tuple[rc.Ill, ...] = ()

    def posture(self) -> BodyPosture | None:
        """Return the posture for a communicate; None before it is known."""
        if not self.q:
            return None
        bent = (self.fingers.get(side, 0.0) for side in (Side.RIGHT, Side.LEFT))
        right, left = ((angle, angle, angle, 0.0) for angle in bent)
        return BodyPosture(self.q[0], self.q[1:8], self.q[8:15], self.head, right, left)

    def holding(self) -> dict[Side, tuple[str, str, Pose]]:
        """Return what each hand holds, for a communicate."""
        return {side: (one.object, one.grasp, one.pose) for side, one in self.held.items()}

    def not_done(self, key: str, kind: str, why: Facts) -> rc.NotDone:
        """Return the outcome of an act that was not done, with the posture."""
        placed = tuple(replace(self.seen[name], at=at) for name, at in self.placed.items())
        return rc.NotDone(key, kind, why, self.posture(), held=self.holding(), placed=placed)


class Felt(msgspec.Struct, frozen=True):
    """Measurements of the loop: how a motion ended (phase of the loop, "" if there was none) and
    why, and the posture.

    `q`, `measured`: set-points and joints (15,) as float64 bytes [rad]. `touched`, `fingers`: per
    side, which fingers touched, mean angle [rad]; `grips`: what the wrist feels. `world`: all
    coordinates of the world model, for the receptor only. `epoch`: name of the simulated world, ""
    of a real one. `text`: of a refusal or fault, for the log.
    """

    q: bytes
    measured: bytes
    head: tuple[float, float]
    time: float
    world: bytes = b""
    epoch: str = ""
    ended: str = ""
    why: Facts = ()
    text: str = ""
    touched: dict[str, tuple[bool, bool, bool]] = {}
    fingers: dict[str, float] = {}
    grips: dict[str, GripReport] = {}

    def setpoint(self) -> Array:
        """Return the set-point (15,) [rad]."""
        return np.frombuffer(self.q)


class RunningAct(msgspec.Struct, frozen=True):
    """An act under way. `begun`: agreed to, its first motion is sent. `lost`: why its outcome
    cannot be known.

    `cancelling`: a cancel came; `broken_off`: the skill was told.
    """

    conversation: str
    command: AnyAct
    begun: bool = False
    cancelling: bool = False
    broken_off: bool = False
    lost: Facts = ()
    outcome: rc.Done | rc.NotDone | None = None


class Soft(msgspec.Struct, frozen=True):
    """Memory lost with the process: the motion to start next, whether one is under way, the last
    measurement.
    """

    motion: Motion | None = None
    moving: bool = False
    felt: Felt | None = None


class Memory(msgspec.Struct, frozen=True):
    """`number` counts acts; `last` is the key of the previous one, which is never started again."""

    number: int = 0
    last: str = ""
    act: RunningAct | None = None
    remembered: SituationRecord = SituationRecord()
    soft: Soft = Soft()


def _outcome(memory: Memory) -> bool:
    return memory.act is not None and memory.act.outcome is not None


def _stopped(memory: Memory) -> bool:
    return (
        memory.act is not None
        and not _outcome(memory)
        and (memory.act.cancelling or bool(memory.act.lost))
    )


def _next_part(memory: Memory) -> bool:
    return memory.soft.motion is not None and not _outcome(memory)


CONDITIONS = {
    "recovered": lambda memory: memory.soft.felt is not None,
    # after a restart the loop is always stopped: simpler, and proven
    "act_still_runs": lambda memory: False,
    "act_taken": lambda memory: memory.act is not None,
    "prepared": lambda memory: memory.act is not None and memory.act.begun,
    "cannot_act": _outcome,
    "begun": lambda memory: not _outcome(memory),
    "outcome_known": _outcome,
    "act_ended": lambda memory: _outcome(memory) or _next_part(memory),
    "act_stopped": _stopped,
    "next_part": _next_part,
    "stood_still": _outcome,
    "reported": lambda memory: memory.act is None,
}

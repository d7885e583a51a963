"""Memory of ex between two steps: the act under way, the last posture; the conditions of the
design.
"""

import msgspec

from companion.acts import AnyAct
from companion.languages import rc
from companion.languages.facts import Facts
from companion.skills.loop_messages import Motion
from services.executor.device_messages import Felt
from services.executor.situation_record import SituationRecord


class Act(msgspec.Struct, frozen=True):
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
    act: Act | None = None
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

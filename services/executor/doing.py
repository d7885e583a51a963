"""The act under way: its memory, the conditions that lead from state to state, and its motions one after the other."""

import msgspec
from msgspec.structs import replace

from agent_runtime.core.events import Local, Woken
from agent_runtime.core.turn import Turn
from companion.languages import rc
from services.executor.loop.program import KNOT_S, Motion, Phase
from services.executor.remembered import Remembered
from services.executor.words import Crashed, Do, Drop, Ended, Feel, Felt, Lost, Move, Moved

PATIENCE = "patience"
COMPUTE_WITHIN_S = 60.0  # estimate: as for the first motion of a skill
MOTION_SLACK, MOTION_MARGIN_S = 5.0, 30.0  # estimate: a hand closes in 10 s; a loaded machine is slower than real time


class Doing(msgspec.Struct, frozen=True):
    """`begun`: agreed to, and the first motion is on its way. `lost`: why nobody can know its outcome.

    `cancelling`: a cancel came; `broken_off`: the skill knows.
    """

    conversation: str
    command: rc.Act
    begun: bool = False
    cancelling: bool = False
    broken_off: bool = False
    lost: str = ""
    outcome: rc.Done | rc.NotDone | None = None


class Soft(msgspec.Struct, frozen=True):
    """The motion to be begun, whether one is under way, what was felt last."""

    motion: Motion | None = None
    moving: bool = False
    felt: Felt | None = None


class Memory(msgspec.Struct, frozen=True):
    """`number` counts acts, `last` is the key of the one before: it is never begun again."""

    number: int = 0
    last: str = ""
    doing: Doing | None = None
    remembered: Remembered = Remembered()
    soft: Soft = Soft()


def _outcome(memory: Memory) -> bool:
    return memory.doing is not None and memory.doing.outcome is not None


def _stopped(memory: Memory) -> bool:
    return memory.doing is not None and not _outcome(memory) and (memory.doing.cancelling or bool(memory.doing.lost))


def _next_part(memory: Memory) -> bool:
    return memory.soft.motion is not None and not _outcome(memory)


CONDITIONS = {
    "recovered": lambda memory: memory.soft.felt is not None,
    "act_still_runs": lambda memory: False,  # after any restart the loop is stopped: simpler, and explored as correct
    "act_taken": lambda memory: memory.doing is not None,
    "prepared": lambda memory: memory.doing is not None and memory.doing.begun,
    "cannot_act": _outcome,
    "begun": lambda memory: not _outcome(memory),
    "outcome_known": _outcome,
    "act_ended": lambda memory: _outcome(memory) or _next_part(memory),
    "act_stopped": _stopped,
    "next_part": _next_part,
    "stood_still": _outcome,
    "reported": lambda memory: memory.doing is None,
}


def start(memory: Memory, turn: Turn) -> Memory:
    """Have the loop begin the motion that waits."""
    motion = memory.soft.motion
    assert motion is not None
    turn.tell(Do(memory.number, motion))
    turn.wake(PATIENCE, turn.now + MOTION_SLACK * duration(motion) + MOTION_MARGIN_S)
    return replace(memory, soft=replace(memory.soft, motion=None, moving=True))


def duration(motion: Motion) -> float:
    """Of its joint path and rest [s]."""
    return len(motion.knots) / (15 * 8) * KNOT_S + motion.settle_s


def lost(memory: Memory, reason: str) -> Memory:
    """From here on only rest is wanted, and the outcome is unknown."""
    assert memory.doing is not None
    return replace(memory, doing=replace(memory.doing, lost=reason), soft=replace(memory.soft, motion=None))


def follow(memory: Memory, turn: Turn) -> Memory:
    """What worker and loop say during an act."""
    doing = memory.doing
    assert doing is not None
    match turn.event:
        case Local(content=Moved(number=number, felt=felt)) if number == memory.number:
            return _moved(memory, turn, felt)
        case Local(content=Move(number=number) as move) if number == memory.number:
            return _wanted(memory, turn, move)
        case Local(content=Ended(number=number, outcome=outcome, remembered=kept)) if number == memory.number:
            return replace(memory, doing=replace(doing, outcome=outcome), remembered=kept)
        case Local(content=Lost(number=number, reason=reason)) if number == memory.number:
            return lost(memory, reason)
        case Local(content=Crashed(code=code)):
            return _without_skill(memory, turn, f"the skill's process ended (exit status {code})")
        case Woken(name=name) if name == PATIENCE:
            return _without_skill(memory, turn, "the loop or the skill gives no answer")
        case _:
            return memory


def _moved(memory: Memory, turn: Turn, felt: Felt) -> Memory:
    """The skill is told; the first ending after a cancel is a cancelled one, even where the two crossed."""
    doing = memory.doing
    assert doing is not None
    if doing.cancelling and not doing.broken_off and felt.ended == Phase.DONE:
        felt = replace(felt, ended=str(Phase.CANCELLED))
    broken_off = doing.broken_off or felt.ended == Phase.CANCELLED
    turn.tell(Feel(memory.number, felt))
    turn.wake(PATIENCE, turn.now + COMPUTE_WITHIN_S)
    soft = replace(memory.soft, moving=False, felt=felt)
    return replace(memory, doing=replace(doing, broken_off=broken_off), soft=soft)


def _wanted(memory: Memory, turn: Turn, move: Move) -> Memory:
    """The skill's next motion; a cancel that came while it computed is felt as a cancelled motion instead."""
    doing = memory.doing
    assert doing is not None
    memory = replace(memory, remembered=move.remembered)
    if doing.cancelling and not doing.broken_off and memory.soft.felt is not None:
        turn.tell(Feel(memory.number, replace(memory.soft.felt, ended=str(Phase.CANCELLED), reason="cancelled")))
        return replace(memory, doing=replace(doing, broken_off=True))
    return replace(memory, soft=replace(memory.soft, motion=move.motion))


def _without_skill(memory: Memory, turn: Turn, reason: str) -> Memory:
    """The act of a robot at rest is interrupted; of one that moves nobody knows how it will have ended."""
    doing = memory.doing
    assert doing is not None
    if memory.soft.moving:
        return lost(memory, reason)
    turn.tell(Drop(memory.number))
    outcome = memory.remembered.not_done(doing.command.key, "interrupted", reason)
    return replace(memory, doing=replace(doing, outcome=outcome))

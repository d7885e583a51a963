"""The motions of an act, one after the other: what skill process and loop send while the act runs."""

from msgspec.structs import replace

from agent_runtime.core.events import Local, Woken
from agent_runtime.core.turn import Turn
from companion.languages import rc
from services.executor.local import (
    Brake,
    Crashed,
    Do,
    Drop,
    Ended,
    Feel,
    Felt,
    Glance,
    GoOn,
    Lost,
    Move,
    Moved,
    Passing,
)
from services.executor.loop.program import KNOT_S, Motion, Phase
from services.executor.memory import Memory

PATIENCE = "patience"
COMPUTE_WITHIN_S = 60.0  # estimate: as for the first motion of a skill
MOTION_SLACK, MOTION_MARGIN_S = 5.0, 30.0  # estimate: a hand closes in 10 s; a loaded machine is slower than real time


def start(memory: Memory, turn: Turn) -> Memory:
    """Send the waiting motion to the loop."""
    motion = memory.soft.motion
    assert motion is not None
    turn.tell(Do(memory.number, motion))
    turn.wake(PATIENCE, turn.now + MOTION_SLACK * duration(motion) + MOTION_MARGIN_S)
    return replace(memory, soft=replace(memory.soft, motion=None, moving=True))


def duration(motion: Motion) -> float:
    """Return the time of its joint path and its rest at the end [s]."""
    return len(motion.knots) / (15 * 8) * KNOT_S + motion.settle_s


def lost(memory: Memory, reason: str) -> Memory:
    """Note that the outcome cannot be known; the robot only has to come to rest now."""
    assert memory.act is not None
    return replace(memory, act=replace(memory.act, lost=reason), soft=replace(memory.soft, motion=None))


def follow(memory: Memory, turn: Turn) -> Memory:
    """Take what skill process and loop send during an act."""
    act = memory.act
    assert act is not None
    match turn.event:
        case Local(content=Passing(number=number, felt=felt)) if number == memory.number:
            turn.tell(Glance(number, felt))
            return memory
        case Local(content=GoOn(number=number) | Brake(number=number) as answer) if number == memory.number:
            turn.tell(answer)  # nothing to do for the loop where the motion has ended meanwhile
            return memory
        case Local(content=Moved(number=number, felt=felt)) if number == memory.number:
            return _moved(memory, turn, felt)
        case Local(content=Move(number=number) as move) if number == memory.number:
            return _wanted(memory, turn, move)
        case Local(content=Ended(number=number, outcome=outcome, remembered=kept)) if number == memory.number:
            return replace(memory, act=replace(act, outcome=outcome), remembered=kept)
        case Local(content=Lost(number=number, reason=reason)) if number == memory.number:
            return lost(memory, reason)
        case Local(content=Crashed(reason=reason)):
            return _without_skill(memory, turn, f"the skill's process ended: {reason}")
        case Woken(name=name) if name == PATIENCE:
            return _without_skill(memory, turn, "the loop or the skill gives no answer")
        case _:
            return memory


def _moved(memory: Memory, turn: Turn, felt: Felt) -> Memory:
    """Tell the skill how its motion ended; the first end after a cancel counts as cancelled, even if they crossed.

    A skill that braked its motion by itself was not told of a cancel.
    """
    act = memory.act
    assert act is not None
    if act.cancelling and not act.broken_off and felt.ended == Phase.DONE:
        felt = replace(felt, ended=str(Phase.CANCELLED))
    broken_off = act.broken_off or (act.cancelling and felt.ended == Phase.CANCELLED)
    turn.tell(Feel(memory.number, felt))
    turn.wake(PATIENCE, turn.now + COMPUTE_WITHIN_S)
    soft = replace(memory.soft, moving=False, felt=felt)
    return replace(memory, act=replace(act, broken_off=broken_off), soft=soft)


def _wanted(memory: Memory, turn: Turn, move: Move) -> Memory:
    """Note the next motion of the skill. If a cancel came while it was computed, tell the skill "cancelled" instead."""
    act = memory.act
    assert act is not None
    memory = replace(memory, remembered=move.remembered)
    if act.cancelling and not act.broken_off and memory.soft.felt is not None:
        turn.tell(Feel(memory.number, replace(memory.soft.felt, ended=str(Phase.CANCELLED), reason="cancelled")))
        return replace(memory, act=replace(act, broken_off=True))
    return replace(memory, soft=replace(memory.soft, motion=move.motion))


def _without_skill(memory: Memory, turn: Turn, reason: str) -> Memory:
    """End an act whose skill is gone: interrupted if the robot is at rest, unknown outcome if it moves."""
    act = memory.act
    assert act is not None
    if memory.soft.moving:
        return lost(memory, reason)
    turn.tell(Drop(memory.number))
    outcome = memory.remembered.not_done(act.command.key, rc.NotDoneKind.INTERRUPTED, reason)
    return replace(memory, act=replace(act, outcome=outcome))

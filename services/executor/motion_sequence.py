"""The motions of an act, one after the other: what skill process and loop send while the act
runs.
"""

from typing import Any

from msgspec.structs import replace

from agent_runtime.core.events import Local, Woken
from agent_runtime.core.turn import Turn
from companion.languages import rc
from companion.languages.facts import Facts, Kind, fact
from companion.skills.loop_messages import KNOT_S, Motion, Phase
from services.executor.device_messages import (
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
    Message,
    Move,
    Moved,
    Passing,
)
from services.executor.memory import Memory

PATIENCE = "patience"
LOOP, SKILL = "loop", "skill_process"
COMPUTE_WITHIN_S = 60.0  # estimate: as for the first motion of a skill
# estimate: a hand closes in 10 s; a loaded machine is slower than real time
MOTION_SLACK, MOTION_MARGIN_S = 5.0, 30.0


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


def lost(memory: Memory, why: Facts) -> Memory:
    """Note that the outcome cannot be known; the robot only has to come to rest now."""
    assert memory.act is not None
    return replace(
        memory, act=replace(memory.act, lost=why), soft=replace(memory.soft, motion=None)
    )


def heard(memory: Memory, turn: Turn) -> Any:
    """Return what a device has sent for the act under way; None for what it sent for another one,
    as a killed process does, and for every other event.
    """
    match turn.event:
        case Local(content=Message(number=number) as content) if number == memory.number:
            return content
        case Local(content=Crashed() as crash):
            return crash
    return None


def follow(memory: Memory, turn: Turn) -> Memory:
    """Take what skill process and loop send during an act."""
    match heard(memory, turn):
        case Passing(number=number, felt=felt):
            turn.tell(Glance(number, felt))
        case GoOn() | Brake() as answer:
            turn.tell(answer)  # nothing to do for the loop where the motion has ended meanwhile
        case Moved(felt=felt):
            return _moved(memory, turn, felt)
        case Move() as move:
            return _wanted(memory, turn, move)
        case Ended() as end:
            return over(memory, turn, end)
        case Lost() as loss:
            return lost(memory, logged(turn, loss))
        case Crashed() as crash:
            return _without_skill(memory, turn, logged(turn, crash))
        case None if isinstance(turn.event, Woken) and turn.event.name == PATIENCE:
            silent = LOOP if memory.soft.moving else SKILL
            return _without_skill(memory, turn, (fact(Kind.GAVE_NO_ANSWER, silent),))
    return memory


def over(memory: Memory, turn: Turn, end: Ended) -> Memory:
    """Note the outcome of the skill."""
    assert memory.act is not None
    if end.text:
        turn.log("the skill cannot make a motion", level="warning", reason=end.text)
    return replace(memory, act=replace(memory.act, outcome=end.outcome), remembered=end.remembered)


def logged(turn: Turn, end: Lost | Crashed) -> Facts:
    """Log the end of loop or skill process, and return it as facts."""
    if isinstance(end, Lost):
        turn.log("the loop is lost", level="warning", reason=end.text)
        return end.why
    turn.log("the skill's process ended", level="warning", reason=end.reason)
    return (fact(Kind.ENDED, SKILL),)


def _moved(memory: Memory, turn: Turn, felt: Felt) -> Memory:
    """Tell the skill how its motion ended; the first end after a cancel counts as cancelled, even
    if they crossed.

    A skill that braked its motion by itself was not told of a cancel.
    """
    act = memory.act
    assert act is not None
    if felt.text:
        turn.log("the loop refused or failed", level="warning", reason=felt.text)
    if act.cancelling and not act.broken_off and felt.ended == Phase.DONE:
        felt = replace(felt, ended=str(Phase.CANCELLED))
    broken_off = act.broken_off or (act.cancelling and felt.ended == Phase.CANCELLED)
    turn.tell(Feel(memory.number, felt))
    turn.wake(PATIENCE, turn.now + COMPUTE_WITHIN_S)
    soft = replace(memory.soft, moving=False, felt=felt)
    return replace(memory, act=replace(act, broken_off=broken_off), soft=soft)


def _wanted(memory: Memory, turn: Turn, move: Move) -> Memory:
    """Note the next motion of the skill. If a cancel came while it was computed, tell the skill
    "cancelled" instead.
    """
    act = memory.act
    assert act is not None
    memory = replace(memory, remembered=move.remembered)
    if act.cancelling and not act.broken_off and memory.soft.felt is not None:
        cancelled = replace(
            memory.soft.felt, ended=str(Phase.CANCELLED), why=(fact(Kind.CANCELLED),)
        )
        turn.tell(Feel(memory.number, cancelled))
        return replace(memory, act=replace(act, broken_off=True))
    return replace(memory, soft=replace(memory.soft, motion=move.motion))


def _without_skill(memory: Memory, turn: Turn, why: Facts) -> Memory:
    """End an act whose skill is gone: interrupted if the robot is at rest, unknown outcome if it
    moves.
    """
    act = memory.act
    assert act is not None
    if memory.soft.moving:
        return lost(memory, why)
    turn.tell(Drop(memory.number))
    outcome = memory.remembered.not_done(act.command.key, rc.NotDoneKind.INTERRUPTED, why)
    return replace(memory, act=replace(act, outcome=outcome))

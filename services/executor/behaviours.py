"""The behaviours of ex, bound by name to the states of the design (the paper leaves the states of
ex to us).

An act: the loop says where the robot stands, the skill process runs the skill and yields motions,
the loop carries them out, the outcome of the skill is reported. The intent is in the journal before
the first motion. So if agent or loop dies during an act, the outcome is `unknown`, the robot is
brought to rest, and nothing is started a second time. Must not know: plans, the geometry of skills.
"""

from functools import partial
from typing import Any

import numpy as np
from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition
from agent_runtime.core.events import Broken, Local, Received, Started, Woken
from agent_runtime.core.turn import Turn
from companion.design import AgentName, bind
from companion.languages import rc
from companion.languages.facts import Facts, Kind, fact
from companion.languages.rc import NotDoneKind
from companion.skills.loop_messages import Phase
from fipa_codec.performatives import Performative
from services.executor import device_messages, outgoing_messages
from services.executor.device_messages import (
    Brake,
    ByRays,
    Crashed,
    Do,
    Drop,
    Ended,
    Feel,
    Glance,
    GoOn,
    Halt,
    Lost,
    Message,
    Move,
    Moved,
    Passing,
    Perform,
    Stands,
    Where,
    duration,
)
from services.executor.memory import CONDITIONS, Felt, Memory, RunningAct, SituationRecord, Soft

RESTARTED = (fact(Kind.ENDED, "ex"),)
PATIENCE = "patience"
LOOP, SKILL = "loop", "skill_process"
# estimate: the longest computation of a skill, a planned path home, takes some seconds
SKILL_WITHIN_S = 60.0
# estimate: a hand closes in 10 s; a loaded machine is slower than real time
MOTION_SLACK, MOTION_MARGIN_S = 5.0, 30.0


def agent() -> Agent[Memory]:
    """Return the agent ex."""
    behaviours = {
        "recover_act": recover_act,
        "await_act": await_act,
        "prepare_act": prepare_act,
        "act": carry_out,
        "stop_act": stop_act,
        "report_act": report_act,
    }
    in_any = {name: partial(_told_of_eyes, behave) for name, behave in behaviours.items()}
    return bind(AgentName.EX, Memory(), in_any, CONDITIONS, local=device_messages.Local)


def _told_of_eyes(behave: Transition[Memory], memory: Memory, turn: Turn) -> Memory:
    """Any state: say that ex sees by rays from now on; nothing else changes by that."""
    match turn.event:
        case Local(content=ByRays(reason=reason)):
            turn.log("sees by rays", level="warning", reason=reason)
            return memory
    return behave(memory, turn)


# --- recovering, idle -----------------------------------------------------------------------------


def recover_act(memory: Memory, turn: Turn) -> Memory:
    """State recovering: bring the robot to rest and ask the loop for its posture."""
    match turn.event:
        case Started() | None:
            turn.tell(Halt(memory.number))
        case Local(content=Stands(felt=felt)):
            return replace(_where(memory, felt), soft=Soft(felt=felt))
    return _declined(memory, turn)


def await_act(memory: Memory, turn: Turn) -> Memory:
    """State idle: take the next act; refuse one that was started before or is impossible, and say
    why.
    """
    match turn.event:
        case Received(content=command) as received if isinstance(command, rc.Command):
            if wrong := outgoing_messages.wrong(command):
                turn.log("a command makes no sense", level="warning", reason=wrong.text)
                why = fact(Kind.BAD_COMMAND, wrong.field)
            elif command.key == memory.last:
                why = fact(Kind.BEGUN_BEFORE)
            else:
                act = RunningAct(received.conversation, command)
                return replace(memory, number=memory.number + 1, act=act, soft=Soft())
            outgoing_messages.refuse(
                turn, received.conversation, command, NotDoneKind.REFUSED, (why,)
            )
        case _:
            memory = _declined(memory, turn)
    return memory


def _declined(memory: Memory, turn: Turn) -> Memory:
    """Refuse a second act, and any subscription: readings are not published yet."""
    match turn.event:
        case Received(content=command) as received if isinstance(command, rc.Command):
            outgoing_messages.refuse(
                turn, received.conversation, command, NotDoneKind.BUSY, (fact(Kind.BUSY, "ex"),)
            )
        case Received(communicate=word) as received if word.performative is Performative.SUBSCRIBE:
            turn.say(received.conversation, Performative.REFUSE)
    return memory


# --- preparing ------------------------------------------------------------------------------------


def prepare_act(memory: Memory, turn: Turn) -> Memory:
    """State preparing: run the skill from the present posture; agree when its first motion is
    there.
    """
    act = _required(memory)
    match _heard(memory, turn):
        case Stands(felt=felt) if _elsewhere(memory, felt):
            return _new_world(memory, felt)
        case Stands(number=number, felt=felt):
            turn.tell(Perform(number, act.command, memory.remembered, felt))
            return replace(memory, soft=replace(memory.soft, felt=felt))
        case Move() as move:
            outgoing_messages.agree(turn, act, move.expected)
            act = replace(act, begun=True)
            soft = replace(memory.soft, motion=move.motion)
            return replace(memory, act=act, remembered=move.remembered, soft=soft)
        case Ended() as end:
            return _over(memory, turn, end)
        case Lost() | Crashed() as end:
            return _given_up(memory, turn, NotDoneKind.INTERRUPTED, _logged(turn, end))
    match turn.event:
        case None | Started():
            turn.wake(PATIENCE, turn.now + SKILL_WITHIN_S)
            turn.tell(Where(memory.number))
        case Woken(name=name) if name == PATIENCE:
            why = (fact(Kind.NO_MOTION_FOUND, SKILL_WITHIN_S),)
            return _given_up(memory, turn, NotDoneKind.INTERRUPTED, why)
        case Received() | Broken() as event if _called_off(act, event):
            memory = replace(memory, act=replace(act, cancelling=True))
            return _given_up(memory, turn, NotDoneKind.CANCELLED, (fact(Kind.CANCELLED),))
        case _:
            return _declined(memory, turn)
    return memory


def _required(memory: Memory) -> RunningAct:
    assert memory.act is not None
    return memory.act


def _called_off(act: RunningAct, event: Received | Broken) -> bool:
    """Whether ta cancels the act, or knows nothing of it any more."""
    called = isinstance(event, Broken) or event.communicate.performative is Performative.CANCEL
    return called and event.conversation == act.conversation


def _given_up(memory: Memory, turn: Turn, kind: str, why: Facts) -> Memory:
    turn.tell(Drop(memory.number))
    return _not_done(memory, kind, why)


def _not_done(memory: Memory, kind: str, why: Facts) -> Memory:
    act = _required(memory)
    outcome = memory.remembered.not_done(act.command.key, kind, why)
    return replace(memory, act=replace(act, outcome=outcome))


# --- acting and stopping --------------------------------------------------------------------------


def carry_out(memory: Memory, turn: Turn) -> Memory:
    """State acting: one motion after the other, until the skill has ended, is cancelled, or the
    loop is lost.
    """
    act = _required(memory)
    match turn.event:
        case None:
            return _start(memory, turn)
        case Started():
            return _lost(memory, RESTARTED)
        case Received() | Broken() as event if _called_off(act, event):
            return replace(memory, act=replace(act, cancelling=True))
        case Received():
            return _declined(memory, turn)
    return _follow(memory, turn)


def stop_act(memory: Memory, turn: Turn) -> Memory:
    """State stopping: a cancelled skill makes its work safe; after a loss the robot is only brought
    to rest.
    """
    act = _required(memory)
    match turn.event:
        case None if act.lost:
            return _halted(memory, turn)
        case None:
            if memory.soft.moving:
                turn.tell(Brake(memory.number, act.command.key))
            return memory
        case Started():
            return _halted(_lost(memory, act.lost or RESTARTED), turn)
        case Local(content=Stands(number=number, felt=felt)) if (
            act.lost and number == memory.number
        ):
            if _elsewhere(memory, felt):
                return _new_world(memory, felt)
            return _not_done(_where(memory, felt), NotDoneKind.UNKNOWN, act.lost)
        case Received() | Broken() as event if _called_off(act, event):
            return replace(memory, act=replace(act, cancelling=True))
        case Received():
            return _declined(memory, turn)
    if act.lost:
        return memory
    after = _follow(memory, turn)
    if _required(after).lost:
        return _halted(after, turn)
    return _start(after, turn) if after.soft.motion is not None else after


def _halted(memory: Memory, turn: Turn) -> Memory:
    turn.unwake(PATIENCE)
    turn.tell(Drop(memory.number))
    turn.tell(Halt(memory.number))
    return memory


def _where(memory: Memory, felt: Felt) -> Memory:
    q = tuple(float(x) for x in np.asarray(felt.setpoint()))
    epoch = memory.remembered.epoch or felt.epoch  # another one is noted when it is told
    return replace(
        memory,
        remembered=replace(memory.remembered, q=q, head=felt.head, time=felt.time, epoch=epoch),
    )


def _elsewhere(memory: Memory, felt: Felt) -> bool:
    """Whether the simulated world is another one than that of which ex knows something."""
    return memory.remembered.epoch not in ("", felt.epoch)


def _new_world(memory: Memory, felt: Felt) -> Memory:
    """Forget all, and say so: what a hand held and where things were is known of no thing in this
    world.
    """
    memory = _where(replace(memory, remembered=SituationRecord()), felt)
    act = _required(memory)
    outcome = rc.NotDone(act.command.key, NotDoneKind.NEW_WORLD, (fact(Kind.NEW_WORLD),))
    return replace(memory, act=replace(act, outcome=outcome))


# --- the motions of an act, one after the other ---------------------------------------------------


def _start(memory: Memory, turn: Turn) -> Memory:
    """Send the waiting motion to the loop."""
    motion = memory.soft.motion
    assert motion is not None
    turn.tell(Do(memory.number, motion))
    turn.wake(PATIENCE, turn.now + MOTION_SLACK * duration(motion) + MOTION_MARGIN_S)
    return replace(memory, soft=replace(memory.soft, motion=None, moving=True))


def _lost(memory: Memory, why: Facts) -> Memory:
    """Note that the outcome cannot be known; the robot only has to come to rest now."""
    return replace(memory, act=replace(_required(memory), lost=why))


def _heard(memory: Memory, turn: Turn) -> Any:
    """Return what a device has sent for the act under way; None for what it sent for another one,
    as a killed process does, and for every other event.
    """
    match turn.event:
        case Local(content=Message(number=number) as content) if number == memory.number:
            return content
        case Local(content=Crashed() as crash):
            return crash
    return None


def _follow(memory: Memory, turn: Turn) -> Memory:
    """Take what skill process and loop send during an act."""
    match _heard(memory, turn):
        case Passing(number=number, felt=felt):
            turn.tell(Glance(number, felt))
        case GoOn() | Brake() as answer:
            turn.tell(answer)  # nothing to do for the loop where the motion has ended meanwhile
        case Moved(felt=felt):
            return _moved(memory, turn, felt)
        case Move() as move:
            return _wanted(memory, turn, move)
        case Ended() as end:
            return _over(memory, turn, end)
        case Lost() as loss:
            return _lost(memory, _logged(turn, loss))
        case Crashed() as crash:
            return _without_skill(memory, turn, _logged(turn, crash))
        case None if isinstance(turn.event, Woken) and turn.event.name == PATIENCE:
            silent = LOOP if memory.soft.moving else SKILL
            return _without_skill(memory, turn, (fact(Kind.GAVE_NO_ANSWER, silent),))
    return memory


def _over(memory: Memory, turn: Turn, end: Ended) -> Memory:
    """Note the outcome of the skill."""
    if end.text:
        turn.log("the skill cannot make a motion", level="warning", reason=end.text)
    return replace(
        memory, act=replace(_required(memory), outcome=end.outcome), remembered=end.remembered
    )


def _logged(turn: Turn, end: Lost | Crashed) -> Facts:
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
    act = _required(memory)
    if felt.text:
        turn.log("the loop refused or failed", level="warning", reason=felt.text)
    if act.cancelling and not act.broken_off and felt.ended == Phase.DONE:
        felt = replace(felt, ended=str(Phase.CANCELLED))
    broken_off = act.broken_off or (act.cancelling and felt.ended == Phase.CANCELLED)
    turn.tell(Feel(memory.number, felt))
    turn.wake(PATIENCE, turn.now + SKILL_WITHIN_S)
    soft = replace(memory.soft, moving=False, felt=felt)
    return replace(memory, act=replace(act, broken_off=broken_off), soft=soft)


def _wanted(memory: Memory, turn: Turn, move: Move) -> Memory:
    """Note the next motion of the skill. If a cancel came while it was computed, tell the skill
    "cancelled" instead.
    """
    act = _required(memory)
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
    if memory.soft.moving:
        return _lost(memory, why)
    return _given_up(memory, turn, NotDoneKind.INTERRUPTED, why)


# --- reporting ------------------------------------------------------------------------------------


def report_act(memory: Memory, turn: Turn) -> Memory:
    """State reporting: send the outcome to ta."""
    act = _required(memory)
    turn.unwake(PATIENCE)
    if turn.holds(act.conversation):
        outgoing_messages.report(turn, act)
    else:
        turn.log("nobody waits for the outcome", level="warning", key=act.command.key)
    return replace(memory, act=None, last=act.command.key, soft=Soft())

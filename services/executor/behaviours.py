"""The behaviours of ex, bound by name to the states of the design (the paper leaves the states of
ex to us).

An act: the loop says where the robot stands, the skill process runs the skill and yields motions,
the loop carries them out, the outcome of the skill is reported. The intent is in the journal before
the first motion. So if agent or loop dies during an act, the outcome is `unknown`, the robot is
brought to rest, and nothing is started a second time. Must not know: plans, the geometry of skills.
"""

from functools import partial

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
from fipa_codec.performatives import Performative
from services.executor import device_messages, outgoing_messages
from services.executor.device_messages import (
    Brake,
    ByRays,
    Crashed,
    Drop,
    Ended,
    Felt,
    Halt,
    Lost,
    Move,
    Perform,
    Stands,
    Where,
)
from services.executor.memory import CONDITIONS, Act, Memory, Soft
from services.executor.motion_sequence import PATIENCE, follow, heard, logged, lost, over, start
from services.executor.situation_record import SituationRecord

RESTARTED = (fact(Kind.ENDED, "ex"),)
# estimate: the longest computation of a skill, a planned path home, takes some seconds
SKILL_WITHIN_S = 60.0


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
                act = Act(received.conversation, command)
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
    match heard(memory, turn):
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
            return over(memory, turn, end)
        case Lost() | Crashed() as end:
            return _given_up(memory, turn, NotDoneKind.INTERRUPTED, logged(turn, end))
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


def _required(memory: Memory) -> Act:
    assert memory.act is not None
    return memory.act


def _called_off(act: Act, event: Received | Broken) -> bool:
    """Whether ta cancels the act, or knows nothing of it any more."""
    called = isinstance(event, Broken) or event.communicate.performative is Performative.CANCEL
    return called and event.conversation == act.conversation


def _given_up(memory: Memory, turn: Turn, kind: str, why: Facts) -> Memory:
    turn.tell(Drop(memory.number))
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
            return start(memory, turn)
        case Started():
            return lost(memory, RESTARTED)
        case Received() | Broken() as event if _called_off(act, event):
            return replace(memory, act=replace(act, cancelling=True))
        case Received():
            return _declined(memory, turn)
    return follow(memory, turn)


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
            return _halted(lost(memory, act.lost or RESTARTED), turn)
        case Local(content=Stands(number=number, felt=felt)) if (
            act.lost and number == memory.number
        ):
            if _elsewhere(memory, felt):
                return _new_world(memory, felt)
            kept = _where(memory, felt)
            outcome = kept.remembered.not_done(act.command.key, NotDoneKind.UNKNOWN, act.lost)
            return replace(kept, act=replace(act, outcome=outcome))
        case Received() | Broken() as event if _called_off(act, event):
            return replace(memory, act=replace(act, cancelling=True))
        case Received():
            return _declined(memory, turn)
    if act.lost:
        return memory
    after = follow(memory, turn)
    if _required(after).lost:
        return _halted(after, turn)
    return start(after, turn) if after.soft.motion is not None else after


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

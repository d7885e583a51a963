"""The behaviours of ex's agent, bound by name to the states of the design (the paper leaves ex a group: all ours).

An act: the loop says where the robot stands, the worker runs the skill and yields motions, the loop carries them out,
the skill's outcome is reported. The intent is in the journal before the first motion, so after a death of agent or
loop in an act the outcome is `unknown`, the robot is brought to rest, and nothing is begun again. Must not know: plans,
skills' geometry.
"""

import numpy as np
from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Local, Received, Started, Woken
from agent_runtime.core.turn import Turn
from companion.binding import bind
from companion.languages import rc
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative
from services.executor import words
from services.executor.commands import wrong
from services.executor.doing import CONDITIONS, PATIENCE, Doing, Memory, Soft, follow, lost, start
from services.executor.words import Brake, Drop, Ended, Halt, Lost, Move, Perform, Stands, Where

SKILL_WITHIN_S = 60.0  # estimate: the longest computation of a skill, a way home with its planning, takes some seconds


def agent() -> Agent[Memory]:
    """ex's agent as the design has it."""
    return bind(
        "ex",
        Memory(),
        {
            "recover_act": recover_act,
            "await_act": await_act,
            "prepare_act": prepare_act,
            "act": act,
            "stop_act": stop_act,
            "report_act": report_act,
        },
        CONDITIONS,
        local=words.Local,
    )


# --- recovering, idle -------------------------------------------------------------------------------------------------


def recover_act(memory: Memory, turn: Turn) -> Memory:
    """recovering: whatever moves is brought to rest; the robot is where the loop says."""
    match turn.event:
        case Started() | None:
            turn.tell(Halt(memory.number))
        case Local(content=Stands(felt=felt)):
            return replace(_where(memory, felt), soft=Soft(felt=felt))
    return _declined(memory, turn)


def await_act(memory: Memory, turn: Turn) -> Memory:
    """idle: the next act is taken; one that was begun before, or makes no sense, is refused in words."""
    match turn.event:
        case Received(content=command) as received if isinstance(command, rc.Act):
            why = wrong(command)
            if not why and command.key == memory.last:
                why = f"act {command.key!r} was begun before; it is never begun again"
            if not why:
                doing = Doing(received.conversation, command)
                return replace(memory, number=memory.number + 1, doing=doing, soft=Soft())
            turn.say(received.conversation, Performative.REFUSE, rc.NotDone(command.key, "refused", why))
        case _:
            memory = _declined(memory, turn)
    return memory


def _declined(memory: Memory, turn: Turn) -> Memory:
    """In every other state a second act is refused; readings are not given out yet."""
    match turn.event:
        case Received(content=command) as received if isinstance(command, rc.Command):
            busy = memory.doing.command.key if memory.doing else "its recovery"
            reason = f"ex is busy with {busy}"
            turn.say(received.conversation, Performative.REFUSE, rc.NotDone(command.key, "busy", reason))
        case Received(communicate=word) as received if word.performative is Performative.SUBSCRIBE:
            turn.say(received.conversation, Performative.REFUSE)
    return memory


# --- preparing --------------------------------------------------------------------------------------------------------


def prepare_act(memory: Memory, turn: Turn) -> Memory:
    """preparing: the skill is computed from where the robot stands; its first motion makes the agreement."""
    doing = _required(memory)
    match turn.event:
        case None | Started():
            turn.wake(PATIENCE, turn.now + SKILL_WITHIN_S)
            turn.tell(Where(memory.number))
        case Local(content=Stands(number=number, felt=felt)) if number == memory.number:
            turn.tell(Perform(number, doing.command, memory.remembered, felt))
            return replace(memory, soft=replace(memory.soft, felt=felt))
        case Local(content=Move(number=number) as move) if number == memory.number:
            turn.say(doing.conversation, Performative.AGREE, rc.Accepted(doing.command.key, move.expected))
            doing = replace(doing, begun=True)
            soft = replace(memory.soft, motion=move.motion)
            return replace(memory, doing=doing, remembered=move.remembered, soft=soft)
        case Local(content=Ended(number=number, outcome=outcome, remembered=kept)) if number == memory.number:
            return replace(memory, doing=replace(doing, outcome=outcome), remembered=kept)
        case Local(content=Lost(number=number, reason=reason)) if number == memory.number:
            return _given_up(memory, turn, "interrupted", reason)
        case Local(content=words.Crashed(code=code)):
            return _given_up(memory, turn, "interrupted", f"the skill's process ended (exit status {code})")
        case Woken(name=name) if name == PATIENCE:
            return _given_up(memory, turn, "interrupted", f"the skill found no motion in {SKILL_WITHIN_S:g} s")
        case Received(communicate=word, conversation=name) if _cancels(doing, word.performative, name):
            memory = replace(memory, doing=replace(doing, cancelling=True))
            return _given_up(memory, turn, "cancelled", "cancelled before anything moved")
        case _:
            return _declined(memory, turn)
    return memory


def _required(memory: Memory) -> Doing:
    assert memory.doing is not None
    return memory.doing


def _cancels(doing: Doing, performative: Performative, conversation: str) -> bool:
    return performative is Performative.CANCEL and conversation == doing.conversation


def _given_up(memory: Memory, turn: Turn, kind: str, reason: str) -> Memory:
    turn.tell(Drop(memory.number))
    doing = _required(memory)
    outcome = memory.remembered.not_done(doing.command.key, kind, reason)
    return replace(memory, doing=replace(doing, outcome=outcome))


# --- acting and stopping ----------------------------------------------------------------------------------------------


def act(memory: Memory, turn: Turn) -> Memory:
    """acting: one motion after the other, until the skill has ended, is cancelled, or the loop is lost."""
    doing = _required(memory)
    match turn.event:
        case None:
            return start(memory, turn)
        case Started():
            return lost(memory, "the executor was restarted during the act")
        case Received(communicate=word, conversation=name) if _cancels(doing, word.performative, name):
            return replace(memory, doing=replace(doing, cancelling=True))
        case Received():
            return _declined(memory, turn)
    return follow(memory, turn)


def stop_act(memory: Memory, turn: Turn) -> Memory:
    """stopping: a cancelled skill makes safe what it began; after a loss the robot is only brought to rest."""
    doing = _required(memory)
    match turn.event:
        case None if doing.lost:
            return _halted(memory, turn)
        case None:
            if memory.soft.moving:
                turn.tell(Brake(memory.number, doing.command.key))
            return memory
        case Started():
            return _halted(lost(memory, doing.lost or "the executor was restarted while it stopped"), turn)
        case Local(content=Stands(number=number, felt=felt)) if doing.lost and number == memory.number:
            kept = _where(memory, felt)
            outcome = kept.remembered.not_done(doing.command.key, "unknown", doing.lost)
            return replace(kept, doing=replace(doing, outcome=outcome))
        case Received(communicate=word, conversation=name) if _cancels(doing, word.performative, name):
            return replace(memory, doing=replace(doing, cancelling=True))
        case Received():
            return _declined(memory, turn)
    if doing.lost:
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


def _where(memory: Memory, felt: words.Felt) -> Memory:
    q = tuple(float(x) for x in np.asarray(felt.setpoint()))
    return replace(memory, remembered=replace(memory.remembered, q=q, head=felt.head, time=felt.time))


# --- reporting --------------------------------------------------------------------------------------------------------


def report_act(memory: Memory, turn: Turn) -> Memory:
    """reporting: the outcome, in reply to the cancel if there was one that it answers."""
    doing = _required(memory)
    outcome = doing.outcome
    assert outcome is not None
    turn.unwake(PATIENCE)
    done = isinstance(outcome, rc.Done)
    if not turn.holds(doing.conversation):
        turn.log("nobody waits for the outcome", level="warning", key=doing.command.key)
    elif doing.cancelling and not done:
        turn.say(doing.conversation, Performative.INFORM, outcome, kind=Kind.CANCEL)
    else:
        act_of = {True: Performative.INFORM, False: Performative.FAILURE if doing.begun else Performative.REFUSE}[done]
        turn.say(doing.conversation, act_of, outcome)
        if doing.cancelling:
            turn.say(doing.conversation, Performative.FAILURE, Reason("the act had ended"), kind=Kind.CANCEL)
    return replace(memory, doing=None, last=doing.command.key, soft=Soft())

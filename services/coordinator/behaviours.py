"""The five behaviours of co (paper, section 5.5: trigger, procReq, compSP, schedule, switch), bound
to the design.

co waits in `trigger`, and in `compSP` while a plan is made; it passes procReq, schedule and switch
in one step. Both waiting states take messages in the same way (incoming.py). Must not know: clocks,
the wire.
"""

from functools import partial

import msgspec
from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import Transition
from agent_runtime.core.turn import Turn
from companion.design import AgentName, bind
from companion.languages.cmd import TaskState
from companion.languages.facts import Facts, Kind, fact
from fipa_codec.performatives import Performative as P
from services.coordinator import outgoing_messages as messages
from services.coordinator.incoming import RULE, leave, not_answering, requeued, suspend, take
from services.coordinator.memory import (
    CONDITIONS,
    Choice,
    Job,
    Limits,
    Memory,
    Stage,
    about,
    parameters_wanted,
    turn_come,
)
from services.coordinator.scheduling import RULES, comparing, decided, offer, place


def await_trigger(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State trigger: take messages; on entry forget that a task has ended."""
    if turn.event is None:
        return replace(memory, over=False, choice=Choice.OPEN)
    return take(memory, turn, limits)


def process_request(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State procReq: agree to a command and queue it, or refuse it."""
    for job in memory.arrived:
        if memory.loose or len(memory.jobs) >= limits.waiting:
            full = (fact(Kind.TASKS_OPEN, len(memory.jobs)),)
            why = not_answering(memory, turn) if memory.loose else full
            turn.say(job.conversation, P.REFUSE, messages.report(job, TaskState.FAILED, why))
            continue
        if job.command.start > turn.now:
            job = replace(job, stage=Stage.EARLY)
            turn.wake(job.conversation, job.command.start)
        memory = requeued(replace(memory, jobs=(*memory.jobs, job)), turn, limits)
        waiting = messages.report(job, TaskState.WAITING, (place(memory.jobs, job, turn.now),))
        turn.say(job.conversation, P.AGREE, waiting)
    return replace(memory, arrived=())


def compute_schedule_parameters(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State compSP: request the plan of the first task, or those of the others for their schedule
    parameters.

    A question about parameters is called off when the plan of the first task is wanted: the world
    is another one then.
    """
    if turn.event is not None:
        return take(memory, turn, limits)
    if (job := parameters_wanted(memory)) is not None:
        talk = _asked(turn, job, limits)
        return memory.with_job(replace(job, talk=talk, asked=True))
    job = memory.first
    if job is None or not turn_come(memory):
        return memory
    if (
        asked := next((one for one in memory.jobs if one.stage is Stage.WAITING and one.talk), None)
    ) is not None:
        turn.say(asked.talk, P.CANCEL, reply_by_s=limits.cancel_planning_s)
        return memory.with_job(replace(asked, recalled=True))
    chosen = _chosen(memory, turn, job, limits) if not job.begun else ()
    job = replace(job, plans=job.plans + 1, aside=False)
    talk = _asked(turn, job, limits)
    # tell hi once, not at each try, that co waits for the look around
    if job.looks < 2 or job.why != messages.LOOKS:
        why = fact(Kind.PLAN, job.plans, *(job.why or chosen))
        messages.progress(turn, job, TaskState.PLANNING, (why,))
    return memory.with_job(
        replace(job, stage=Stage.PLANNING, talk=talk, at=None, why=(), weighed=False)
    )


def _asked(turn: Turn, job: Job, limits: Limits) -> str:
    """Ask pl for the plan of a task; the conversation."""
    network, patience_s = messages.network(job), limits.planning_s
    return turn.open(
        AgentName.PL, "request", P.REQUEST, network, reply_by_s=patience_s, parent=job.conversation
    )


def _chosen(memory: Memory, turn: Turn, job: Job, limits: Limits) -> Facts:
    """Why this task is the next one, where it passes one that came before it; () else. Logged with
    the rule.
    """
    waiting = [one for one in memory.jobs if one.waits]
    if job.arrived <= min(one.arrived for one in waiting):
        return ()
    rule = comparing(RULES[turn.parameter(RULE, str)], waiting)
    decision = rule(None, tuple(offer(one, memory.jobs) for one in waiting), turn.now)
    if decision is None or decision.task != job.conversation:
        return ()
    name = next(name for name, one in RULES.items() if one is rule)
    turn.log(
        "next", conversation=job.conversation, rule=name, why=decision.why.kind, of=len(waiting)
    )
    return (decision.why,)


def schedule(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State schedule: continue with the running plan, or switch to the one that is ready, or to a
    task that waits.
    """
    running = memory.first
    if running is None or not running.leavable:
        ready = running is not None and running.left_with_plan
        return replace(memory, choice=Choice.SWITCH if ready else Choice.CONTINUE)
    memory = decided(memory, turn.now, RULES[turn.parameter(RULE, str)])
    decision = memory.decision
    if decision is not None:
        turn.log("decision", **{**msgspec.structs.asdict(decision), "why": decision.why.kind})
        if not decision.switch and (rival := memory.of_hi(decision.rival)) is not None:
            why = about(Kind.GOES_ON, running, decision.why)
            messages.progress(turn, rival, TaskState.WAITING, (why,))
    ready = running.stage is Stage.PLANNED or (decision is not None and decision.switch)
    return replace(memory, choice=Choice.SWITCH if ready else Choice.CONTINUE)


def switch_plan(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State switch: request ta to run the plan, with its reply-by; first to leave the running one,
    if there is one.

    A plan that is needed only to put down what is held is to be left at once.
    """
    job = memory.first
    if job is None or not (job.leavable or job.left_with_plan):
        return memory
    if memory.decision is not None and memory.decision.switch and job.leavable:
        memory = replace(suspend(memory, turn, job, limits), choice=Choice.OPEN)
        job = memory.first
    if job is None or (plan := job.plan) is None:
        return memory
    patience_s = limits.acting_s(plan)
    talk = turn.open(
        AgentName.TA, "coordinate", P.REQUEST, plan, reply_by_s=patience_s, parent=job.conversation
    )
    takes = (fact(Kind.PLAN_TAKES, job.plans, plan.duration),)
    messages.progress(turn, job, TaskState.RUNNING, takes, messages.steps(plan))
    job = replace(job, stage=Stage.RUNNING, talk=talk, plan=None, aside=False, asks=False)
    job = replace(job, patience_s=patience_s)
    if job.cancelling or job.suspending:
        leave(turn, job, limits)
    return replace(memory.with_job(job), choice=Choice.OPEN)


def agent(limits: Limits | None = None) -> Agent[Memory]:
    states = (await_trigger, process_request, compute_schedule_parameters, schedule, switch_plan)
    limited = {state.__name__: partial(state, limits=limits or Limits()) for state in states}
    behaviours: dict[str, Transition[Memory]] = {**limited}
    return bind(AgentName.CO, Memory(), behaviours, CONDITIONS)

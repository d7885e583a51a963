"""The five behaviours of co (paper, section 5.5: trigger, procReq, compSP, schedule, switch), bound to the design.

co waits in `trigger`, and in `compSP` while a plan is made; it passes procReq, schedule and switch in one step.
Both waiting states take messages in the same way (incoming.py). Must not know: clocks, the wire.
"""

from functools import partial

from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.turn import Turn
from companion.binding import Transition, bind
from companion.design import AgentName
from companion.languages.cmd import TaskState
from fipa_codec.performatives import Performative as P
from services.coordinator import words
from services.coordinator.incoming import not_answering, suspend, take
from services.coordinator.memory import CONDITIONS, Choice, Job, Limits, Memory, Stage, overtaken, plan_wanted
from services.coordinator.offers import queued


def await_trigger(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State trigger: take messages; on entry forget that a task has ended."""
    if turn.event is None:
        return replace(memory, over=False, choice=Choice.OPEN)
    return take(memory, turn, limits)


def process_request(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State procReq: agree to a command and queue it, or refuse it."""
    for job in memory.arrived:
        why_not = _why_not(memory, turn, limits)
        if why_not:
            turn.say(job.conversation, P.REFUSE, words.report(TaskState.FAILED, why_not))
            continue
        memory = replace(memory, jobs=queued((*memory.jobs, job), turn.now))
        turn.say(job.conversation, P.AGREE, words.report(TaskState.WAITING, words.place(memory.jobs.index(job))))
    return replace(memory, arrived=())


def _why_not(memory: Memory, turn: Turn, limits: Limits) -> str:
    if memory.loose:
        return f"busy: {not_answering(memory, turn)}"
    if len(memory.jobs) >= limits.waiting:
        return f"busy: {len(memory.jobs)} tasks are open already; wait for one, or cancel one"
    return ""


def compute_schedule_parameters(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State compSP: request the plan of the first task; its duration is in the plan."""
    if turn.event is not None:
        return take(memory, turn, limits)
    job = memory.first
    if job is None or not plan_wanted(memory):
        return memory
    job = replace(job, plans=job.plans + 1, aside=False)
    talk = turn.open(AgentName.PL, "request", P.REQUEST, words.network(job), reply_by_s=limits.planning_s)
    if job.looks < 2 or job.at != words.LOOKS:
        words.progress(turn, job, TaskState.PLANNING, f"plan {job.plans}" + (f": {job.at}" if job.at else ""))
    return memory.with_job(replace(job, stage=Stage.PLANNING, talk=talk, at=""))


def schedule(memory: Memory, turn: Turn) -> Memory:
    """State schedule: continue with the running plan, or switch to the one that is ready, or from a less urgent one."""
    return replace(memory, choice=Choice.SWITCH if overtaken(memory) else decide(memory.jobs))


def decide(jobs: tuple[Job, ...]) -> Choice:
    """In order of the queue: switch when the first task has its plan and nothing runs.

    Costs and suspension (TaskER) are not considered yet.
    """
    running = any(job.stage is Stage.RUNNING for job in jobs)
    ready = bool(jobs) and jobs[0].stage is Stage.PLANNED
    return Choice.SWITCH if ready and not running else Choice.CONTINUE


def switch_plan(memory: Memory, turn: Turn, *, limits: Limits) -> Memory:
    """State switch: request ta to run the plan, with its reply-by; first to leave the running one, if there is one."""
    if (running := overtaken(memory)) is not None:
        return replace(suspend(memory, turn, running, limits), choice=Choice.OPEN)
    job = memory.first
    if job is None or job.plan is None:
        return memory
    plan = job.plan
    talk = turn.open(AgentName.TA, "coordinate", P.REQUEST, plan, reply_by_s=limits.acting_s(plan))
    text = f"plan {job.plans} takes about {plan.duration:.0f} s"
    words.progress(turn, job, TaskState.RUNNING, text, words.steps(plan))
    job = replace(job, stage=Stage.RUNNING, talk=talk, plan=None, aside=False)
    return replace(memory.with_job(job), choice=Choice.OPEN)


def agent(limits: Limits | None = None) -> Agent[Memory]:
    """Return the agent co."""
    kept = limits or Limits()
    behaviours: dict[str, Transition[Memory]] = {
        "await_trigger": partial(await_trigger, limits=kept),
        "process_request": partial(process_request, limits=kept),
        "compute_schedule_parameters": partial(compute_schedule_parameters, limits=kept),
        "schedule": schedule,
        "switch_plan": partial(switch_plan, limits=kept),
    }
    return bind(AgentName.CO, Memory(), behaviours, CONDITIONS)

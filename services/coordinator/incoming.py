"""How co takes messages and late replies on channels C1, C2 and C3, in any state.

Each case is a `row` of agent co in companion/design.toml, which `roco design verify` proves;
docs/delivery.md has the promises that it builds on. Every inform of ta is confirmed in the step
that takes it. A cancel of hi is answered after the last message of pl or ta. When a reply-by
passes, hi is told at once, the peer is cancelled, and the conversation stays in `loose` until its
end. Must not know: states and arcs.
"""

from collections.abc import Callable

from msgspec.structs import replace

from agent_runtime.core.events import Broken, Late, Received, Woken
from agent_runtime.core.turn import Turn
from companion.autonomy import WAIT_S
from companion.design import AgentName
from companion.languages import hfsm, sw
from companion.languages.cmd import TaskState
from companion.languages.facts import Facts, Kind, fact
from companion.languages.sw import WorkerState
from companion.sentences import operator
from fipa_codec.languages import Reason
from fipa_codec.performatives import Performative as P
from services.coordinator import outgoing_messages as messages
from services.coordinator.memory import Job, Limits, Memory, Stage, about
from services.coordinator.scheduling import RULES, first_in, queued

PATIENCE = "patience"
"""Name of the wake-up after which tasks no longer wait for a late peer."""
RULE = "rule"
"""Parameter of the design: the rule of scheduling.py by which the next task is chosen."""
_LEFT = (WorkerState.PREEMPTED, WorkerState.REPLAN)
"""Final states of a plan that ta was asked to leave: it left it, or it wanted a new one when the
cancel came.
"""


def take(memory: Memory, turn: Turn, limits: Limits) -> Memory:
    """The memory after the event of the turn; unchanged if it concerns no task."""
    match turn.event:
        case Received() as received:
            memory = _FROM[received.communicate.sender](memory, turn, received, limits)
        case Late(conversation=name) if (job := memory.of_talk(name)) is not None:
            memory = _on_late(memory, turn, job, limits)
        case Broken(conversation=name, reason=reason):
            turn.log("broken", level="warning", conversation=name, why=reason)
            memory = _on_broken(memory, turn, name, limits)
        case Woken(name=name) if name == PATIENCE:
            memory = _out_of_patience(memory, turn)
        case Woken(name=name) if (
            job := memory.of_hi(name)
        ) is not None and job.stage is Stage.EARLY:
            memory = requeued(memory.with_job(replace(job, stage=Stage.WAITING)), turn, limits)
    loose = tuple(name for name in memory.loose if turn.holds(name))
    if memory.loose and not loose:
        turn.unwake(PATIENCE)
    return memory if loose == memory.loose else replace(memory, loose=loose)


def requeued(memory: Memory, turn: Turn, limits: Limits) -> Memory:
    """The memory with its tasks in the order in which they are done."""
    rule = RULES[turn.parameter(RULE, str)]
    return replace(memory, jobs=queued(memory.jobs, turn.now, rule))


# --- hi -------------------------------------------------------------------------------------------


def _from_hi(memory: Memory, turn: Turn, received: Received, limits: Limits) -> Memory:
    name, content = received.conversation, received.content
    match received.communicate.performative:
        case P.REQUEST:
            return replace(memory, arrived=(*memory.arrived, Job(name, content, turn.now)))
        case P.CANCEL | P.NOT_UNDERSTOOD if (job := memory.of_hi(name)) is not None:
            return cancel(memory, turn, job, limits)
    return memory


def cancel(memory: Memory, turn: Turn, job: Job, limits: Limits) -> Memory:
    """Cancel a task of hi: one that nobody works on ends at once, another one when pl or ta says
    so.

    Where objects of it may be in a hand, its next plan is made all the same: ta gets it, and leaves
    it safely.
    """
    if job.may_hold and job.stage in (Stage.PLANNING, Stage.PLANNED):
        return memory.with_job(replace(job, cancelling=True))
    if not job.talk:
        turn.unwake(job.conversation)
        messages.cancelled(
            turn, job, (fact(Kind.PUT_ASIDE if job.suspended else Kind.NOT_BEGUN_YET),)
        )
        return memory.without_job(job)
    if not (job.cancelling or job.suspending or job.recalled):
        if job.stage is Stage.RUNNING:
            leave(turn, job, limits)
        else:
            turn.say(job.talk, P.CANCEL, reply_by_s=limits.cancel_planning_s)
    return memory.with_job(replace(job, cancelling=True, recalled=job.stage is Stage.WAITING))


def suspend(memory: Memory, turn: Turn, job: Job, limits: Limits) -> Memory:
    """Have ta leave a task safely, as for a cancel; it is planned again when its turn comes. One
    that is only planned waits at once, or when ta has put down what may be in a hand.
    """
    if job.stage is Stage.PLANNED and not job.may_hold:
        return _suspended(memory, turn, job, limits)
    if job.stage is Stage.RUNNING:
        leave(turn, job, limits)
    messages.progress(turn, job, TaskState.RUNNING, _rival(memory))
    return memory.with_job(replace(job, suspending=True))


def leave(turn: Turn, job: Job, limits: Limits) -> None:
    """Ask ta to leave the plan of a task safely."""
    turn.say(job.talk, P.CANCEL, reply_by_s=limits.cancel_acting_s)


def _rival(memory: Memory) -> Facts:
    """The task for which another one is left, and why; () where it is gone."""
    decision = memory.decision
    rival = memory.of_hi(decision.task) if decision is not None else None
    if rival is None or decision is None:
        return ()
    return (about(Kind.LEFT_FOR, rival, decision.why),)


# --- pl -------------------------------------------------------------------------------------------


def _from_pl(memory: Memory, turn: Turn, received: Received, limits: Limits) -> Memory:
    job = memory.of_talk(received.conversation)
    if job is None or received.communicate.performative is P.AGREE:
        return memory
    planned = isinstance(received.content, hfsm.HierarchicalPlan)
    if job.cancelling and not (job.left_with_plan and planned):
        if turn.holds(job.talk):
            return memory
        return _cancelled(memory, turn, job, (fact(Kind.WHILE_PLANNED),))
    if job.stage is Stage.WAITING:
        if turn.holds(job.talk):
            return memory
        # Without a plan it goes on without schedule parameters: what cannot be planned now may be
        # when its turn comes.
        if planned and not job.recalled:
            job = _with_schedule(job, received.content)
        return requeued(memory.with_job(replace(job, talk="", recalled=False)), turn, limits)
    if isinstance(received.content, hfsm.HierarchicalPlan):
        plan = replace(received.content, rejected=())
        meant = job.meant or job.command.settled(plan)
        return memory.with_job(
            replace(_with_schedule(job, plan), stage=Stage.PLANNED, plan=plan, meant=meant)
        )
    if (
        isinstance(received.content, hfsm.NoPlan)
        and received.content.later
        and job.looks < limits.looks
    ):
        again = replace(job, stage=Stage.WAITING, talk="", why=messages.LOOKS)
        again = replace(again, plans=job.plans - 1, looks=job.looks + 1)
        return memory.with_job(again)
    return _failed(memory, turn, job, _why(turn, received))


def _with_schedule(job: Job, plan: hfsm.HierarchicalPlan) -> Job:
    """The task with the schedule parameters of a plan, whose conversation is over."""
    return replace(job, talk="", schedule=plan.schedule, holds=len(plan.holds), weighed=False)


# --- ta -------------------------------------------------------------------------------------------


def _from_ta(memory: Memory, turn: Turn, received: Received, limits: Limits) -> Memory:
    said = received.content
    job = memory.of_talk(received.conversation)
    state = said.state if isinstance(said, sw.Report) else None
    if received.communicate.performative is P.INFORM:
        waits = state is WorkerState.WAITING and job is not None and job.leavable
        # while its plan waits for an operator
        more_s = WAIT_S + job.patience_s if waits and job is not None else None
        turn.say(
            received.conversation,
            P.CONFIRM,
            in_reply_to=received.communicate.reply_with,
            reply_by_s=more_s,
        )
    if job is None:
        return memory
    if isinstance(said, sw.Report) and state not in sw.FINAL:
        return _on_progress(memory, turn, job, said)
    why, evidence = (said.why, said.evidence) if isinstance(said, sw.Report) else ((), ())
    if isinstance(said, sw.Report):
        job = replace(job, hands=said.hands)
    if state is WorkerState.SUCCEEDED:
        messages.done(turn, job, why or (fact(Kind.TOOK, round(turn.now - job.arrived)),), evidence)
        return memory.without_job(job)
    if job.cancelling:
        return _cancelled(memory, turn, job, why)
    if state in _LEFT and job.suspending:
        return _suspended(memory, turn, job, limits)
    if state is WorkerState.REPLAN:
        return _on_replan(memory, turn, job, why, limits)
    messages.failed(turn, job, _why(turn, received), evidence)
    return memory.without_job(job)


def _why(turn: Turn, received: Received) -> Facts:
    """The reason in a refusal, failure or report."""
    sender = AgentName(received.communicate.sender)
    match received.content:
        case hfsm.NoPlan(why=why) | sw.Report(why=why) if why:
            return why
        case Reason(text=text):
            turn.log("refused", level="warning", conversation=received.conversation, why=text)
    understood = received.communicate.performative is not P.NOT_UNDERSTOOD
    return (fact(Kind.NO_REASON if understood else Kind.NOT_UNDERSTOOD, sender),)


def _on_progress(memory: Memory, turn: Turn, job: Job, said: sw.Report) -> Memory:
    same = (said.at, said.why, said.hands) == (job.at, job.why, job.hands)
    job = replace(job, hands=said.hands)
    if said.state is WorkerState.WAITING:
        messages.asks(turn, job, said)
        return memory.with_job(replace(job, at=said.at, asks=True))
    if same and not job.asks:
        return memory
    messages.progress(turn, job, TaskState.RUNNING, said.why, at=said.at)
    return memory.with_job(replace(job, at=said.at, why=said.why, asks=False))


def _on_replan(memory: Memory, turn: Turn, job: Job, why: Facts, limits: Limits) -> Memory:
    """Have the task planned again with the new observations; give up after `replans` plans."""
    why = why or (fact(Kind.NEW_PLAN_WANTED),)
    if job.plans - job.suspended > limits.replans:
        return _failed(memory, turn, job, (fact(Kind.GIVEN_UP, job.plans, *why),))
    turn.log("replan", conversation=job.conversation, plans=job.plans, why=operator(why))
    return memory.changed().with_job(replace(job, stage=Stage.WAITING, talk="", at=None, why=why))


def _suspended(memory: Memory, turn: Turn, job: Job, limits: Limits) -> Memory:
    """Put a task aside that ta has left; it waits like others, for a plan made of what the world is
    then.

    Its schedule parameters until then: the rest where it was left, and the time to be there again.
    """
    messages.progress(turn, job, TaskState.SUSPENDED, _rival(memory))
    here = job.parameters
    left = () if here is None else (hfsm.ScheduleParameters("", here.rest + here.resume),)
    job = replace(job, stage=Stage.WAITING, talk="", plan=None, at=None, why=(), suspending=False)
    job = replace(job, aside=True, schedule=left)
    memory = memory.changed().with_job(
        replace(job, suspended=job.suspended + 1, asked=False, weighed=False)
    )
    memory = requeued(memory, turn, limits)
    return replace(memory, jobs=first_in(memory.jobs, memory.decision))


# --- ends -----------------------------------------------------------------------------------------


def _cancelled(memory: Memory, turn: Turn, job: Job, why: Facts) -> Memory:
    messages.cancelled(turn, job, why)
    return memory.without_job(job)


def _failed(memory: Memory, turn: Turn, job: Job, why: Facts) -> Memory:
    messages.failed(turn, job, why)
    return memory.without_job(job)


def _on_late(memory: Memory, turn: Turn, job: Job, limits: Limits) -> Memory:
    """The reply-by has passed: tell hi, cancel at the peer (if not done yet), and keep the
    conversation as loose.

    A question about schedule parameters is called off first; the task ends only where that is not
    answered, either.
    """
    who = AgentName(turn.conversation(job.talk).peer)
    turn.log("late", level="warning", conversation=job.talk, task=job.conversation)
    if job.stage is Stage.WAITING and not job.recalled:
        turn.say(job.talk, P.CANCEL, reply_by_s=limits.cancel_planning_s)
        return memory.with_job(replace(job, recalled=True))
    if job.left_with_plan or not (job.cancelling or job.suspending or job.recalled):
        turn.say(job.talk, P.CANCEL)
    messages.failed(turn, job, (fact(Kind.NOT_ANSWERED, who),))
    turn.wake(PATIENCE, turn.now + limits.patience_s)
    memory = memory.without_job(job)
    return replace(memory, loose=(*memory.loose, job.talk))


def _on_broken(memory: Memory, turn: Turn, name: str, limits: Limits) -> Memory:
    """End the task of a broken conversation: the peer sent what could not be taken, or lost its
    memory.
    """
    if (job := memory.of_hi(name)) is not None:
        return cancel(memory, turn, job, limits)
    if (job := memory.of_talk(name)) is None:
        return memory
    why = (fact(Kind.BROKE_OFF, AgentName.PL if job.stage is Stage.PLANNING else AgentName.TA),)
    return (_cancelled if job.cancelling else _failed)(memory, turn, job, why)


def _out_of_patience(memory: Memory, turn: Turn) -> Memory:
    """End the tasks that wait, since the late peer does not answer; one that runs does not need the
    planner.
    """
    if not memory.loose:
        return memory
    for job in [job for job in memory.jobs if job.stage is not Stage.RUNNING]:
        memory = _failed(
            memory, turn, job, (fact(Kind.SAY_AGAIN_LATER, not_answering(memory, turn)),)
        )
    return memory


def not_answering(memory: Memory, turn: Turn) -> Facts:
    """Who is late."""
    late = dict.fromkeys(turn.conversation(name).peer for name in memory.loose if turn.holds(name))
    return tuple(fact(Kind.NOT_ANSWERING, peer) for peer in late or (AgentName.TA,))


_FROM: dict[str, Callable[[Memory, Turn, Received, Limits], Memory]] = {
    AgentName.HI: _from_hi,
    AgentName.PL: _from_pl,
    AgentName.TA: _from_ta,
}

"""Messages of co: tasks for pl, reports for hi. What co says to ta is in behaviours (request) and
incoming (confirm, cancel).

Reports stay within their size budget on C2 (500 bytes with the envelope). Must not know: which
state co is in.
"""

import msgspec

from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages import evidence, facts, hfsm, sw
from companion.languages.cmd import TaskReport, TaskState
from companion.languages.evidence import Evidence
from companion.languages.facts import Facts, Kind, fact
from companion.languages.hfsm import Place, Step
from fipa_codec import languages
from fipa_codec.performatives import Performative
from services.coordinator.memory import Job

MOST_BYTES = 280
"""Of the facts of a report: a budget of 500, less at most 200 for the envelope, less the frame of
the report.
"""
LONGEST_STEPS = 200
"""Bytes of the steps of a plan, which the shortest of reasons goes with; estimate: a pour has
80.
"""
LOOKS = (fact(Kind.LOOKS_FIRST),)


def network(job: Job) -> hfsm.GroundTaskNetwork:
    """The task network of a command, named by task and number of the plan."""
    return hfsm.GroundTaskNetwork(
        f"{job.conversation}-plan{job.plans}", (job.meant or job.command.task,)
    )


def report(job: Job, state: TaskState, why: Facts, known: tuple[Evidence, ...] = ()) -> TaskReport:
    """A report with as many of the reasons, then of the evidence, as there is room for."""
    room = MOST_BYTES - len(msgspec.msgpack.encode(job.hands))
    told = facts.fitting(facts.different(why), room)
    room -= len(msgspec.msgpack.encode(told))
    return TaskReport(state, told, evidence=evidence.fitting(known, room), hands=job.hands)


def steps(plan: hfsm.HierarchicalPlan) -> tuple[Step, ...]:
    """What a plan does one after the other, as a person follows it: the parts with acts; cut to the
    budget.
    """
    machines = (state for state in plan.root.states if isinstance(state, hfsm.Machine))
    found = [state.step for state in machines if state.step is not None]
    while len(msgspec.msgpack.encode(found)) > LONGEST_STEPS:
        found.pop()
    return tuple(found)


# --- to hi ----------------------------------------------------------------------------------------


def progress(
    turn: Turn,
    job: Job,
    state: TaskState,
    why: Facts,
    steps: tuple[Step, ...] = (),
    at: Place | None = None,
) -> None:
    """Tell hi the progress of its task; not while hi is away, since a full outbox would stop co."""
    if AgentName.HI in turn.peers and turn.holds(job.conversation):
        room = MOST_BYTES - len(msgspec.msgpack.encode((at, job.hands)))
        number = job.number(at)
        begun = job.schedule and (number or steps)
        told = TaskReport(
            state,
            facts.fitting(why, room),
            steps,
            at,
            number,
            rest=job.schedule[max(number - 1, 0)].rest if begun else 0.0,
            hands=job.hands,
        )
        turn.say(job.conversation, Performative.INFORM, told)


def asks(turn: Turn, job: Job, said: sw.Report) -> None:
    """Tell hi which leaf of the plan waits for an operator.

    Also while hi is away, since nothing goes on before somebody has read it: one message for each
    wait.
    """
    if turn.holds(job.conversation):
        number = job.number(said.at)
        told = TaskReport(TaskState.RUNNING, at=said.at, number=number, asks=True, hands=job.hands)
        turn.say(job.conversation, Performative.INFORM, told)


def done(turn: Turn, job: Job, why: Facts, known: tuple[Evidence, ...]) -> None:
    """Tell hi that the task is done, and how that is known; a cancel that crossed it came too
    late.
    """
    _last(turn, job, Performative.INFORM, report(job, TaskState.DONE, why, known))


def failed(turn: Turn, job: Job, why: Facts, known: tuple[Evidence, ...] = ()) -> None:
    """Tell hi that the task failed, and why; then answer a cancel that crossed it."""
    _last(turn, job, Performative.FAILURE, report(job, TaskState.FAILED, why, known))


def cancelled(turn: Turn, job: Job, why: Facts) -> None:
    """Answer the cancel; this ends the task."""
    if turn.holds(job.conversation):
        told = report(job, TaskState.CANCELLED, why)
        turn.say(job.conversation, Performative.INFORM, told, kind=languages.Kind.CANCEL)


def _last(turn: Turn, job: Job, performative: Performative, said: TaskReport) -> None:
    if not turn.holds(job.conversation):
        return
    turn.say(job.conversation, performative, said)
    if job.cancelling:
        too_late = languages.Reason(f"the task was {said.state} before it could be cancelled")
        turn.say(job.conversation, Performative.FAILURE, too_late, kind=languages.Kind.CANCEL)

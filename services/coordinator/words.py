"""Messages of co: tasks for pl, reports for hi, the reasons that others give.

Reports stay within their size budget on C2 (500 bytes with the envelope). Must not know: which state co is in.
"""

from typing import Any

from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages import cmd, hfsm, sw
from companion.languages.cmd import TaskReport, TaskState
from companion.languages.evidence import Evidence, fitting
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative
from services.coordinator.memory import Job

LONGEST_TEXT = 280
"""Bytes of the text of a report: a budget of 500, less at most 200 for the envelope, less the frame of the report."""
LONGEST_STEPS = 200
"""Bytes of the steps of a plan, which the shortest of texts goes with; estimate: a pour has 80."""
LOOKS = "the robot looks around first"


def network(job: Job) -> hfsm.GroundTaskNetwork:
    """Return the task network of a command, named by task and number of the plan."""
    return hfsm.GroundTaskNetwork(f"{job.conversation}-plan{job.plans}", (job.meant or ground_task(job.command),))


def ground_task(command: cmd.Task) -> hfsm.Task:
    """Return the task of the planning domain for a command."""
    match command:
        case cmd.PourInto(source=source, destination=destination):
            return hfsm.Task(hfsm.TaskName.POUR, (source, destination))
        case cmd.Take(object=thing, side=side):
            return hfsm.Task(hfsm.TaskName.TAKE, (thing, side))
        case cmd.Bring(object=thing, side=side):
            return hfsm.Task(hfsm.TaskName.BRING, (thing, side))
        case cmd.SwapHands(object=thing):
            return hfsm.Task(hfsm.TaskName.SWAP_HANDS, (thing,))
        case cmd.PutDown(object=thing, place=""):
            return hfsm.Task(hfsm.TaskName.PUT_DOWN, (thing,))
        case cmd.PutDown(object=thing, place=place):
            return hfsm.Task(hfsm.TaskName.PUT_AT, (thing, place))
        case cmd.ClearTable():
            return hfsm.Task(hfsm.TaskName.CLEAR_TABLE, ())
        case cmd.LookAround():
            return hfsm.Task(hfsm.TaskName.LOOK_AROUND, ())


def settled(command: cmd.Task, plan: hfsm.HierarchicalPlan) -> hfsm.Task | None:
    """Return the task that later plans are for, where this plan settled what the words mean; None for the same task.

    Hands can be swapped only while one of them is full: the plan says which thing is in which hand at its end.
    """
    match command, tuple(plan.holds.items()):
        case cmd.SwapHands(), ((side, thing),):
            return hfsm.Task(hfsm.TaskName.BRING, (thing, side))
    return None


def report(state: TaskState, text: str, evidence: tuple[Evidence, ...] = ()) -> TaskReport:
    """Return a report, its text cut to the budget, with as much of the evidence as there is room for."""
    words = cut(text)
    return TaskReport(state, words, evidence=fitting(evidence, LONGEST_TEXT - len(words.encode())))


def called(job: Job) -> str:
    """Return a task in words: its name, and what it is."""
    task = ground_task(job.command)
    return f"{job.conversation} ({' '.join(word for word in (task.name.replace('_', ' '), *task.arguments) if word)})"


def steps(plan: hfsm.HierarchicalPlan) -> tuple[str, ...]:
    """Return what a plan does one after the other, as a person follows it: the parts with acts; cut to the budget."""
    names = [state.name for state in plan.root.states if isinstance(state, hfsm.Machine)]
    while sum(len(name.encode()) + 3 for name in names) > LONGEST_STEPS:
        names.pop()
    return tuple(names)


def cut(text: str, longest: int = LONGEST_TEXT) -> str:
    """Return the text, cut to at most `longest` bytes of UTF-8."""
    data = text.encode(errors="replace")
    return text if len(data) <= longest else data[: longest - 3].decode(errors="ignore") + "…"


def reason(content: Any) -> str:
    """Return the reason in a refusal, failure or report; "" if there is none."""
    match content:
        case hfsm.NoPlan(reason=text) | Reason(text=text):
            return text
        case _:
            return getattr(content, "reason", "") or getattr(content, "text", "")


# --- to hi ------------------------------------------------------------------------------------------------------------


def progress(turn: Turn, job: Job, state: TaskState, text: str, steps: tuple[str, ...] = ()) -> None:
    """Tell hi the progress of its task; not while hi is away, since a full outbox would stop co."""
    if AgentName.HI in turn.peers and turn.holds(job.conversation):
        turn.say(job.conversation, Performative.INFORM, TaskReport(state, cut(text), steps))


def asks(turn: Turn, job: Job, said: sw.Report) -> None:
    """Tell hi which leaf of the plan waits for an operator, and with which hand it is done.

    Also while hi is away, since nothing goes on before somebody has read it: one message for each wait.
    """
    if turn.holds(job.conversation):
        text = cut(said.reason, LONGEST_TEXT - LONGEST_STEPS)
        turn.say(job.conversation, Performative.INFORM, TaskReport(TaskState.RUNNING, text, asks=said.at))


def done(turn: Turn, job: Job, text: str, evidence: tuple[Evidence, ...]) -> None:
    """Tell hi that the task is done, and how that is known; a cancel that crossed it came too late."""
    _last(turn, job, Performative.INFORM, report(TaskState.DONE, text, evidence))


def failed(turn: Turn, job: Job, text: str, evidence: tuple[Evidence, ...] = ()) -> None:
    """Tell hi that the task failed, and why; then answer a cancel that crossed it."""
    _last(turn, job, Performative.FAILURE, report(TaskState.FAILED, text, evidence))


def cancelled(turn: Turn, job: Job, text: str) -> None:
    """Answer the cancel; this ends the task."""
    if turn.holds(job.conversation):
        turn.say(job.conversation, Performative.INFORM, report(TaskState.CANCELLED, text), kind=Kind.CANCEL)


def _last(turn: Turn, job: Job, performative: Performative, said: TaskReport) -> None:
    if not turn.holds(job.conversation):
        return
    turn.say(job.conversation, performative, said)
    if job.cancelling:
        too_late = Reason(f"the task was {said.state} before it could be cancelled")
        turn.say(job.conversation, Performative.FAILURE, too_late, kind=Kind.CANCEL)

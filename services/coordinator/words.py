"""What co says: tasks for pl, reports for hi, and the reasons of others in words.

Reports stay within their size budget on C2 (500 bytes with the envelope). Must not know: which state co is in.
"""

from typing import Any

from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages import cmd, hfsm
from companion.languages.cmd import TaskReport, TaskState
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative
from services.coordinator.memory import Job

LONGEST_TEXT = 280
"""Bytes of a report's text: 500 of the budget, less an envelope of at most 200 and the report's frame."""
LOOKS = "the robot looks around first"


def network(job: Job) -> hfsm.GroundTaskNetwork:
    """The ground task of a command, named by task and number of the plan."""
    return hfsm.GroundTaskNetwork(f"{job.conversation}-plan{job.plans}", (ground_task(job.command),))


def ground_task(command: cmd.Task) -> hfsm.Task:
    """The task of the planning domain that does a command."""
    match command:
        case cmd.PourInto(source=source, destination=destination):
            return hfsm.Task("pour", (source, destination))
        case cmd.Take(object=thing, side=side):
            return hfsm.Task("take", (thing, side))
        case cmd.PutDown(object=thing):
            return hfsm.Task("put_down", (thing,))
        case cmd.LookAround():
            return hfsm.Task("look_around", ())


def report(state: TaskState, text: str) -> TaskReport:
    """A report whose text was cut to its budget."""
    return TaskReport(state, cut(text))


def place(ahead: int) -> str:
    """A task's place in the queue, in words."""
    if not ahead:
        return "it is the next one"
    return "one task comes before it" if ahead == 1 else f"{ahead} tasks come before it"


def cut(text: str, longest: int = LONGEST_TEXT) -> str:
    """The text in at most `longest` bytes of UTF-8."""
    data = text.encode(errors="replace")
    return text if len(data) <= longest else data[: longest - 3].decode(errors="ignore") + "…"


def reason(content: Any) -> str:
    """Why, in words, from whatever a refusal, failure or report carries; "" where it says nothing."""
    match content:
        case hfsm.NoPlan(reason=text) | Reason(text=text):
            return text
        case _:
            return getattr(content, "reason", "") or getattr(content, "text", "")


# --- to hi ------------------------------------------------------------------------------------------------------------


def progress(turn: Turn, job: Job, state: TaskState, text: str) -> None:
    """Tell hi how far its task is; not while hi is away, since an outbox that fills up would stop co itself."""
    if AgentName.HI in turn.peers and turn.holds(job.conversation):
        turn.say(job.conversation, Performative.INFORM, report(state, text))


def done(turn: Turn, job: Job, text: str) -> None:
    """The task's result; a cancel that was on its way came too late."""
    _last(turn, job, Performative.INFORM, report(TaskState.DONE, text))


def failed(turn: Turn, job: Job, text: str) -> None:
    """The task failed, and why; a cancel on its way is answered behind it."""
    _last(turn, job, Performative.FAILURE, report(TaskState.FAILED, text))


def cancelled(turn: Turn, job: Job, text: str) -> None:
    """The cancel's answer, which ends the task."""
    if turn.holds(job.conversation):
        turn.say(job.conversation, Performative.INFORM, report(TaskState.CANCELLED, text), kind=Kind.CANCEL)


def _last(turn: Turn, job: Job, performative: Performative, said: TaskReport) -> None:
    if not turn.holds(job.conversation):
        return
    turn.say(job.conversation, performative, said)
    if job.cancelling:
        too_late = Reason(f"the task was {said.state} before it could be cancelled")
        turn.say(job.conversation, Performative.FAILURE, too_late, kind=Kind.CANCEL)

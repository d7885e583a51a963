"""Messages of hi to co, and the meaning of co's messages."""

from msgspec.structs import replace

from agent_runtime.core.events import Received
from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages.cmd import Command, TaskReport, TaskState
from companion.languages.facts import Fact, Kind, fact
from companion.sentences import Reader, operator, place
from fipa_codec.languages import Reason
from fipa_codec.performatives import Performative as P
from services.human_interface.memory import FINAL, Memory, News

UNREACHABLE = "robot-unreachable"
REACHABLE = "robot-reachable"
TOO_LATE = "cancel-too-late"
ABOUT = {TaskState.PLANNING: AgentName.PL, TaskState.RUNNING: AgentName.TA}


def ask(turn: Turn, wish: Command) -> str:
    """Ask co for a task; return the conversation, which is the name of the task."""
    return turn.open(AgentName.CO, "request", P.REQUEST, wish)


def news(memory: Memory, turn: Turn, received: Received) -> tuple[News, ...]:
    """Return what a message of co says of a task; nothing for one that is forgotten."""
    name, said, performative = received.conversation, received.content, received.communicate.performative
    line = memory.task(name)
    if line is None:
        return ()
    if isinstance(said, Reason):
        turn.log("reason of co", performative=performative, text=said.text)
    report = said if isinstance(said, TaskReport) else TaskReport(TaskState.FAILED)
    if line.state in FINAL:
        return (News(AgentName.CO, TOO_LATE, _in_words(report) or f"it was {line.state} already", name),)
    if report is said and performative in (P.AGREE, P.INFORM):
        return (News(ABOUT.get(report.state, AgentName.CO), report.state, _in_words(report), name, report),)
    unsaid = Kind.NOT_UNDERSTOOD if performative is P.NOT_UNDERSTOOD else Kind.NO_REASON
    return (_failed(name, replace(report, state=TaskState.FAILED, why=report.why or (fact(unsaid, AgentName.CO),))),)


def failed(name: str, why: Fact) -> News:
    """Return the news that a task failed, and why."""
    return _failed(name, TaskReport(TaskState.FAILED, (why,)))


def _failed(name: str, report: TaskReport) -> News:
    return News(AgentName.CO, TaskState.FAILED, _in_words(report), name, report)


def _in_words(report: TaskReport) -> str:
    """A report in the operator's words."""
    at = place(report.at, Reader.OPERATOR) if report.at is not None else ""
    if report.asks and report.at is not None:
        hand = f" with the {report.at.side} hand" if report.at.side else ""
        return f"waits for you: next is '{at}{hand}' - `roco step` to go on"
    return ": ".join(filter(None, (at, operator(report.why))))

"""Messages of hi to co, and the meaning of co's messages."""

from agent_runtime.core.events import Received
from agent_runtime.core.turn import Turn
from companion.design import AgentName
from companion.languages import cmd
from companion.languages.cmd import TaskState
from companion.languages.evidence import Evidence
from fipa_codec.performatives import Performative as P
from services.human_interface.memory import FINAL, Memory, News

UNREACHABLE = "robot-unreachable"
REACHABLE = "robot-reachable"
TOO_LATE = "cancel-too-late"
ABOUT = {TaskState.PLANNING: AgentName.PL, TaskState.RUNNING: AgentName.TA}


def ask(turn: Turn, wish: cmd.Task) -> str:
    """Ask co for a task; return the conversation, which is the name of the task."""
    return turn.open(AgentName.CO, "request", P.REQUEST, wish)


def news(memory: Memory, received: Received) -> tuple[News, ...]:
    """Return what a message of co says of a task; nothing for one that is forgotten."""
    name, said = received.conversation, received.content
    line = memory.task(name)
    if line is None:
        return ()
    text = getattr(said, "text", "")
    if line.state in FINAL:
        return (News(AgentName.CO, TOO_LATE, text or f"it was {line.state} already", name),)
    if received.communicate.performative in (P.AGREE, P.INFORM) and isinstance(said, cmd.TaskReport):
        about = ABOUT.get(said.state, AgentName.CO)
        text = asking(said.asks, text) if said.asks else text
        return (News(about, said.state, text, name, said.state, said.steps, said.asks, said.evidence),)
    why = text or f"the coordinator said {received.communicate.performative} and no reason"
    return (failed(name, why, getattr(said, "evidence", ())),)


def asking(at: str, hand: str) -> str:
    """Return in words that a state of the plan waits for an operator; `hand`: with which one it is done, or ""."""
    return f"waits for you: next is '{' '.join(filter(None, (at.replace('/', ': '), hand)))}' - `roco step` to go on"


def failed(name: str, why: str, evidence: tuple[Evidence, ...] = ()) -> News:
    """Return the news that a task failed, and why."""
    return News(AgentName.CO, TaskState.FAILED, why, name, TaskState.FAILED, evidence=evidence)

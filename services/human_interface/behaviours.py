"""The three behaviours of hi: listen, interpret, tell; bound to the design.

One conversation of protocol request with co is one task, and its id is the task's name. Must not know: HTTP.
"""

from typing import Any

from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, Local, PeerChanged, Received, Started
from agent_runtime.core.turn import Turn
from companion.binding import bind
from companion.design import AgentName
from companion.languages import cmd
from companion.languages.cmd import TaskState
from companion.run_files import HiEvent, TaskLine
from fipa_codec.performatives import Performative as P
from services.human_interface.grammar import CancelTask, NotUnderstood, TellStatus, in_words, understand
from services.human_interface.memory import (
    CONDITIONS,
    FINAL,
    Answer,
    CancelWanted,
    Memory,
    News,
    Said,
    Shown,
    Told,
    Words,
)

REFUSED = "refused"
UNREACHABLE = "robot-unreachable"
REACHABLE = "robot-reachable"
TOO_LATE = "cancel-too-late"
NO_CO = "there is no coordinator yet; try again in a moment, and see `roco status`"
ABOUT = {TaskState.PLANNING: AgentName.PL, TaskState.RUNNING: AgentName.TA}


# --- listening --------------------------------------------------------------------------------------------------------


def listen(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `listening`: note words of a person and news of co."""
    match turn.event:
        case Local(content=Said() | CancelWanted() as word):
            return replace(memory, words=(*memory.words, word))
        case Received() as received:
            return memory.with_news(*_news(memory, received))
        case Broken(conversation=name, reason=why):
            return memory.with_news(_failed(name, f"what the coordinator said was not understood: {why}"))
        case Started():
            turn.tell(Shown(memory.tasks, memory.told))
        case PeerChanged(agent=AgentName.CO, incarnation=incarnation):
            return _presence(memory, away=incarnation is None)
    return memory


def _presence(memory: Memory, *, away: bool) -> Memory:
    """Tell who waits for a task that co is gone, and all that it is back."""
    if away and memory.open_tasks and not memory.away:
        news = News(AgentName.CO, UNREACHABLE, "the coordinator is gone; your tasks go on when it is back")
    elif memory.away and not away:
        news = News(AgentName.CO, REACHABLE, "the coordinator is back")
    else:
        return memory
    return replace(memory, away=away).with_news(news)


def _news(memory: Memory, received: Received) -> tuple[News, ...]:
    """What a message of co says of a task; nothing for one that is forgotten."""
    name, said = received.conversation, received.content
    line = memory.task(name)
    if line is None:
        return ()
    text = getattr(said, "text", "")
    if line.state in FINAL:
        return (News(AgentName.CO, TOO_LATE, text or f"it was {line.state} already", name),)
    if received.communicate.performative in (P.AGREE, P.INFORM) and isinstance(said, cmd.TaskReport):
        return (News(ABOUT.get(said.state, AgentName.CO), said.state, text, name, said.state),)
    return (_failed(name, text or f"the coordinator said {received.communicate.performative} and no reason"),)


def _failed(name: str, why: str) -> News:
    return News(AgentName.CO, TaskState.FAILED, why, name, TaskState.FAILED)


# --- interpreting -----------------------------------------------------------------------------------------------------


def interpret(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `interpreting`: ask co for what was said, or refuse politely; each word gets its answer."""
    for word in memory.words:
        memory = _answer(memory, turn, word)
    return replace(memory, words=())


def _answer(memory: Memory, turn: Turn, word: Words) -> Memory:
    if isinstance(word, CancelWanted):
        line, memory = _cancel(memory, turn, word.task)
        problem = _nothing_to_cancel(memory, word.task)
        turn.tell(Answer(word.ticket, line) if line else Answer(word.ticket, problem=problem, status=404))
        return memory
    match understand(word.text):
        case NotUnderstood(text=text):
            turn.tell(Answer(word.ticket, TaskLine("", REFUSED, text, word.text, turn.now)))
            return memory.with_news(News(AgentName.HI, REFUSED, text))
        case CancelTask(task=task):
            line, memory = _cancel(memory, turn, task)
            nothing = TaskLine("", REFUSED, _nothing_to_cancel(memory, task), word.text, turn.now)
            turn.tell(Answer(word.ticket, line or nothing))
            return memory
        case TellStatus():
            turn.tell(Answer(word.ticket, _status(memory, word.text, turn.now)))
            return memory
        case wish:
            return _ask(memory, turn, word, wish)


def _ask(memory: Memory, turn: Turn, word: Said, wish: cmd.Task) -> Memory:
    """A new task, unless there is nobody to do it."""
    if AgentName.CO not in turn.peers:
        turn.tell(Answer(word.ticket, problem=NO_CO, status=503))
        return memory
    name = turn.open(AgentName.CO, "request", P.REQUEST, wish)
    line = TaskLine(name, TaskState.WAITING, f"I will {in_words(wish)}.", word.text, turn.now)
    memory = memory.with_task(line)
    turn.tell(Shown(memory.tasks, memory.told))  # before the answer: who has it may look at once
    turn.tell(Answer(word.ticket, line))
    return memory.with_news(News(AgentName.HI, "asked", line.text, name))


def _cancel(memory: Memory, turn: Turn, task: str) -> tuple[TaskLine | None, Memory]:
    """Cancel a task at co, once, if it has not ended. The task (None: there is no such one), and the memory."""
    line = memory.task(task) if task else next(iter(memory.open_tasks), None)
    if line is None or not turn.holds(line.task) or turn.conversation(line.task).cancel:
        return line, memory
    turn.say(line.task, P.CANCEL)
    return line, memory.with_news(News(AgentName.HI, "cancelling", "what is held is put down first", line.task))


def _nothing_to_cancel(memory: Memory, task: str) -> str:
    known = ", ".join(one.task for one in memory.open_tasks) or "none"
    return f"there is no task {task!r}; open are: {known}" if task else "there is nothing to cancel"


def _status(memory: Memory, said: str, now: float) -> TaskLine:
    lines = memory.open_tasks
    if not lines:
        return TaskLine("", TaskState.DONE, "I have nothing to do.", said, now)
    text = "; ".join(f"{line.task} is {line.state}" + (f": {line.text}" if line.text else "") for line in lines)
    return TaskLine(lines[0].task, lines[0].state, text, said, lines[0].since)


# --- telling ----------------------------------------------------------------------------------------------------------


def tell(memory: Memory, turn: Turn) -> Memory:
    """Behaviour of `telling`: tasks as they now are, and an event for each piece of news."""
    for news in memory.news:
        line = memory.task(news.task)
        if line is not None and news.state:
            since = turn.now if line.state != news.state else line.since
            text = news.text if news.text or news.state in FINAL else line.text
            memory = memory.with_task(replace(line, state=news.state, text=text, since=since))
        memory = replace(memory, told=memory.told + 1)
        turn.tell(Told(HiEvent(memory.told, turn.now, news.agent, news.name, news.text, news.task)))
    turn.tell(Shown(memory.tasks, memory.told))
    return replace(memory, news=())


def human_interface() -> Agent[Memory]:
    """The agent hi."""
    behaviours: dict[str, Any] = {"listen": listen, "interpret": interpret, "tell": tell}
    return bind(AgentName.HI, Memory(), behaviours, CONDITIONS, local=Words)

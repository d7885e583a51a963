"""The three behaviours of hi: listen, interpret, tell; bound to the design.

A task is one conversation with co by protocol request; its id is the name of the task. Must not know: HTTP.
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
from companion.run_files import REFUSED, HiEvent, TaskLine
from fipa_codec.performatives import Performative as P
from services.human_interface import local, words
from services.human_interface.grammar import CancelTask, NotUnderstood, TellStatus, in_words, understand
from services.human_interface.local import Answer, CancelWanted, Said, Shown, Told
from services.human_interface.memory import CONDITIONS, FINAL, Memory, News
from services.human_interface.words import REACHABLE, UNREACHABLE

NO_CO = "there is no coordinator yet; try again in a moment, and see `roco status`"


# --- listening --------------------------------------------------------------------------------------------------------


def listen(memory: Memory, turn: Turn) -> Memory:
    """State listening: note what a person says, and news of co."""
    match turn.event:
        case Local(content=Said() | CancelWanted() as word):
            return replace(memory, words=(*memory.words, word))
        case Received() as received:
            return memory.with_news(*words.news(memory, received))
        case Broken(conversation=name, reason=why):
            return memory.with_news(words.failed(name, f"what the coordinator said was not understood: {why}"))
        case Started():
            turn.tell(Shown(memory.tasks, memory.told))
        case PeerChanged(agent=AgentName.CO, incarnation=incarnation):
            return _presence(memory, away=incarnation is None)
    return memory


def _presence(memory: Memory, *, away: bool) -> Memory:
    """Tell people who wait for a task that co is gone, and that it is back."""
    if away and memory.open_tasks and not memory.away:
        news = News(AgentName.CO, UNREACHABLE, "the coordinator is gone; your tasks go on when it is back")
    elif memory.away and not away:
        news = News(AgentName.CO, REACHABLE, "the coordinator is back")
    else:
        return memory
    return replace(memory, away=away).with_news(news)


# --- interpreting -----------------------------------------------------------------------------------------------------


def interpret(memory: Memory, turn: Turn) -> Memory:
    """State interpreting: request the task of co, or refuse politely; each sentence gets an answer."""
    for word in memory.words:
        memory = _answer(memory, turn, word)
    return replace(memory, words=())


def _answer(memory: Memory, turn: Turn, word: local.Local) -> Memory:
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
    """Request a new task, unless co is not there."""
    if AgentName.CO not in turn.peers:
        turn.tell(Answer(word.ticket, problem=NO_CO, status=503))
        return memory
    name = words.ask(turn, wish)
    line = TaskLine(name, TaskState.WAITING, f"I will {in_words(wish)}.", word.text, turn.now)
    memory = memory.with_task(line)
    turn.tell(Shown(memory.tasks, memory.told))  # before the answer, whose reader may look at once
    turn.tell(Answer(word.ticket, line))
    return memory.with_news(News(AgentName.HI, "asked", line.text, name))


def _cancel(memory: Memory, turn: Turn, task: str) -> tuple[TaskLine | None, Memory]:
    """Cancel a task at co, once, if it has not ended. Return the task (None for an unknown one) and the memory."""
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
    """State telling: show the tasks as they are now, and an event for each piece of news."""
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


def agent() -> Agent[Memory]:
    """Return the agent hi."""
    behaviours: dict[str, Any] = {"listen": listen, "interpret": interpret, "tell": tell}
    return bind(AgentName.HI, Memory(), behaviours, CONDITIONS, local=local.Local)

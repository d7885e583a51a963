"""The three behaviours of hi: listen, interpret, tell; bound to the design.

A task is one conversation with co by protocol request; its id is the name of the task. Must not
know: HTTP.
"""

from collections.abc import Callable
from typing import Any

from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Broken, Local, PeerChanged, Received, Started, Woken
from agent_runtime.core.turn import Turn
from companion import commands
from companion.design import AgentName, bind
from companion.languages import cmd
from companion.languages.cmd import TaskReport, TaskState
from companion.languages.facts import Kind, fact
from companion.run_files import (
    ANSWERED,
    QUESTION,
    REFUSED,
    RELEASED,
    STOPPED,
    HiEvent,
    InWords,
    Question,
    TaskLine,
)
from companion.sentences import Reader, failure, operator, person, place, span, state
from fipa_codec.languages import Reason
from fipa_codec.performatives import Performative as P
from services.human_interface import device_messages
from services.human_interface.catalogue import LANGUAGES, abilities, say
from services.human_interface.device_messages import (
    Answer,
    CancelWanted,
    Halted,
    NewEvent,
    Sentence,
    Shown,
    StopRobot,
    Wanted,
)
from services.human_interface.interpretation import (
    Act,
    Ask,
    Option,
    Tell,
    forget_objects,
    in_words,
    outcome,
    replies_to,
    wishes,
    with_mentioned,
)
from services.human_interface.memory import CONDITIONS, FINAL, Memory, News

ANSWER_WITHIN_S = (
    # estimate: co agrees within milliseconds; one that hangs is killed after 6 s
    # (docs/run-folder.md)
    10.0
)
STAYS_HELD = "I am stopped and stay so until `roco release`; then say it again"
NO_CO = "there is no coordinator yet; try again in a moment, and see `roco status`"


# --- listening ------------------------------------------------------------------------------------


def listen(memory: Memory, turn: Turn) -> Memory:
    """State listening: note what a person says, and news of co."""
    match turn.event:
        case Local(content=Sentence() | Wanted() | CancelWanted() | Halted() as word):
            return replace(memory, words=(*memory.words, word))
        case Received() as received:
            turn.unwake(received.conversation)
            news = _news(memory, turn, received)
            return _end_tasks(_answered(memory), turn, *news).with_news(*news)
        case Broken(conversation=name, reason=reason):
            turn.log("broken", conversation=name, reason=reason)
            why = (fact(Kind.BROKE_OFF, AgentName.CO),)
            return memory.with_news(_ended(name, TaskReport(TaskState.FAILED, why)))
        case Woken(name=task) if turn.holds(task) and not memory.away:
            return _unanswered(memory, task)
        case Started():
            turn.tell(_shown(memory))
        case PeerChanged(agent=AgentName.CO, incarnation=incarnation):
            return _presence(memory, away=incarnation is None)
    return memory


def _unanswered(memory: Memory, task: str) -> Memory:
    """Tell people that co is there and says nothing to a task; the request is durable and stays."""
    silent = f"the coordinator has not answered for {ANSWER_WITHIN_S:g} s"
    text = f"{silent}; your task goes on when it does"
    return replace(memory, away=True).with_news(News(AgentName.CO, UNREACHABLE, text, task))


def _answered(memory: Memory) -> Memory:
    """Tell people, if they heard otherwise, that co answers."""
    if not memory.away:
        return memory
    return replace(memory, away=False).with_news(
        News(AgentName.CO, REACHABLE, "the coordinator answers again")
    )


def _end_tasks(memory: Memory, turn: Turn, *news: News) -> Memory:
    """Note what a look around told; cancel what was said after a task of the same sentence that was
    not done.
    """
    for one in news:
        for said in (
            one.report.why
            if one.report and one.state == TaskState.DONE and one.task in memory.looks
            else ()
        ):
            if said.kind in (Kind.SEEN, Kind.SEEN_NOTHING):
                memory = memory.with_context(seen=said.things)
        if one.state in FINAL:
            given = [thing for task, thing in memory.gives if task == one.task]
            if given and one.state == TaskState.DONE:
                memory = replace(memory, context=forget_objects(memory.context, *given))
            later = [name for name, before in memory.follows if before == one.task]
            follows = tuple(pair for pair in memory.follows if pair[1] != one.task)
            looks = tuple(name for name in memory.looks if name != one.task)
            gives = tuple(pair for pair in memory.gives if pair[0] != one.task)
            memory = replace(memory, follows=follows, looks=looks, gives=gives)
            for name in later if one.state != TaskState.DONE else ():
                _, memory = _cancel(memory, turn, name)
    return memory


def _presence(memory: Memory, *, away: bool) -> Memory:
    """Tell people who wait for a task that co is gone, and that it is back."""
    if away and memory.open_tasks and not memory.away:
        news = News(
            AgentName.CO, UNREACHABLE, "the coordinator is gone; your tasks go on when it is back"
        )
    elif memory.away and not away:
        news = News(AgentName.CO, REACHABLE, "the coordinator is back")
    else:
        return memory
    return replace(memory, away=away).with_news(news)


# --- interpreting ---------------------------------------------------------------------------------


def interpret(memory: Memory, turn: Turn) -> Memory:
    """State interpreting: request the task of co, or refuse politely; each sentence gets an
    answer.
    """
    for word in memory.words:
        memory = _answer(memory, turn, word)
    return replace(memory, words=())


def _answer(memory: Memory, turn: Turn, word: device_messages.Local) -> Memory:
    if isinstance(word, Halted):
        return _halted(memory, turn, word)
    if isinstance(word, Wanted):
        said = f"{word.guest}: {in_words((word.task,))}"
        sentence = Sentence(word.ticket, said, held=word.held, asker=word.guest, at=word.at)
        return _ask(memory, turn, sentence, Act((word.task,)))
    if isinstance(word, CancelWanted):
        line, memory = _cancel(memory, turn, word.task)
        problem = _nothing_to_cancel(memory, word.task)
        told = _cancelling((line,), word.language) if line else None
        turn.tell(
            Answer(word.ticket, told) if told else Answer(word.ticket, problem=problem, status=404)
        )
        return memory.forgetting(line.task) if line else memory
    if line := memory.again(word):  # a double click
        memory = memory.asking(word.asker, word.at, (), ()).hearing(word, line)
        turn.tell(_shown(memory))
        turn.tell(Answer(word.ticket, line))
        return memory
    return _handle_sentence(memory, turn, word)


def _handle_sentence(memory: Memory, turn: Turn, word: Sentence) -> Memory:
    """Do what a sentence means to who says it."""
    options, busy = memory.options(word.asker, word.at), bool(memory.open_tasks)
    context = replace(memory.context, options=options, busy=busy)
    found = _timed(outcome(word.meaning, context), word, turn.now)
    if isinstance(found, Act) and word.careful and not found.sure:
        found = _careful(found, word.meaning.language)
    options = found.options if isinstance(found, Ask) else ()
    both = (replies_to(options, language) for language in LANGUAGES)
    replies = tuple(text for texts in both for text in texts)
    memory = memory.asking(word.asker, word.at, options, replies)
    match found:
        case Act():
            return _ask(memory, turn, word, found)
        case Ask(text=text, sentences=sentences):
            turn.tell(_shown(memory))  # first: who reads the answer may reply at once
            offered = replies_to(options, word.meaning.language, sentences)
            memory = _no_task(memory, turn, word, QUESTION if offered else REFUSED, text, offered)
            if context.options and not offered:  # a no
                memory = memory.hearing(word, TaskLine("", REFUSED, text, word.text, word.at))
            return memory
        case Tell(does="stop"):
            turn.tell(StopRobot(word.ticket, word.text))
            return memory
        case Tell(does="cancel", task=task):
            line, memory = _cancel(memory, turn, task)
            nothing = TaskLine("", REFUSED, _nothing_to_cancel(memory, task), word.text, turn.now)
            told = _cancelling((line,), word.meaning.language) if line else nothing
            turn.tell(Answer(word.ticket, told))
            return memory.hearing(word, told)
        case Tell(does="cancel_all"):
            return _cancel_all(memory, turn, word)
        case Tell(does="status"):
            turn.tell(Answer(word.ticket, _status(memory, word, turn.now)))
            return memory
        case Tell(does="release"):
            asks = not word.held and any(line.asks for line in memory.open_tasks)
            if memory.open_tasks and not (word.held or asks):  # it goes on anyway
                turn.tell(Answer(word.ticket, _status(memory, word, turn.now)))
                return memory
            row = "asks" if asks else "released"
            return _no_task(memory, turn, word, REFUSED, say(word.meaning.language, row))
        case Tell(does=does):
            text = ANSWERS[does](memory, word.meaning.language, turn.now)
            turn.tell(Answer(word.ticket, TaskLine("", ANSWERED, text, word.text, turn.now)))
            return memory


def _careful(act: Act, language: str) -> Act | Ask:
    """A question before an act that nothing undoes."""
    if not any(task.final for task in act.tasks):
        return act
    sure = Option("", act.tasks, act.clauses, act.instead, sure=True)
    return Ask(say(language, "sure", in_words(act.tasks, language)), (sure,))


def _timed(found: Act | Ask | Tell, word: Sentence, now: float) -> Act | Ask | Tell:
    """Return what is done with a sentence, its tasks as urgent as was said, those of a question's
    answers, too.
    """
    if isinstance(found, Act):
        return replace(found, tasks=tuple(_wanted(task, word, now) for task in found.tasks))
    if isinstance(found, Ask):
        answers = (
            replace(one, tasks=tuple(_wanted(task, word, now) for task in one.tasks))
            for one in found.options
        )
        return replace(found, options=tuple(answers))
    return found


def _wanted(task: cmd.Command, word: Sentence, now: float) -> cmd.Command:
    """The task with urgency, deadline and time to begin of what was said, where something was said
    of them.
    """
    if word.urgency:
        task = replace(task, urgency=word.urgency)
    if word.later_s:
        task = replace(task, start=now + word.later_s)
    return replace(task, deadline=now + word.within_s) if word.within_s else task


def _no_task(
    memory: Memory, turn: Turn, word: Sentence, state: str, text: str, replies: tuple[str, ...] = ()
) -> Memory:
    """Answer that no task came of the sentence, and why; `replies`: sentences that answer the
    question back.
    """
    turn.tell(Answer(word.ticket, TaskLine("", state, text, word.text, turn.now, replies=replies)))
    return memory.with_news(News(AgentName.HI, state, text))


def _ask(memory: Memory, turn: Turn, word: Sentence, act: Act) -> Memory:
    """Request new tasks, unless the robot is stopped or co is not there."""
    tasks = act.tasks
    if word.held:
        return _no_task(memory, turn, word, REFUSED, STAYS_HELD)
    if AgentName.CO not in turn.peers:
        turn.tell(Answer(word.ticket, problem=NO_CO, status=503))
        return memory
    names: list[str] = []
    # before the new ones: the coordinator has room for them then
    before = (word.instead,) if word.instead else memory.latest if act.instead else ()
    for name in before:
        _, memory = _cancel(memory, turn, name)
    for task in tasks:
        memory, name = _request(
            memory, turn, word, replace(task, after=names[-1]) if names else task
        )
        memory = memory.following(name, names[-1]) if names else memory
        names.append(name)
    memory = memory.replacing(word.instead, names[-1])
    memory = replace(memory, latest=tuple(names)).with_context(last=act.clauses)
    turn.tell(_shown(memory))  # before the answer, whose reader may look at once
    text = _i_will(tasks, word, turn.now)
    line = TaskLine(names[0], TaskState.WAITING, text, word.text, turn.now, tuple(names[1:]))
    turn.tell(Answer(word.ticket, line))
    return memory.hearing(word, replace(line, text=say(word.meaning.language, "again", text)))


def _request(memory: Memory, turn: Turn, word: Sentence, task: cmd.Command) -> tuple[Memory, str]:
    """Request a task. Return the memory and the name of the task."""
    # the conversation is the name of the task
    name = turn.open(AgentName.CO, "request", P.REQUEST, task)
    turn.wake(name, turn.now + ANSWER_WITHIN_S)
    text = _i_will((task,), word, turn.now)
    wish = InWords(in_words((task,)), in_words((task,), "pl"))
    line = TaskLine(name, TaskState.WAITING, text, word.text, turn.now, wish=wish)
    line = replace(line, urgency=task.urgency, deadline=task.deadline, start=task.start)
    memory = memory.with_task(line)
    memory = memory.with_context(mentioned=with_mentioned(memory.context.mentioned, *task.things))
    if task.surveys:
        memory = replace(memory, looks=(*memory.looks, name))
    if task.gives:
        memory = replace(memory, gives=(*memory.gives, *((name, thing) for thing in task.things)))
    return memory.with_news(News(AgentName.HI, "asked", text, name)), name


def _i_will(tasks: tuple[cmd.Command, ...], word: Sentence, now: float) -> str:
    """Return a sentence that says what will be done, in which order, from when on and until
    when.
    """
    language = word.meaning.language
    text = in_words(tasks, language)
    if any(task.urgency for task in tasks):
        text = say(language, "urgent", text)
    if start := max(task.start for task in tasks):
        text = say(language, "later", text, _span(now, start, word.east_min))
    if deadline := max(task.deadline for task in tasks):
        text = say(language, "within", text, _span(now, deadline, word.east_min))
    return say(language, "i_will", text)


def _span(now: float, then: float, east_min: int | None) -> str:
    """The time until then, and the time of day by a clock so far ahead of UTC [min], if that is
    known.
    """
    seconds, minutes = then - now, round((then - now) / 60.0)
    text = f"{seconds:.0f} s" if seconds < 120.0 else f"{minutes} min"
    if minutes >= 120:
        text = f"{minutes // 60} h {minutes % 60} min"
    if east_min is None:
        return text
    hour, minute = divmod((round(then) // 60 + east_min) % (24 * 60), 60)
    return f"{text} ({hour}:{minute:02})"


def _cancel_all(memory: Memory, turn: Turn, word: Sentence) -> Memory:
    """Cancel every task that has not ended; the answer is the oldest of them."""
    lines = memory.open_tasks
    for line in lines:
        _, memory = _cancel(memory, turn, line.task)
    nothing = TaskLine("", REFUSED, _nothing_to_cancel(memory, ""), word.text, turn.now)
    told = _cancelling(lines, word.meaning.language) if lines else nothing
    turn.tell(Answer(word.ticket, told))
    return memory.hearing(word, told)


def _cancel(memory: Memory, turn: Turn, task: str) -> tuple[TaskLine | None, Memory]:
    """Cancel a task at co, once, if it has not ended. Return the task (None for an unknown one) and
    the memory.
    """
    line = memory.task(task) if task else next(iter(memory.open_tasks), None)
    if line is None or not turn.holds(line.task) or turn.conversation(line.task).cancel:
        return line, memory
    turn.say(line.task, P.CANCEL)
    return line, memory.with_news(
        News(AgentName.HI, "cancelling", "what is held is put down first", line.task)
    )


def _cancelling(lines: tuple[TaskLine, ...], language: str) -> TaskLine:
    """Return the first of the tasks, with words for the person who cancels them; one that had ended
    is over already.
    """
    says = ", ".join(
        str(getattr(line.wish, language)) if line.wish else line.said for line in lines
    )
    return replace(
        lines[0], text=say(language, "over" if lines[0].state in FINAL else "cancelling", says)
    )


def _halted(memory: Memory, turn: Turn, word: Halted) -> Memory:
    """Tell people of a stop or its end. Where the stop did not reach the robot, all tasks are
    cancelled instead.
    """
    if word.held and not word.reached:
        memory = memory.with_news(News(AgentName.HI, REFUSED, word.text))
        for line in memory.open_tasks:
            _, memory = _cancel(memory, turn, line.task)
        return memory
    return memory.with_news(News(AgentName.HI, STOPPED if word.held else RELEASED, word.text))


def _nothing_to_cancel(memory: Memory, task: str) -> str:
    known = ", ".join(one.task for one in memory.open_tasks) or "none"
    return f"there is no task {task!r}; open are: {known}" if task else "there is nothing to cancel"


def _status(memory: Memory, word: Sentence, now: float) -> TaskLine:
    lines, language = memory.open_tasks, word.meaning.language
    if not lines:
        return TaskLine("", TaskState.DONE, say(language, "nothing_open"), word.text, now)
    text = " ".join(_how_far(line, language, now) for line in lines)
    return TaskLine(lines[0].task, lines[0].state, text, word.text, lines[0].since)


# --- telling --------------------------------------------------------------------------------------


def tell(memory: Memory, turn: Turn) -> Memory:
    """State telling: show the tasks as they are now, and an event for each piece of news."""
    for news in memory.news:
        line = memory.task(news.task)
        if line is not None and news.report is not None:
            line = _reported(line, news.report, news.text, turn.now)
            memory = memory.timed(line, news.report, turn.now)
            if news.report.hands is not None:
                memory = replace(memory, hands=news.report.hands)
        memory = replace(memory, told=memory.told + 1)
        turn.tell(
            NewEvent(HiEvent(memory.told, turn.now, news.agent, news.name, news.text, news.task))
        )
    turn.tell(_shown(memory))
    return replace(memory, news=())


def _shown(memory: Memory) -> Shown:
    """All that people may see between two events."""
    questions = tuple(Question(one.asker, one.until, one.replies) for one in memory.asked)
    context = memory.context
    can = wishes(context, tuple((memory.hands or {}).values()))
    return Shown(memory.tasks, memory.told, can, questions, memory.hands, context.seen)


def _reported(line: TaskLine, said: cmd.TaskReport, text: str, now: float) -> TaskLine:
    """The task after a report, `text`: in words. One without words leaves the reason; steps end
    with their plan.
    """
    if said.steps or said.state != TaskState.RUNNING:
        line = replace(line, before=line.before + _done_steps(line))
    steps = said.steps or (line.steps if said.state == TaskState.RUNNING else ())
    if text or said.state in FINAL:
        line = replace(line, text=text, why=said.why)
    if line.state != said.state:
        line = replace(line, state=said.state, since=now)
    asks = said.at.id if said.asks and said.at is not None else ""
    accepted = line.accepted or said.state != TaskState.FAILED
    line = replace(line, steps=steps, at=said.at, number=said.number, asks=asks)
    return replace(line, evidence=said.evidence, accepted=accepted)


def _done_steps(line: TaskLine) -> int:
    """The steps that the plan of a task has done: one in the middle is not done."""
    return line.number if line.number == len(line.steps) else max(line.number - 1, 0)


def agent() -> Agent[Memory]:
    """Return the agent hi."""
    behaviours: dict[str, Any] = {"listen": listen, "interpret": interpret, "tell": tell}
    return bind(AgentName.HI, Memory(), behaviours, CONDITIONS, local=device_messages.Local)


# --- Answers to questions of people, from what hi knows -------------------------------------------


def _see(memory: Memory, language: str, now: float) -> str:
    seen = memory.context.seen
    if seen is None:
        return say(language, "not_seen", in_words((commands.survey(),), language))
    known = fact(Kind.SEEN, *seen) if seen else fact(Kind.SEEN_NOTHING)
    return say(language, "seen", person((known,), language))


def _why(memory: Memory, language: str, now: float) -> str:
    """The task that is open and how it is, else the last one that was not done and the reason."""
    if memory.open_tasks:
        line = memory.open_tasks[0]
        why = say(language, "asks") if line.asks else person(line.why, language)
        return say(language, "because", line.said, state(line.state, language), why).rstrip()
    ended = [line for line in memory.tasks if line.state in (TaskState.FAILED, TaskState.CANCELLED)]
    if not ended:
        return say(language, "no_failure")
    line = ended[-1]
    words = failure if line.state is TaskState.FAILED else person
    why = words(line.why, language)
    return say(language, "failed", line.said, why or state(line.state, language))


def _hands(memory: Memory, language: str, now: float) -> str:
    held = tuple(fact(Kind.HOLDS, side, name) for side, name in (memory.hands or {}).items())
    return person(held, language) if held else say(language, "hands_empty")


def _how_long(memory: Memory, language: str, now: float) -> str:
    line = next(iter(memory.open_tasks), None)
    return _how_far(line, language, now) if line else say(language, "nothing_open")


def _how_far(line: TaskLine, language: str, now: float) -> str:
    """How far a task is, and how long it still takes, as far as that is known."""
    wish = getattr(line.wish, language) if line.wish else line.said
    if line.number:
        steps = line.before + line.number, line.before + len(line.steps)
        text = say(language, "how_far", wish, *steps)
    else:
        text = say(language, "not_begun", wish, state(line.state, language))
    if line.until <= now:
        return text
    return f"{text} {say(language, 'left', span(line.until - now, language))}"


ANSWERS: dict[str, Callable[[Memory, str, float], str]] = {
    "see": _see,
    "why": _why,
    "help": lambda memory, language, now: say(language, "understood", abilities(language)),
    "stopping": lambda memory, language, now: say(language, "stopping"),
    "greet": lambda memory, language, now: say(language, "greet", abilities(language)),
    "doors": lambda memory, language, now: say(language, "doors"),
    "hands": _hands,
    "how_long": _how_long,
}
"""The rows of the catalogue that are answered from memory."""


# --- Messages of hi to co, and the meaning of co's messages ---------------------------------------

UNREACHABLE = "robot-unreachable"
REACHABLE = "robot-reachable"
TOO_LATE = "cancel-too-late"
ABOUT = {TaskState.PLANNING: AgentName.PL, TaskState.RUNNING: AgentName.TA}


def _news(memory: Memory, turn: Turn, received: Received) -> tuple[News, ...]:
    """Return what a message of co says of a task; nothing for one that is forgotten."""
    name, said = received.conversation, received.content
    performative = received.communicate.performative
    line = memory.task(name)
    if line is None:
        return ()
    if isinstance(said, Reason):
        turn.log("reason of co", performative=performative, text=said.text)
    report = said if isinstance(said, TaskReport) else TaskReport(TaskState.FAILED)
    if line.state in FINAL:
        text = _report_text(report) or f"it was {line.state} already"
        return (News(AgentName.CO, TOO_LATE, text, name),)
    if report is said and performative in (P.AGREE, P.INFORM):
        about = ABOUT.get(report.state, AgentName.CO)
        return (News(about, report.state, _report_text(report), name, report),)
    unsaid = Kind.NOT_UNDERSTOOD if performative is P.NOT_UNDERSTOOD else Kind.NO_REASON
    why = report.why or (fact(unsaid, AgentName.CO),)
    return (_ended(name, replace(report, state=TaskState.FAILED, why=why)),)


def _ended(name: str, report: TaskReport) -> News:
    return News(AgentName.CO, TaskState.FAILED, _report_text(report), name, report)


def _report_text(report: TaskReport) -> str:
    """A report in the operator's words."""
    at = place(report.at, Reader.OPERATOR) if report.at is not None else ""
    if report.asks and report.at is not None:
        hand = f" with the {report.at.side} hand" if report.at.side else ""
        return f"waits for you: next is '{at}{hand}' - `roco step` to go on"
    return ": ".join(filter(None, (at, operator(report.why))))

"""What hi remembers: the tasks it asked co for and what became of them; and the words between it and its HTTP side.

Must not know: HTTP, grammar.
"""

import msgspec

from companion.languages.cmd import TaskState
from companion.run_files import HiEvent, TaskLine

KEPT_TASKS = 50  # ended tasks that are remembered; the journal holds them all in each record (estimate)
FINAL = frozenset({TaskState.DONE, TaskState.FAILED, TaskState.CANCELLED})


class _Word(msgspec.Struct, frozen=True, tag=True):
    """Between the agent and its HTTP side."""


class Said(_Word, frozen=True):
    """A person said a sentence; the answer goes to `ticket`."""

    ticket: str
    text: str


class CancelWanted(_Word, frozen=True):
    """A person wants a task cancelled, "" for the oldest open one."""

    ticket: str
    task: str = ""


class Answer(_Word, frozen=True):
    """To the person who holds the ticket: a line on a task, or `problem` with the HTTP status."""

    ticket: str
    line: TaskLine | None = None
    problem: str = ""
    status: int = 200


class Told(_Word, frozen=True):
    """Something for /events."""

    event: HiEvent


class Shown(_Word, frozen=True):
    """All tasks as they are now, for /tasks; `events`: how many were told so far."""

    tasks: tuple[TaskLine, ...]
    events: int


Words = Said | CancelWanted
"""What the HTTP side posts."""


class News(msgspec.Struct, frozen=True):
    """Of a task (or of nobody, ""): `name` is a state or a word of hi's own; `state` "": it stays as it was."""

    agent: str
    name: str
    text: str
    task: str = ""
    state: str = ""


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`words`: not interpreted yet; `news`: not told yet; `told`: number of events so far; `away`: co was told gone."""

    tasks: tuple[TaskLine, ...] = ()
    words: tuple[Words, ...] = ()
    news: tuple[News, ...] = ()
    told: int = 0
    away: bool = False

    def task(self, name: str) -> TaskLine | None:
        """The task of this name."""
        return next((line for line in self.tasks if line.task == name), None)

    @property
    def open_tasks(self) -> tuple[TaskLine, ...]:
        """Those that have not ended, oldest first."""
        return tuple(line for line in self.tasks if line.state not in FINAL)

    def with_task(self, line: TaskLine) -> "Memory":
        """The same with a task added, or as it now is; the oldest ended ones are forgotten."""
        known = self.task(line.task) is not None
        tasks = tuple(line if one.task == line.task else one for one in self.tasks) if known else (*self.tasks, line)
        surplus = len(tasks) - KEPT_TASKS
        forgotten = {one.task for one in [one for one in tasks if one.state in FINAL][: max(surplus, 0)]}
        return msgspec.structs.replace(self, tasks=tuple(one for one in tasks if one.task not in forgotten))

    def with_news(self, *news: News) -> "Memory":
        """The same with more to tell."""
        return msgspec.structs.replace(self, news=(*self.news, *news))


# --- the conditions of design.toml ------------------------------------------------------------------------------------


def words_wait(memory: Memory) -> bool:
    """A person said something."""
    return bool(memory.words)


def news_wait(memory: Memory) -> bool:
    """There is something to tell."""
    return bool(memory.news)


def heard(memory: Memory) -> bool:
    """Somebody said something."""
    return words_wait(memory) or news_wait(memory)


def interpreted(memory: Memory) -> bool:
    """All words were answered."""
    return not memory.words


def told(memory: Memory) -> bool:
    """All news were told."""
    return not memory.news


CONDITIONS = {condition.__name__: condition for condition in (words_wait, news_wait, heard, interpreted, told)}

"""Memory of hi between two steps: the tasks it asked co for and what became of them; conditions of
the design.

Must not know: HTTP, grammar.
"""

from collections.abc import Callable
from typing import Any

import msgspec
from msgspec.structs import replace

from companion.languages.cmd import TaskReport, TaskState
from companion.languages.values import Side
from companion.run_files import TaskLine
from services.human_interface.device_messages import Local, Sentence
from services.human_interface.interpretation import Context, Option

# tasks that are remembered after their end; each record of the journal has them all (estimate)
KEPT_TASKS = 50
# a question can be answered so long; later a "yes" may be meant for something else (estimate)
ASKED_S = 30.0
# an equal sentence so soon after is the same one: a double click, a key that was held (estimate)
AGAIN_S = 2.0
MOST_ASKED = 32  # questions that are open, each to somebody else (the page pairs as many browsers)
FINAL = frozenset({TaskState.DONE, TaskState.FAILED, TaskState.CANCELLED})


class News(msgspec.Struct, frozen=True):
    """News of a task ("": of none). `name`: a task state or an event of hi; `report`: None for no
    change of the task.

    `text`: hi's own words, or the report in the operator's words.
    """

    agent: str
    name: str
    text: str
    task: str = ""
    report: TaskReport | None = None

    @property
    def state(self) -> str:
        """The new state of the task, "" for no change."""
        return self.report.state if self.report else ""


class Asked(msgspec.Struct, frozen=True, omit_defaults=True):
    """A question that was asked of somebody: until when it can be answered, its options, and the
    sentences for them.
    """

    asker: str
    until: float
    options: tuple[Option, ...]
    replies: tuple[str, ...]


class Heard(msgspec.Struct, frozen=True, omit_defaults=True):
    """A sentence of somebody that something came of, and what is answered if it comes again at
    once.
    """

    asker: str
    at: float
    words: tuple[str, int, str]
    line: TaskLine


AS_PLANNED_S = 10.0  # weight of the plans' own times beside what was measured (estimate)
FADES_S = 300.0  # planned time after which a measurement counts half (estimate)
SLOWEST = 4.0
"""Times its planned time; what takes longer waited for something (estimate)."""


class Pace(msgspec.Struct, frozen=True, omit_defaults=True):
    """How long acts take against their plans: planned and real time [s], older ones faded. On a
    machine with much other work it is far from 1.
    """

    planned: float = 0.0
    took: float = 0.0

    @property
    def factor(self) -> float:
        """Real seconds of a planned one."""
        return (AS_PLANNED_S + self.took) / (AS_PLANNED_S + self.planned)

    def after(self, planned: float, took: float) -> "Pace":
        """The pace with one more measurement [s]."""
        kept = FADES_S / (FADES_S + planned)
        took = min(took, SLOWEST * planned)
        return Pace(kept * self.planned + planned, kept * self.took + took)


class Rest(msgspec.Struct, frozen=True, array_like=True):
    """The rest of a task as planned [s], and when it was told first [unix s]."""

    task: str
    rest: float
    at: float


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`words`: not interpreted yet; `news`: not told yet; `told`: number of events; `away`: people
    know it.

    `context`: things and the look around that were mentioned; `asked`: open questions; `heard`:
    sentences of the last seconds; `looks`: tasks that look around; `gives`: pairs of a task and a
    thing that a person has once it is done; `follows`: pairs of a task and the one said before it,
    which it needs; `latest`: the tasks of the last sentence that asked for some; `rests`: of the
    tasks under way; `hands`: what each hand holds, as told
    last; None: nothing was.
    """

    tasks: tuple[TaskLine, ...] = ()
    words: tuple[Local, ...] = ()
    news: tuple[News, ...] = ()
    told: int = 0
    away: bool = False
    context: Context = Context()
    asked: tuple[Asked, ...] = ()
    heard: tuple[Heard, ...] = ()
    looks: tuple[str, ...] = ()
    gives: tuple[tuple[str, str], ...] = ()
    follows: tuple[tuple[str, str], ...] = ()
    latest: tuple[str, ...] = ()
    pace: Pace = Pace()
    rests: tuple[Rest, ...] = ()
    hands: dict[Side, str] | None = None

    def task(self, name: str) -> TaskLine | None:
        """Return the task of this name."""
        return next((line for line in self.tasks if line.task == name), None)

    @property
    def open_tasks(self) -> tuple[TaskLine, ...]:
        """The tasks that have not ended, oldest first."""
        return tuple(line for line in self.tasks if line.state not in FINAL)

    def with_task(self, line: TaskLine) -> "Memory":
        """Return the memory with a task added or updated; the oldest ended ones are forgotten."""
        tasks = tuple(line if one.task == line.task else one for one in self.tasks)
        if line not in tasks:
            tasks = (*tasks, line)
        surplus = len(tasks) - KEPT_TASKS
        ended = [one.task for one in tasks if one.state in FINAL]
        forgotten = set(ended[: max(surplus, 0)])
        return replace(self, tasks=tuple(one for one in tasks if one.task not in forgotten))

    def timed(self, line: TaskLine, report: TaskReport, now: float) -> "Memory":
        """The memory with a task and its expected end after a report; the report tells the pace,
        too.

        What waits for an operator takes as long as that.
        """
        known = next((one for one in self.rests if one.task == line.task), None)
        others = tuple(one for one in self.rests if one.task != line.task)
        over = report.state in FINAL or report.state is TaskState.SUSPENDED or report.asks
        if not over and (not report.rest or (known and known.rest == report.rest)):
            return self.with_task(line)
        pace = self.pace
        if known and (report.rest or report.state is TaskState.DONE) and known.rest > report.rest:
            pace = pace.after(known.rest - report.rest, now - known.at)
        until = 0.0 if over else now + report.rest * pace.factor
        rests = others if over else (*others, Rest(line.task, report.rest, now))
        return replace(self, pace=pace, rests=rests).with_task(replace(line, until=until))

    def with_context(self, **fields: Any) -> "Memory":
        """Return the memory with some of what was talked of replaced."""
        return replace(self, context=replace(self.context, **fields))

    def options(self, asker: str, at: float) -> tuple[Option, ...]:
        """Return the options of the question that is open to somebody."""
        open_ones = (one for one in self.asked if one.asker == asker and at < one.until)
        return next((one.options for one in open_ones), ())

    def asking(
        self, asker: str, at: float, options: tuple[Option, ...], replies: tuple[str, ...]
    ) -> "Memory":
        """Return the memory after a sentence of somebody: an earlier question to them has ended,
        this one is open.

        What would have answered the earlier one is an answer for a moment still: the second click
        of a double click.
        """
        others = [one for one in self.asked if one.asker != asker and at < one.until]
        open_ones = (one for one in self.asked if one.asker == asker and at < one.until)
        ended = [Asked(asker, at + AGAIN_S, (), one.replies) for one in open_ones]
        new = [Asked(asker, at + ASKED_S, options, replies)] if options else ended
        return replace(self, asked=(*others, *new)[-MOST_ASKED:])

    def again(self, word: Sentence) -> TaskLine | None:
        """Return what is answered to a sentence that its asker said just now; None for one that is
        new.
        """
        key = (word.asker, _sentence_key(word))
        same = (one for one in self.heard if (one.asker, one.words) == key)
        # in any order
        return next((one.line for one in same if abs(word.at - one.at) <= AGAIN_S), None)

    def hearing(self, word: Sentence, line: TaskLine) -> "Memory":
        """Return the memory after a sentence that something came of; one without an asker may be of
        several people.
        """
        recent = (one for one in self.heard if word.at - one.at <= AGAIN_S)
        others = tuple(one for one in recent if one.asker != word.asker)
        new = (Heard(word.asker, word.at, _sentence_key(word), line),) if word.asker else ()
        return replace(self, heard=(*others, *new)[-MOST_ASKED:])

    def forgetting(self, task: str) -> "Memory":
        """Return the memory in which the sentence of a cancelled task is new if it is said
        again.
        """
        return replace(self, heard=tuple(one for one in self.heard if one.line.task != task))

    def following(self, task: str, before: str) -> "Memory":
        """Return the memory with a task that needs the one before it."""
        return replace(self, follows=(*self.follows, (task, before)))

    def replacing(self, task: str, new: str) -> "Memory":
        """Return the memory in which a new task has taken the place of one that is to be cancelled.

        What was to come after the old one comes after the new one, which itself waits for nothing.
        """
        others = ((one, before) for one, before in self.follows if one != task)
        pairs = tuple((one, new if before == task else before) for one, before in others)
        return replace(self, follows=pairs)

    def with_news(self, *news: News) -> "Memory":
        """Return the memory with more news."""
        return replace(self, news=(*self.news, *news))


def _sentence_key(word: Sentence) -> tuple[str, int, str]:
    """What makes two sentences of somebody equal."""
    return word.text.strip(), 0 if word.instead else word.urgency, word.instead


CONDITIONS: dict[str, Callable[[Memory], bool]] = {
    "words_wait": lambda memory: bool(memory.words),
    "news_wait": lambda memory: bool(memory.news),
    "heard": lambda memory: bool(memory.words or memory.news),
    "interpreted": lambda memory: not memory.words,
    "told": lambda memory: not memory.news,
}

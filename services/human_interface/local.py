"""Messages between hi and its HTTP device. None is a communicate, none leaves the computer."""

import msgspec

from companion.run_files import HiEvent, Question, TaskLine, Wish
from services.human_interface.meaning import Meaning


class _Message(msgspec.Struct, frozen=True, tag=True):
    """A message between the agent and its HTTP device."""


class Said(_Message, frozen=True, omit_defaults=True):
    """A person said a sentence, which was read already; the answer goes to `ticket`. `held`: the robot is stopped.

    `urgency`, `within_s`, `later_s`: of the tasks that it becomes, 0 for none; `instead`: a task that they replace.
    `asker`: who said it, `at`: when [unix s]; `east_min`: how far the asker's clock is ahead of UTC [min], if known.
    """

    ticket: str
    text: str
    meaning: Meaning = Meaning()
    held: bool = False
    urgency: int = 0
    within_s: float = 0.0
    later_s: float = 0.0
    instead: str = ""
    asker: str = ""
    at: float = 0.0
    east_min: int | None = None


class CancelWanted(_Message, frozen=True, omit_defaults=True):
    """A person cancels a task, "" for the oldest open one; the answer is in `language`."""

    ticket: str
    task: str = ""
    language: str = "en"


class Halted(_Message, frozen=True):
    """A person stopped the robot (`held`) or let it go; it has been done already, where it could be (`reached`)."""

    held: bool
    reached: bool
    text: str


class StopRobot(_Message, frozen=True):
    """Stop the robot: what a person said meant that after all. The answer goes to `ticket`."""

    ticket: str
    text: str


class Answer(_Message, frozen=True):
    """To the person who holds the ticket: a line on a task, or `problem` with the HTTP status."""

    ticket: str
    line: TaskLine | None = None
    problem: str = ""
    status: int = 200


class Told(_Message, frozen=True):
    """An event for /events."""

    event: HiEvent


class Shown(_Message, frozen=True):
    """All tasks as they are now, for /tasks, what could be said and is asked; `events`: how many were told so far."""

    tasks: tuple[TaskLine, ...]
    events: int
    wishes: tuple[Wish, ...] = ()
    questions: tuple[Question, ...] = ()


Local = Said | CancelWanted | Halted
"""Messages that the HTTP device posts."""

"""Messages between hi and its HTTP device. None is a communicate, none leaves the computer."""

import msgspec

from companion.run_files import HiEvent, TaskLine


class _Message(msgspec.Struct, frozen=True, tag=True):
    """A message between the agent and its HTTP device."""


class Said(_Message, frozen=True):
    """A person said a sentence; the answer goes to `ticket`."""

    ticket: str
    text: str


class CancelWanted(_Message, frozen=True):
    """A person cancels a task, "" for the oldest open one."""

    ticket: str
    task: str = ""


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
    """All tasks as they are now, for /tasks; `events`: how many were told so far."""

    tasks: tuple[TaskLine, ...]
    events: int


Local = Said | CancelWanted
"""Messages that the HTTP device posts."""

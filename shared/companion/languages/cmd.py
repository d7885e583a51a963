"""CMD, the language of human commands and task states on channel C2 (ours: the paper leaves C2's language open).

Objects are named by the person's words ("jar"); which thing of the world that is, pl finds out from km.
"""

from enum import StrEnum

import msgspec


class Command(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """A command of a person. `urgency`: more urgent ones come first; `deadline`: unix time [s], 0 for none."""

    urgency: int = 0
    deadline: float = 0.0


class PourInto(Command, frozen=True):
    """Pour the content of one object into another."""

    source: str
    destination: str


class Take(Command, frozen=True):
    """Take an object out and hold it; the side is the robot's choice where none is named."""

    object: str
    side: str = ""


class PutDown(Command, frozen=True):
    """Put a held object down on the table."""

    object: str


class LookAround(Command, frozen=True):
    """Look around and say what is there."""


class TaskState(StrEnum):
    """A task's life as the person sees it."""

    WAITING = "waiting"
    PLANNING = "planning"
    RUNNING = "running"
    SUSPENDED = "suspended"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class TaskReport(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """State of a task, in words for a person. `steps`: with a new plan, what it does one after the other."""

    state: TaskState
    text: str = ""
    steps: tuple[str, ...] = ()


Task = PourInto | Take | PutDown | LookAround
Content = Task | TaskReport

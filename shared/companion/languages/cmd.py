"""CMD, the language of human commands and task states on channel C2 (ours: the paper leaves C2's language open).

Objects are named by the person's words ("jar"); which thing of the world that is, pl finds out from km.
"""

from enum import StrEnum
from typing import get_args

import msgspec

from companion.languages.evidence import Evidence
from companion.languages.facts import Facts
from companion.languages.values import Side


class Command(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """A command of a person. `urgency`: more urgent ones come first; `deadline`, `start`: until when it is to be done,
    and when it may begin, unix time [s], 0 for none. `after`: the task said before it in the same sentence.
    """

    urgency: int = 0
    deadline: float = 0.0
    start: float = 0.0
    after: str = ""


class PourInto(Command, frozen=True):
    """Pour the content of one object into another."""

    source: str
    destination: str


class Take(Command, frozen=True):
    """Take an object out and hold it; the side is the robot's choice where none is named."""

    object: str
    side: str = ""


class Bring(Command, frozen=True):
    """Take an object and hold it over a free place of a table, until it is to be put down there."""

    object: str
    side: str = ""


class SwapHands(Command, frozen=True):
    """Take a held object with the other hand; without a name the only one that is held."""

    object: str = ""


BACK = "back"
"""A place of PutDown: where the object stood before it was taken."""


class PutDown(Command, frozen=True):
    """Put a held object down wherever there is room. With a place ("table", "cabinet", BACK) put it there; it is taken
    first if no hand holds it.
    """

    object: str
    place: str = ""


class ClearTable(Command, frozen=True):
    """Put into the cabinet what stands on a table, as far as there is room for it."""


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
    """State of a task, and why. `steps`: with a new plan, what it does one after the other. `evidence`: at the end,
    what is true now and which senses told.

    `at`: the path of the plan's state that is under way, or, where it `asks`, that waits for an operator, with the hand
    that does it.
    """

    state: TaskState
    why: Facts = ()
    steps: tuple[str, ...] = ()
    at: str = ""
    side: Side | None = None
    asks: bool = False
    evidence: tuple[Evidence, ...] = ()


Task = PourInto | Take | Bring | SwapHands | PutDown | ClearTable | LookAround
TASKS = get_args(Task)
"""The classes of commands."""
Content = Task | TaskReport

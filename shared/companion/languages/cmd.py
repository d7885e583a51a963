"""CMD, the language of human commands and task states on channel C2 (ours: the paper leaves C2's
language open).

Objects are named by the person's words ("jar"); which thing of the world that is, pl finds out from
km.
"""

from enum import StrEnum
from typing import Annotated, ClassVar

import msgspec

from companion.languages import hfsm
from companion.languages.evidence import Evidence
from companion.languages.facts import Facts
from companion.languages.hfsm import Place, Step
from companion.languages.values import Side


class Command(
    msgspec.Struct,
    frozen=True,
    tag=True,
    forbid_unknown_fields=True,
    omit_defaults=True,
    kw_only=True,
):
    """A command of a person. Each task has its own: companion.tasks.<task>.command;
    companion.commands finds them.

    `urgency`: more urgent ones come first; `deadline`, `start`: until when it is to be done, and
    when it may begin, unix time [s], 0 for none. `after`: the task said before it in the same
    sentence. `surveys`: it is about no thing, and its end tells what was seen. `gives`: once it is
    done, a person has its things. `final`: nothing undoes it.
    """

    surveys: ClassVar[bool] = False
    gives: ClassVar[bool] = False
    final: ClassVar[bool] = False

    urgency: int = 0
    deadline: float = 0.0
    start: float = 0.0
    after: str = ""

    @property
    def task(self) -> hfsm.Task:
        """The task of the planning domain that pl is asked for."""
        raise NotImplementedError

    @property
    def says(self) -> str:
        """The row of [say] in the task's phrases.toml that says this command; its blanks are fields
        of the command.
        """
        raise NotImplementedError

    @property
    def things(self) -> tuple[str, ...]:
        """The names of the things that it is about, as far as it names them."""
        return tuple(name for field in THINGS if (name := getattr(self, field, "")))

    def settled(self, plan: hfsm.HierarchicalPlan) -> hfsm.Task | None:
        """The task that later plans are for, where this plan settled what the words mean; None for
        the same.
        """
        return None


THINGS = ("source", "destination", "object")
"""Fields of commands that name a thing."""
BACK = "back"
"""A place that a person may name: where the thing stood before it was taken."""


MOST_CHARACTERS = 200
"""Of a sentence, as hi reads it: it bounds the time of a parse (services.human_interface.grammar).
"""


class Sentence(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """What does a sentence of a person mean? The answer is the command that hi understands, in
    English or Polish; nothing is done. Only a word that stops the robot stops it at once.
    """

    text: Annotated[str, msgspec.Meta(min_length=1, max_length=MOST_CHARACTERS)]


class Stopped(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """A sentence had a word that stops the robot, and the robot was stopped; `text` says so."""

    text: str


class TaskState(StrEnum):
    """A task's life as the person sees it."""

    WAITING = "waiting"
    PLANNING = "planning"
    RUNNING = "running"
    SUSPENDED = "suspended"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class TaskReport(
    msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True
):
    """State of a task, and why. `steps`: with a new plan, what it does one after the other.
    `evidence`: at the end, what is true now and which senses told.

    `at`: where in the plan it is, or, where it `asks`, what waits for an operator. `number`: of the
    step there, the first is 1; 0 where it is none of the steps. `rest`: until the task is done, as
    planned [s], 0 where it is not known. `hands`: what each hand holds; None: nothing is told of
    them.
    """

    state: TaskState
    why: Facts = ()
    steps: tuple[Step, ...] = ()
    at: Place | None = None
    number: int = 0
    asks: bool = False
    evidence: tuple[Evidence, ...] = ()
    rest: float = 0.0
    hands: dict[Side, str] | None = None

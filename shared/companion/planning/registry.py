"""What the `plan` part of a task declares as PLAN, one row per task folder, and how the search
finds them.

Any task may name, besides what the rows declare: `localize` a thing (look at it, then plan again),
`a_look` at a thing, `a_confirm` that a thing stands where it was put, `a_home` with a hand,
`a_tell` a fact at the end, `a_replan` once a thing is localized, `a_some_done` (go on only if the
plan has a step); around a task, `after_arms_home`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from typing import Any, NamedTuple

from companion.languages.facts import Fact
from companion.languages.values import Side
from companion.planning.methods import Known, Subtasks
from companion.planning.steps import Step
from companion.tasks import parts

HANDS = (Side.LEFT, Side.RIGHT)
"""In the order in which they are tried: the paper takes the jar with the left hand."""
TRIES = ("1", "2", "3", "4")
"""Grasps from which a thing is to be held out, or put there. Estimate: a try takes seconds."""


class Argument(StrEnum):
    """What an argument of a task is."""

    THING = "thing"
    SIDE = "side"
    PLACE = "place"


Method = Callable[..., Subtasks | None]
"""(known, state at km, arguments of the task) -> subtasks, or None where it does not apply."""


class Each(NamedTuple):
    """A method that is tried with one value after the other; it gets the value before its
    arguments.
    """

    method: Method
    values: tuple[Any, ...]


def each_hand(method: Method) -> Each:
    return Each(method, HANDS)


def each_try(method: Method) -> Each:
    """The method for the number of each try."""
    return Each(method, TRIES)


@dataclass(frozen=True)
class Plan:
    """One task's part in the planning domain. Names are those that subtasks use, each declared in
    one row only.

    `tasks`: what can be asked for, with the kinds of the arguments. `refused`: of these tasks,
    function of the arguments (ids of km) that returns why they make no sense, or None. `methods`:
    of each task and subtask, in the order in which they are tried. A string names a method `around`
    tasks. `around`: methods that do something else first. They get the name of the task before its
    arguments. `actions`: primitive steps, functions (geometry, state at km, arguments) -> Step, or
    None with the reason noted. `conditions`: as actions, but they only tell whether the search goes
    on; None and False end the branch. `reveals`: function (known, state at km) that yields what may
    bring into sight a thing that was never seen.
    """

    tasks: dict[str, tuple[Argument, ...]] = field(default_factory=dict)
    refused: dict[str, Callable[..., Fact | None]] = field(default_factory=dict)
    methods: dict[str, tuple[Method | Each | str, ...]] = field(default_factory=dict)
    around: dict[str, Method | Each] = field(default_factory=dict)
    actions: dict[str, Callable[..., Step | None]] = field(default_factory=dict)
    conditions: dict[str, Callable[..., bool | None]] = field(default_factory=dict)
    reveals: Callable[[Known, str], Iterator[Subtasks]] | None = None


@cache
def rows() -> tuple[Plan, ...]:
    """The row of each task that has one, by the names of their folders."""
    return tuple(module.PLAN for module in parts("plan"))


@cache
def tasks() -> dict[str, tuple[Argument, ...]]:
    """All tasks that can be asked for, with the kinds of their arguments."""
    return {name: kinds for row in rows() for name, kinds in row.tasks.items()}


def object_arguments(task: str, arguments: tuple[str, ...]) -> tuple[str, ...]:
    """The arguments of a task that are things."""
    named = zip(arguments, tasks()[task], strict=True)
    return tuple(one for one, kind in named if kind is Argument.THING)

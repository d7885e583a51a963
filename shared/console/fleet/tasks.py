"""Tasks that people gave a system, if it has tasks: shown by `roco status` and `roco top`."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from console.errors import ConsoleError
from operate.system import NoSystemError

if TYPE_CHECKING:
    from console.fleet.targets import Target

ENDED = ("done", "failed", "cancelled", "refused")


class Task(Protocol):
    """A task: its id, its state ("running", ..., or one of ENDED), what is to be said of it, what a
    person said.
    """

    @property
    def task(self) -> str: ...
    @property
    def state(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def said(self) -> str: ...


def of(fleet: "Target") -> tuple[tuple[Task, ...], str]:
    """Return the tasks of a fleet, oldest first, and why they are not known, "" where they are;
    none of a system without.
    """
    try:
        told: Callable[[Target], Sequence[Task]] | None = fleet.system.addition("tasks")
        return (tuple(told(fleet)), "") if told is not None else ((), "")
    except (ConsoleError, NoSystemError) as error:
        return (), str(error)

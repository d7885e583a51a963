"""What methods of tasks decide by: facts of a state at km, and the notes why something is not done.

A method gets Known, the id of the state at km, and the arguments of its task. It returns subtasks, or None if it does
not apply; it raises Unanswered if km does not know a fact. Must not know: geometry.
"""

from dataclasses import dataclass, field
from typing import Any

from companion.languages.facts import Fact, Facts
from companion.languages.values import Side
from companion.planning.asking import Asking
from companion.planning.state_facts import StateFacts

OTHER = {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}

Subtasks = list[tuple[Any, ...]]
"""Tasks and actions by their names, with arguments, in order. Those of other tasks are named too, never imported."""


@dataclass
class Known:
    """Queries to km and the facts made of them.

    `why`: reasons why a task or step cannot be done, newest last. `not_now`: why the method that was tried last does
    not apply.
    """

    ask: Asking
    facts: StateFacts = field(init=False)
    why: list[Facts] = field(init=False, default_factory=list)
    not_now: Facts = field(init=False, default=())

    def __post_init__(self) -> None:
        self.facts = StateFacts(self.ask)

    def failed(self, *why: Fact) -> None:
        """Note why something cannot be done at all: the person is told if there is no plan."""
        self.why.append(why)

    def unfit(self, *why: Fact) -> Subtasks | None:
        """Return None, with the note why this method does not apply: another one may."""
        self.not_now = why
        return None


def away(known: Known, km: str) -> list[Side]:
    """Return the sides of empty arms that are not at home."""
    return [side for side in Side if not known.facts.in_hand(km, side) and not known.facts.at_home(km, side)]

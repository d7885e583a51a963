"""Rules of a design that must never be broken: an agent says something while others are in a certain state."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from topdown.design import Design
from topdown.errors import DesignError
from topdown.machines import NONE, Machine, Said
from topdown.own_tables import act_word

if TYPE_CHECKING:
    from topdown.proving.parts import Parts

IN, OWES = "in", "owes"


class While(NamedTuple):
    """A condition on an agent: it is in a state, owes news in a use, or has its conversation of a use in a state."""

    agent: int
    what: str
    words: frozenset[str]

    def holds(self, parts: "Parts", state: tuple[int, ...]) -> bool:
        """Whether it holds in a state of the composed model."""
        local = parts.local(self.agent, state[self.agent])
        if self.what == IN:
            return local.state in self.words
        if self.what == OWES:
            return any(parts.net(state[parts.net_of[use]]).stale for use in self.words)
        return (parts.agents[self.agent].talk(local, self.what) or NONE) in self.words


class Never(NamedTuple):
    """elements.Never, read."""

    name: str
    text: str
    agent: str
    says: frozenset[Said]
    whiles: tuple[While, ...]

    def broken(self, parts: "Parts", state: tuple[int, ...]) -> bool:
        """Whether saying it in this state breaks the rule."""
        return all(condition.holds(parts, state) for condition in self.whiles)


def nevers(design: Design, place: Mapping[str, int], machines: Mapping[str, Machine]) -> tuple[Never, ...]:
    """The rules of a design. Raises DesignError for one that cannot be read."""
    return tuple(
        Never(
            rule.name,
            rule.text,
            rule.agent,
            frozenset(_said(text) for text in rule.says),
            tuple(_while(text, rule.name, place, machines, design.path) for text in rule.while_),
        )
        for rule in design.file.never
    )


def _said(text: str) -> Said:
    use, _, word = text.partition(" ")
    return Said(use, *act_word(word))


def _while(text: str, name: str, place: Mapping[str, int], machines: Mapping[str, Machine], file: str) -> While:
    agent, _, rest = text.partition(" ")
    what, _, words = rest.partition(" ")
    if agent not in place or not words or (what not in (IN, OWES) and what not in machines[agent].uses):
        right = (
            f'write "AGENT in STATE|STATE", "AGENT owes USE" or "AGENT USE STATE|STATE"; agents are {", ".join(place)}'
        )
        raise DesignError(file or "design.toml", None, f"never {name}", f"{text!r} is no condition", right)
    return While(place[agent], what, frozenset(words.split("|")))

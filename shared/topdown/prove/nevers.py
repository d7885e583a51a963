"""Rules of a design that must never be broken: an agent says something while others are in a certain state."""

from collections.abc import Collection, Mapping
from typing import NamedTuple, Protocol

from fipa_codec.tables import Role
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.model.machines import NONE, Machine, Said
from topdown.model.own_tables import act_word

IN, OWES = "in", "owes"


class Composed(Protocol):
    """Questions of a rule to the composed model (topdown.prove.parts.Parts): agents are numbered, uses are named."""

    def state_of(self, agent: int, state: tuple[int, ...]) -> str:
        """The name of the state that an agent is in."""

    def owes(self, use: str, state: tuple[int, ...]) -> bool:
        """Whether the newest news of a use is not yet told."""

    def talk_of(self, agent: int, use: str, state: tuple[int, ...]) -> str:
        """State of an agent's conversation of a use, "" where none is open."""


class While(NamedTuple):
    """A condition on an agent: it is in a state, owes news in a use, or has its conversation of a use in a state."""

    agent: int
    what: str
    words: frozenset[str]

    def holds(self, model: Composed, state: tuple[int, ...]) -> bool:
        """Whether it holds in a state of the composed model."""
        if self.what == IN:
            return model.state_of(self.agent, state) in self.words
        if self.what == OWES:
            return any(model.owes(use, state) for use in self.words)
        return (model.talk_of(self.agent, self.what, state) or NONE) in self.words


class Never(NamedTuple):
    """elements.Never, read."""

    name: str
    text: str
    agent: str
    says: frozenset[Said]
    whiles: tuple[While, ...]

    def broken(self, model: Composed, state: tuple[int, ...]) -> bool:
        """Whether saying it in this state breaks the rule."""
        return all(condition.holds(model, state) for condition in self.whiles)


def nevers(design: Design, place: Mapping[str, int], machines: Mapping[str, Machine]) -> tuple[Never, ...]:
    """The rules of a design. Raises DesignError for one that cannot be read."""
    return tuple(_Reader(design, rule, place, machines).never() for rule in design.file.never)


class _Reader:
    """Reads one rule: a word that nothing answers to would make it hold for ever."""

    def __init__(
        self, design: Design, rule: elements.Never, place: Mapping[str, int], machines: Mapping[str, Machine]
    ) -> None:
        self.file, self.rule, self.place, self.machines = design.path or "design.toml", rule, place, machines

    def never(self) -> Never:
        rule = self.rule
        self._among("agent", rule.agent, self.machines)
        says = frozenset(map(self._said, rule.says))
        return Never(rule.name, rule.text, rule.agent, says, tuple(map(self._while, rule.while_)))

    def _said(self, text: str) -> Said:
        use, _, word = text.partition(" ")
        self._among(f"protocol of {self.rule.agent}", use, self.machines[self.rule.agent].uses)
        try:
            return Said(use, *act_word(word))
        except ValueError as error:
            raise self._error(f"{text!r}: {error}", 'write "USE act" or "USE act[kind]"') from error

    def _while(self, text: str) -> While:
        agent, _, rest = text.partition(" ")
        what, _, words = rest.partition(" ")
        if agent not in self.place or not words or what not in (IN, OWES, *self.machines[agent].uses):
            right = 'write "AGENT in STATE|STATE", "AGENT owes USE" or "AGENT USE STATE|STATE"; agents are '
            raise self._error(f"{text!r} is no condition", right + ", ".join(self.place))
        for word in words.split("|"):
            self._among(f"word in {text!r}:", word, self._known(self.machines[agent], what))
        return While(self.place[agent], what, frozenset(words.split("|")))

    def _known(self, machine: Machine, what: str) -> Collection[str]:
        if what == IN:
            return {state.name for state in machine.entry.state}
        if what == OWES:
            return {use.name for use in machine.uses.values() if use.latest and use.role is Role.PARTICIPANT}
        use = machine.uses[what]
        return {*map(str, use.protocol.tables[use.role].states), NONE}

    def _among(self, kind: str, name: str, known: Collection[str]) -> None:
        if name not in known:
            raise self._error(f"no {kind} {name!r}", f"there are {', '.join(sorted(known)) or 'none'}")

    def _error(self, wrong: str, right: str) -> DesignError:
        return DesignError(self.file, None, f"never {self.rule.name}", wrong, right)

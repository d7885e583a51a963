"""The parts of the composed model, with numbers in place of values: agents, queues, nets, and what events lead to.

Everything that depends on an agent's local state alone is worked out once and kept.
"""

from typing import Any, NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role
from topdown.model.design import Design
from topdown.model.machines import Cause, Machine, Said
from topdown.prove.in_flight import Net
from topdown.prove.local import GONE, Agent, Effect, Local, Outcome
from topdown.prove.nevers import Never, nevers
from topdown.prove.silence import silent_words

SAY, OPEN, CLOSE, ORPHAN, OWE, ANSWER, ADD = range(7)
OWN, RESTART = "own", "restart"


class Numbered:
    """Values and their numbers, in the order they were met."""

    def __init__(self, *first: Any) -> None:
        self.values: list[Any] = []
        self.numbers: dict[Any, int] = {}
        for value in first:
            self(value)

    def __call__(self, value: Any) -> int:
        number = self.numbers.get(value)
        if number is None:
            number = self.numbers[value] = len(self.values)
            self.values.append(value)
        return number


class Ready(NamedTuple):
    """An outcome with numbers in place of words: `there` is the local state, `effects` are (slot, kind, word)."""

    there: int
    effects: tuple[tuple[int, int, Said | None], ...]
    label: str
    fair: bool
    fault: bool
    late: bool
    again: str
    rules: tuple[Never, ...]
    row: int


class Parts:
    """`place` of each agent in a state, then the slots of queues (`queue_of`) and nets (`net_of`), last the faults."""

    def __init__(self, design: Design, machines: dict[str, Machine]) -> None:
        self.names = list(machines)
        self.place = {name: number for number, name in enumerate(self.names)}
        self.rules = nevers(design, self.place, machines)
        forbidden = frozenset(said for rule in self.rules for said in rule.says)
        self.silent = silent_words(machines.values(), forbidden)
        self.agents = [Agent(machine, self.silent) for machine in machines.values()]
        self.locals = [Numbered(agent.start) for agent in self.agents]
        self.queues, self.nets = Numbered(()), Numbered(Net())
        count = len(self.agents)
        self.queue_of = {pair: count + number for number, pair in enumerate(sorted(_pairs(self.agents)))}
        soft = [use for use in design.file.protocol if not use.durable and use.follows in design.tables]
        first = count + len(self.queue_of)
        self.net_of = {use.name: first + number for number, use in enumerate(soft)}
        self.soft = soft
        self.size = first + len(soft) + 1
        self._found: dict[tuple[int, int, Any], Any] = {}
        self._changes: dict[tuple[int, int, str, str], int] = {}
        self._nets: dict[tuple[int, int, Said | None], int] = {}

    # --- numbers and values -------------------------------------------------------------------------------------------

    def local(self, number: int, local: int) -> Local:
        """An agent's local state."""
        value: Local = self.locals[number].values[local]
        return value

    def net(self, net: int) -> Net:
        """Return the net of a volatile use: the words on their way."""
        value: Net = self.nets.values[net]
        return value

    def talk(self, number: int, local: int, use: str) -> str:
        """State of an agent's conversation of a use."""
        return self.agents[number].talk(self.local(number, local), use)

    def state_of(self, agent: int, state: tuple[int, ...]) -> str:
        """The name of the state that an agent is in."""
        return self.local(agent, state[agent]).state

    def owes(self, use: str, state: tuple[int, ...]) -> bool:
        """Whether the newest news of a use is not yet told."""
        return self.net(state[self.net_of[use]]).stale

    def talk_of(self, agent: int, use: str, state: tuple[int, ...]) -> str:
        """State of an agent's conversation of a use, "" where none is open."""
        return self.talk(agent, state[agent], use)

    def without_talk(self, number: int, local: int, use: str) -> int:
        """The local state that has forgotten its conversation of a volatile use."""
        return self._changed(number, local, "talk", use)

    def without_debt(self, number: int, local: int, use: str) -> int:
        """The local state that owes nothing more in a use."""
        return self._changed(number, local, "debt", use)

    def with_news(self, number: int, local: int, peer: str) -> int:
        """The local state that has heard that a peer came back, if that matters to it."""
        return self._changed(number, local, "news", peer)

    def _changed(self, number: int, local: int, what: str, name: str) -> int:
        key = (number, local, what, name)
        found = self._changes.get(key)
        if found is None:
            agent, value = self.agents[number], self.local(number, local)
            if what == "talk":
                value = agent.with_talk(value, name, "")
            elif what == "debt":
                value = value._replace(owed=value.owed - {name})
            elif value.state != GONE:
                value = value._replace(news=value.news | ({name} & agent.watched))
            found = self._changes[key] = self.locals[number](value)
        return found

    def net_after(self, net: int, kind: int, said: Said | None) -> int:
        """Return the net of a volatile use after an effect."""
        key = (net, kind, said)
        found = self._nets.get(key)
        if found is None:
            found = self._nets[key] = self.nets(_NET[kind](self.nets.values[net], said))
        return found

    def resting(self, number: int, local: int) -> bool:
        """Whether an agent is at rest."""
        key = (number, local, "rest")
        if key not in self._found:
            self._found[key] = self.agents[number].at_rest(self.local(number, local))
        rests: bool = self._found[key]
        return rests

    # --- outcomes -----------------------------------------------------------------------------------------------------

    def outcomes(self, number: int, local: int, what: Any) -> "tuple[Ready, ...] | str | None":
        """Of a word, of what is OWN, of a RESTART. None: a word waits; a text: nobody has thought of it."""
        key = (number, local, what)
        if key not in self._found:
            self._found[key] = self._outcomes(number, self.local(number, local), what)
        found: tuple[Ready, ...] | str | None = self._found[key]
        return found

    def unasked(self, number: int, local: int, what: str) -> tuple[Ready, ...]:
        """Of what is OWN, of a RESTART, of an agent that is GONE."""
        found = self.outcomes(number, local, what)
        assert isinstance(found, tuple)
        return found

    def _outcomes(self, number: int, local: Local, what: Any) -> "tuple[Ready, ...] | str | None":
        agent = self.agents[number]
        if what == OWN:
            return tuple(self._ready(number, outcome, event.cause) for outcome, event in agent.spontaneous(local))
        if what == RESTART:
            return tuple(self._ready(number, outcome, Cause.RESTART) for outcome in agent.restarted(local))
        if what == GONE:
            return (self._ready(number, agent.gone(), Cause.RESTART),)
        found = agent.take(local, what)
        if found is None or isinstance(found, str):
            return found
        return tuple(self._ready(number, outcome, Cause.TAKE) for outcome in found)

    def _ready(self, number: int, outcome: Outcome, cause: Cause) -> Ready:
        agent = self.agents[number]
        said = {effect.said for effect in outcome.effects}
        late = cause is Cause.LATE
        return Ready(
            there=self.locals[number](outcome.there),
            effects=tuple(self._effect(agent, effect) for effect in outcome.effects),
            label=outcome.label,
            fair=cause not in (Cause.PERSON, Cause.RESTART, Cause.LATE),
            fault=late or cause is Cause.RESTART,
            late=late,
            again=outcome.again,
            rules=tuple(rule for rule in self.rules if rule.agent == agent.machine.agent and rule.says & said),
            row=outcome.row,
        )

    def _effect(self, agent: Agent, effect: Effect) -> tuple[int, int, Said | None]:
        use = agent.machine.uses[effect.use]
        if use.durable:
            return self.queue_of[agent.machine.agent, use.peer], SAY, effect.said
        slot, initiates = self.net_of[use.name], use.role is Role.INITIATOR
        if effect.kind == "close":
            return slot, CLOSE if initiates else ORPHAN, None
        if effect.kind == "owe":
            return slot, OWE, Said(use.name, Performative.INFORM, Kind.PLAIN)
        if effect.kind == "open":
            return slot, OPEN, effect.said
        return slot, ADD if initiates else ANSWER, effect.said


_NET: dict[int, Any] = {
    OPEN: lambda net, said: net.opened(said),
    CLOSE: lambda net, said: net.closed(),
    ORPHAN: lambda net, said: net.orphaned(),
    OWE: lambda net, said: net.owed(said),
    ANSWER: lambda net, said: net.answered(said),
    ADD: lambda net, said: net.added(said),
}


def _pairs(agents: list[Agent]) -> set[tuple[str, str]]:
    """Return the pairs (sender, receiver) that have a durable stream."""
    return {
        pair
        for agent in agents
        for use in agent.uses
        if use.durable
        for pair in ((agent.machine.agent, use.peer), (use.peer, agent.machine.agent))
    }

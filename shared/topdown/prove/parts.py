"""The parts of the composed model, with numbers in place of values: agents, queues, nets, and what
events lead to.

Everything that depends on an agent's local state alone is worked out once and kept.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from fipa_codec.exploration import reached
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, Role, Table, Way
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.machines import NONE, Cause, Event, Machine, ProtocolAct, References, Row
from topdown.prove.flat import Numbered
from topdown.prove.local import GONE, Agent, Effect, Local, Outcome

# --- Rules of a design that must never be broken: an agent says something while others are in a
# certain state


IN, OWES = "in", "owes"


class While(NamedTuple):
    """A condition on an agent: it is in a state, owes news in a use, or has its conversation of a
    use in a state.
    """

    agent: int
    what: str
    words: frozenset[str]

    def holds(self, model: "Parts", state: Sequence[int]) -> bool:
        """Whether it holds in a state of the composed model."""
        if self.what == OWES:
            return any(model.net(state[model.net_of[use]]).stale for use in self.words)
        return self.of(model.agents[self.agent], model.local(self.agent, state[self.agent]))

    def of(self, agent: Agent, local: Local) -> bool:
        """Whether it holds in a local state of its agent, where it is not of news."""
        found = local.state if self.what == IN else agent.talk(local, self.what) or NONE
        return found in self.words


class Never(NamedTuple):
    """elements.Never, read: `says` must not be said where all `whiles` hold, after the event and
    before the row says anything.
    """

    name: str
    text: str
    agent: str
    says: frozenset[ProtocolAct]
    whiles: tuple[While, ...]

    def broken(self, model: "Parts", state: Sequence[int]) -> bool:
        """Whether saying it breaks the rule; `state`: after the event."""
        return all(condition.holds(model, state) for condition in self.whiles)


def nevers(
    design: Design, place: Mapping[str, int], machines: Mapping[str, Machine]
) -> tuple[Never, ...]:
    """The rules of a design. Raises DesignError for one that cannot be read."""
    return tuple(_Rule(design, rule, place, machines).never() for rule in design.file.never)


class _Rule(References):
    """Reads one rule: a word that nothing answers to would make it hold for ever."""

    def __init__(
        self,
        design: Design,
        rule: elements.Never,
        place: Mapping[str, int],
        machines: Mapping[str, Machine],
    ) -> None:
        super().__init__(design, f"never {rule.name}")
        self.rule, self.place, self.machines = rule, place, machines

    def never(self) -> Never:
        rule = self.rule
        self.among("agent", rule.agent, self.machines)
        uses = self.machines[rule.agent].uses
        says = frozenset(self.said(text, uses, f"protocol of {rule.agent}") for text in rule.says)
        return Never(rule.name, rule.text, rule.agent, says, tuple(map(self._while, rule.while_)))

    def _while(self, text: str) -> While:
        agent, _, rest = text.partition(" ")
        what, _, words = rest.partition(" ")
        known = (IN, OWES, *self.machines[agent].uses) if agent in self.place else ()
        if not words or what not in known:
            right = 'write "AGENT in STATE|STATE", "AGENT owes USE" or "AGENT USE STATE|STATE"'
            agents = f"; agents are {', '.join(self.place)}"
            raise self.error(f"{text!r} is no condition", right + agents)
        for word in words.split("|"):
            self.among(f"word in {text!r}:", word, self._known(self.machines[agent], what))
        return While(self.place[agent], what, frozenset(words.split("|")))

    def _known(self, machine: Machine, what: str) -> Collection[str]:
        if what == IN:
            return {state.name for state in machine.entry.state}
        if what == OWES:
            told = (use for use in machine.uses.values() if use.role is Role.PARTICIPANT)
            return {use.name for use in told if use.latest}
        use = machine.uses[what]
        return {*map(str, use.protocol.tables[use.role].states), NONE}


# --- Words that change nothing: progress told and confirmed. They are proven to be so, and then
# left out of the model A word is silent where its receiver, in whatever state its table lets it
# come, stands as before after taking it, and answers with silent words only. Left out as well is
# thus a queue that such words fill: who may say one over and over is told (`endless`). The proof
# looks afterwards at every state that was reached (`Agent.take`), since rows may miss a state.


def silent_words(
    machines: Iterable[Machine], forbidden: frozenset[ProtocolAct] = frozenset()
) -> frozenset[ProtocolAct]:
    """The greatest set of words of durable uses that are silent if all of the set are, but for
    those that a rule of the design forbids at times.
    """
    kept = tuple(machines)
    found = {said for machine in kept for said in _heard(machine)} - forbidden
    while True:
        loud = {
            said
            for machine in kept
            for said in _heard(machine) & found
            if not _is_silent(machine, said, found)
        }
        if not loud:
            return frozenset(found)
        found -= loud


def endless(machine: Machine, silent: Collection[ProtocolAct]) -> Iterator[str]:
    """In words what an agent says over and over in durable uses, taking nothing in between, though
    the model leaves it out: words that are silent, and those under `may`.
    """
    for row in _free_loops(machine):
        for said in dict.fromkeys((*(word for word in row.say if word in silent), *row.may)):
            use = machine.uses[said.use]
            if use.durable:
                told = f"how many `{said}` of {machine.agent} wait for {use.peer}"
                where = f"in {'|'.join(sorted(row.states))} on {row.event}"
                again = f"it may be said over and over (row {row.number})"
                yield f"{told}: {where} {again}; a full outbox holds {machine.agent} back"


def _free_loops(machine: Machine) -> Iterator[Row]:
    """Rows without a message from whose next state such rows lead back to a state of theirs."""
    unasked = (row for row in machine.rows if row.event.cause in (Cause.OWN, Cause.PERSON))
    free = [row for row in unasked if not row.several]
    leads = {
        state: {row.to or state for row in free if state in row.states} for state in machine.waits
    }
    for row in free:
        if any(state in reached([row.to or state], leads.__getitem__) for state in row.states):
            yield row


def _heard(machine: Machine) -> set[ProtocolAct]:
    """The messages an agent's tables let it take, in durable uses."""
    return {
        ProtocolAct(use.name, row.performative, row.kind)
        for use in machine.uses.values()
        if use.durable
        for row in use.protocol.tables[use.role]
        if row.way is Way.RECEIVE
    }


def _is_silent(machine: Machine, said: ProtocolAct, silent: set[ProtocolAct]) -> bool:
    event = Event(Cause.TAKE, *said)
    rows = [row for row in machine.rows if row.event == event and not row.several]
    use = machine.uses[said.use]
    table = use.protocol.tables[use.role]
    word = (RECEIVE, said.act, said.kind)
    taken = [row for row in table if (row.way, row.performative, row.kind) == word]
    return (
        bool(rows)
        and not any(row.to or row.owes or row.waits or row.drop or row.moves for row in rows)
        and all(one in silent for row in rows for one in row.say)
        # every row of the table that takes it comes back to its state, over silent words that it
        # owes
        and all(row.state == _settled(table, str(row.to), said.use, silent) for row in taken)
    )


def _settled(table: Table, state: str, use: str, silent: set[ProtocolAct]) -> str:
    """The state that the words owed in a state lead to, if all of them are silent."""
    seen = set()
    while state in table.urgent and state not in seen:
        seen.add(state)
        owed = table.allowed(state, SEND)
        if len(owed) != 1 or ProtocolAct(use, owed[0].performative, owed[0].kind) not in silent:
            break
        state = str(owed[0].to)
    return state


# --- Words on their way outside the durable streams: questions, answers, subscriptions, the newest
# observations
# A volatile channel is a set of words: copies of one word are one, and what belongs to a question
# that was given up is dropped at once, as the receiver would. All operations are pure.


class Net(NamedTuple):
    """`words` on the way. `current`: the participant's conversation is the initiator's present one.
    `stale`: there is news the initiator does not have, as far as the participant was told.
    """

    words: frozenset[ProtocolAct] = frozenset()
    current: bool = False
    stale: bool = False

    def opened(self, said: ProtocolAct) -> "Net":
        """The initiator asks, perhaps again: every other word on the way belongs to an older
        question.
        """
        return Net(frozenset({said}), False, self.stale)

    def closed(self) -> "Net":
        """The initiator has its answer, gave up, or died: nobody waits for what is on the way."""
        return Net(frozenset(), False, self.stale)

    def orphaned(self) -> "Net":
        """The participant's conversation is over, or gone with its death; what it said is still on
        the way.
        """
        return self._replace(current=False)

    def added(self, said: ProtocolAct) -> "Net":
        """One more word."""
        return self._replace(words=self.words | {said})

    def answered(self, said: ProtocolAct) -> "Net":
        """The participant says something; in a conversation that nobody holds any more it is
        lost.
        """
        return self.added(said) if self.current else self

    def owed(self, news: ProtocolAct) -> "Net":
        """Something new was observed: it is sent where somebody listens; older news are worth
        nothing.
        """
        return Net(self.words | {news} if self.current else self.words - {news}, self.current, True)

    def known(self, news: ProtocolAct) -> "Net":
        """The newest observation was taken, and its receipt came."""
        return Net(self.words - {news}, self.current, False)

    def taken(self, said: ProtocolAct, *, copy: bool = False) -> "Net":
        """A word was taken; of a copied one another is still on the way."""
        return self if copy else self._replace(words=self.words - {said})

    def accepted(self) -> "Net":
        """The participant took the opening: its conversation is the present one."""
        return self._replace(current=True)


# --- The parts of the composed model, with numbers in place of values -----------------------------


SAY, OPEN, CLOSE, ORPHAN, OWE, ANSWER, ADD = range(7)
OWN, RESTART = "own", "restart"
Effects = tuple[tuple[int, int, ProtocolAct | None], ...]


class Ready(NamedTuple):
    """An outcome with numbers in place of words: `there` is the local state, `happened` (by the
    event) and `effects` (by the row) are (slot, kind, word). `rules`: what of them the local state
    after the event leaves open.
    """

    there: int
    happened: Effects
    effects: Effects
    label: str
    fair: bool
    fault: bool
    late: bool
    again: str
    rules: tuple[Never, ...]
    row: int


class Parts:
    """`place` of each agent in a state, then the slots of queues (`queue_of`) and nets (`net_of`),
    last the faults. `limited`: uses with an included system, where a wait is over sooner or later.
    """

    def __init__(
        self,
        design: Design,
        machines: dict[str, Machine],
        limited: frozenset[str] = frozenset(),
    ) -> None:
        self.names, self.limited = list(machines), limited
        self.place = {name: number for number, name in enumerate(self.names)}
        self.rules = nevers(design, self.place, machines)
        forbidden = frozenset(said for rule in self.rules for said in rule.says)
        self.silent = silent_words(machines.values(), forbidden)
        self.agents = [Agent(machine, self.silent, limited) for machine in machines.values()]
        self.locals = [Numbered(agent.start) for agent in self.agents]
        self.queues, self.nets = Numbered(()), Numbered(Net())
        count = len(self.agents)
        pairs = sorted(_pairs(self.agents))
        self.queue_of = {pair: number for number, pair in enumerate(pairs, start=count)}
        known = (use for use in design.file.protocol if use.follows in design.tables)
        self.soft = [use for use in known if not use.durable]
        first = count + len(pairs)
        self.net_of = {use.name: number for number, use in enumerate(self.soft, start=first)}
        self.size = first + len(self.soft) + 1
        self._found: dict[tuple[int, int, Any], Any] = {}
        self._changes: dict[tuple[int, int, str, str], int] = {}
        self._nets: dict[tuple[int, int, ProtocolAct | None], int] = {}

    # --- numbers and values -----------------------------------------------------------------------

    def local(self, number: int, local: int) -> Local:
        """An agent's local state."""
        value: Local = self.locals[number].values[local]
        return value

    def net(self, net: int) -> Net:
        """The net of a volatile use: the words on their way."""
        value: Net = self.nets.values[net]
        return value

    def talk(self, number: int, local: int, use: str) -> str:
        """State of an agent's conversation of a use."""
        return self.agents[number].talk(self.local(number, local), use)

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

    def net_after(self, net: int, kind: int, said: ProtocolAct | None) -> int:
        """The net of a volatile use after an effect."""
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

    # --- outcomes ---------------------------------------------------------------------------------

    def outcomes(self, number: int, local: int, what: Any) -> "tuple[Ready, ...] | str | None":
        """Of a word, of what is OWN, of a RESTART. None: a word waits; a text: nobody has thought
        of it.
        """
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
            unasked = agent.spontaneous(local)
            return tuple(
                self._ready(number, outcome, Cause.OWN if ends else event.cause)
                for outcome, event in unasked
                for ends in (event.cause is Cause.LATE and event.name in self.limited,)
            )
        if what in (RESTART, GONE):
            dead = agent.restarted(local) if what == RESTART else (agent.gone(),)
            return tuple(self._ready(number, outcome, Cause.RESTART) for outcome in dead)
        found = agent.take(local, what)
        if found is None or isinstance(found, str):
            return found
        return tuple(self._ready(number, outcome, Cause.TAKE) for outcome in found)

    def _ready(self, number: int, outcome: Outcome, cause: Cause) -> Ready:
        agent = self.agents[number]
        late = cause is Cause.LATE
        return Ready(
            there=self.locals[number](outcome.there),
            happened=tuple(self._effect(agent, effect) for effect in outcome.happened),
            effects=tuple(self._effect(agent, effect) for effect in outcome.effects),
            label=outcome.label,
            fair=cause not in (Cause.PERSON, Cause.RESTART, Cause.LATE),
            fault=late or cause is Cause.RESTART,
            late=late,
            again=outcome.again,
            rules=tuple(self._rules(agent, outcome)),
            row=outcome.row,
        )

    def _rules(self, agent: Agent, outcome: Outcome) -> Iterator[Never]:
        """The rules that an outcome may break, with the conditions that its agent does not meet by
        itself.
        """
        said = {effect.said for effect in outcome.effects}
        for rule in self.rules:
            if rule.agent == agent.machine.agent and rule.says & said:
                own = self.place[rule.agent]
                known = [one for one in rule.whiles if one.agent == own and one.what != OWES]
                if all(one.of(agent, outcome.heard) for one in known):
                    rest = tuple(one for one in rule.whiles if one not in known)
                    yield rule._replace(whiles=rest)

    def _effect(self, agent: Agent, effect: Effect) -> tuple[int, int, ProtocolAct | None]:
        use = agent.machine.uses[effect.use]
        if use.durable:
            return self.queue_of[agent.machine.agent, use.peer], SAY, effect.said
        slot, initiates = self.net_of[use.name], use.role is Role.INITIATOR
        if effect.kind == "close":
            return slot, CLOSE if initiates else ORPHAN, None
        if effect.kind == "owe":
            return slot, OWE, ProtocolAct(use.name, Performative.INFORM, Kind.PLAIN)
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
    """The pairs (sender, receiver) that have a durable stream."""
    return {
        pair
        for agent in agents
        for use in agent.uses
        if use.durable
        for pair in ((agent.machine.agent, use.peer), (use.peer, agent.machine.agent))
    }

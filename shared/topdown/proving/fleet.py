"""The composed system: every agent's rows and conversations on ideal durable queues, with faults of all soft parts.

Durable streams are ideal FIFO queues here; layer 1 proves that they may be taken so. Queries, subscriptions and
observations are volatile (nets.py): lost or doubled by faults, asked again once nothing is on the way. A death and the
coming back are one step: what is in the journal stays, soft conversations are gone. What is left out, and why that is
safe, stands in abstractions.py. A state is a flat tuple of small numbers, so that a million of them fit into memory.
"""

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from fipa_codec.tables import Role
from topdown.design import Design
from topdown.machines import Cause, Event, Machine, Said, machines
from topdown.proving.local import GONE, Agent, Effect, Local, Outcome
from topdown.proving.nets import Net
from topdown.proving.nevers import Never, nevers
from topdown.proving.soft import Soft
from topdown.silence import silent_words

QUEUE_BOUND = 5
"""Longest durable queue (estimate): the outbox of a running agent holds 16; this alarms long before back-pressure."""
ANY = -1
"""Any number of faults."""


class Faults(NamedTuple):
    """How many faults may happen in all (ANY: no limit), and of which kinds.

    `gone`: an agent that may die for good, at any time; rest then means that `waiting` is idle, and after that death
    waits that are over count as what will happen.
    """

    most: int = 0
    deaths: bool = True
    losses: bool = True
    copies: bool = True
    expiries: bool = True
    gone: str = ""
    waiting: str = ""


Flat = tuple[Any, ...]
"""Numbers of the agents' local states, of the queues' contents, of the nets; last the faults that may still come."""


Found = Any
"""A plain tuple of engine.Move's five fields: quicker made than a Move."""


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
    """An outcome as the composed model uses it: numbers in place of words."""

    there: int
    effects: tuple[tuple[int, int, Said | None], ...]
    label: str
    fair: bool
    fault: bool
    again: str
    rules: tuple[Never, ...]
    row: int
    late: bool


SAY, OPEN, CLOSE, ORPHAN, OWE, ANSWER, ADD = range(7)


class Fleet:
    """The model, for topdown.proving.engine.explore."""

    def __init__(self, design: Design, faults: Faults | None = None, parts: "dict[str, Machine] | None" = None) -> None:
        self.faults = faults or Faults()
        kept = parts or machines(design)
        self.silent = silent_words(kept.values())
        self.agents = [Agent(machine, self.silent) for machine in kept.values()]
        self.names = [agent.machine.agent for agent in self.agents]
        self.place = {name: number for number, name in enumerate(self.names)}
        self.locals = [Numbered(agent.start) for agent in self.agents]
        pairs = sorted(_pairs(self.agents))
        self.queue_of = {pair: len(self.agents) + number for number, pair in enumerate(pairs)}
        self.queues = Numbered(())
        soft = [use for use in design.file.protocol if not use.durable and use.follows in design.tables]
        self.nets = Numbered(Net())
        first = len(self.agents) + len(pairs)
        self.soft = [Soft(self, first + number, use) for number, use in enumerate(soft)]
        self.net_of = {one.use: one.slot for one in self.soft}
        self.rules = nevers(design, self.place, kept)
        self.known: dict[tuple[int, int, Any], Any] = {}
        self.net_steps: dict[tuple[int, int, Said | None], int] = {}
        self.used: set[tuple[str, int]] = set()
        self.start: Flat = (*self._first_rest((0,) * (first + len(soft) + 1))[:-1], self.faults.most)

    def _first_rest(self, boot: Flat) -> Flat:
        """The first state at rest after all agents were started; the boot itself is what deaths at rest lead to."""
        seen, waiting = {boot}, deque([boot])
        while waiting:
            here = waiting.popleft()
            if self.at_rest(here):
                return here
            for _, _, there, fair, _ in self.moves(here):
                if fair and there not in seen and not self.wrong(there):
                    seen.add(there)
                    waiting.append(there)
        return boot

    # --- for the engine -----------------------------------------------------------------------------------------------

    def moves(self, state: Flat) -> Iterator[Found]:
        """All that can happen."""
        faulty = state[-1] != 0
        alive = bool(self.faults.gone) and self.local(state, self.place[self.faults.gone]).state != GONE
        for number, name in enumerate(self.names):
            for ready in self._cached(number, state[number], "own"):
                if (faulty or not ready.fault) and not (ready.late and alive):
                    yield name, ready.label, self._after(state, number, ready), ready.fair, ready.fault
        for (_, receiver), slot in self.queue_of.items():
            if state[slot]:
                yield from self._from_queue(state, slot, self.place[receiver])
        for soft in self.soft:
            yield from soft.moves(state, faulty)
        if faulty and self.faults.deaths:
            yield from self._deaths(state)
        if self.faults.gone:
            yield from self._for_good(state, self.place[self.faults.gone])

    def at_rest(self, state: Flat) -> bool:
        """Everybody idle, nothing on its way, subscriptions live, observations known."""
        count = len(self.names)
        if self.faults.gone:
            number = self.place[self.faults.waiting]
            return self._resting(number, state[number])
        if any(state[count : count + len(self.queue_of)]):
            return False
        return all(self._resting(number, state[number]) for number in range(count)) and all(
            soft.at_rest(state) for soft in self.soft
        )

    def wrong(self, state: Flat) -> str:
        """What nobody has thought of."""
        if isinstance(state[0], str):
            return state[0]
        for (_, receiver), slot in self.queue_of.items():
            if state[slot]:
                number = self.place[receiver]
                found = self._cached(number, state[number], self.queues.values[state[slot]][0])
                if isinstance(found, str):
                    return found
        return ""

    def describe(self, state: Flat) -> dict[str, str]:
        """Each agent's state, with its open conversations."""
        if isinstance(state[0], str):
            return {}
        return {
            name: _told(agent, self.local(state, number))
            for number, (name, agent) in enumerate(zip(self.names, self.agents, strict=True))
        }

    # --- after the exploration ----------------------------------------------------------------------------------------

    def not_silent(self) -> tuple[str, ...]:
        """States reached in which a word that was left out would have changed something; none if all is well."""
        return tuple(
            f"{name} in {_told(agent, local)}: {said} is not without effect"
            for name, agent, met in zip(self.names, self.agents, self.locals, strict=True)
            for said in sorted(self.silent)
            if said.use in agent.index
            for local in met.values
            if agent.would_change(local, said)
        )

    def unused(self) -> tuple[str, ...]:
        """Rows that no path took: nobody needs them, or one needs more faults, or their guards are wrong."""
        return tuple(
            f"row never used: {name} {number} (in {'|'.join(row.in_)} on {row.on})"
            for name, agent in zip(self.names, self.agents, strict=True)
            for number, row in enumerate(agent.machine.entry.row, start=1)
            if not row.several and (name, number) not in self.used and not self._is_about_silence(agent, number)
        )

    def _is_about_silence(self, agent: Agent, number: int) -> bool:
        events = {row.event for row in agent.machine.rows if row.number == number}
        return any(Event(Cause.TAKE, *said) in events for said in self.silent)

    # --- the parts of a state -----------------------------------------------------------------------------------------

    def local(self, state: Flat, number: int) -> Local:
        """An agent's local state."""
        found: Local = self.locals[number].values[state[number]]
        return found

    def net(self, state: Flat, slot: int) -> Net:
        """What is on its way in a volatile use."""
        found: Net = self.nets.values[state[slot]]
        return found

    def without_talk(self, state: Flat, number: int, use: str) -> Flat:
        """The state in which an agent has forgotten its conversation of a volatile use."""
        return self._changed(state, number, use, lambda local, agent: agent._with_talk(local, use, ""))

    def without_debt(self, state: Flat, number: int, use: str) -> Flat:
        """The state in which an agent owes nothing more in a use."""
        return self._changed(state, number, f"debt {use}", lambda local, _: local._replace(owed=local.owed - {use}))

    def _changed(self, state: Flat, number: int, name: str, change: "Callable[[Local, Agent], Local]") -> Flat:
        key = (number, state[number], f"change {name}")
        if key not in self.known:
            self.known[key] = self.locals[number](change(self.local(state, number), self.agents[number]))
        return (*state[:number], self.known[key], *state[number + 1 :])

    def _resting(self, number: int, local: int) -> bool:
        key = (number, local, "rest")
        if key not in self.known:
            self.known[key] = self.agents[number].at_rest(self.locals[number].values[local])
        found: bool = self.known[key]
        return found

    # --- moves --------------------------------------------------------------------------------------------------------

    def from_net(self, state: Flat, slot: int, net: Net, number: int, ready: Ready, *, fault: bool = False) -> Found:
        """The move in which an agent takes a word of a volatile use, which then is `net`; a copy costs a fault."""
        there = self._after(self.with_net(state, slot, net, fault=fault), number, ready)
        return self.names[number], ready.label, there, not fault, fault

    def with_net(self, state: Flat, slot: int, net: Net, *, fault: bool = False) -> Flat:
        """The state with another net; `fault`: one fault less may come."""
        left = state[-1] - (fault and state[-1] > 0)
        return (*state[:slot], self.nets(net), *state[slot + 1 : -1], left)

    def heard(self, state: Flat, number: int, said: Said) -> "tuple[Ready, ...] | str | None":
        """Outcomes of a word for an agent; None: it waits; a text: nobody has thought of it."""
        found: tuple[Ready, ...] | str | None = self._cached(number, state[number], said)
        return found

    def _from_queue(self, state: Flat, slot: int, number: int) -> Iterator[Found]:
        words = self.queues.values[state[slot]]
        found = self._cached(number, state[number], words[0])
        if found is None or isinstance(found, str):
            return
        rest = (*state[:slot], self.queues(words[1:]), *state[slot + 1 :])
        for ready in found:
            yield self.names[number], ready.label, self._after(rest, number, ready), True, False

    def _deaths(self, state: Flat) -> Iterator[Found]:
        for number, name in enumerate(self.names):
            for ready in self._cached(number, state[number], "restart"):
                there = self._after(state, number, ready)
                if isinstance(there[0], str):
                    yield name, ready.label, there, False, True
                    continue
                after = list(there)
                for other in range(len(self.names)):
                    after[other] = self._with_news(other, after[other], name)
                if tuple(after) != state:
                    after[-1] -= after[-1] > 0
                    yield name, ready.label, tuple(after), False, True

    def _for_good(self, state: Flat, number: int) -> Iterator[Found]:
        """An agent dies and does not come back."""
        if self.local(state, number).state != GONE:
            agent = self.agents[number]
            ready = self._ready(number, agent.gone(), fair=False, fault=False)
            yield self.names[number], "dies for good", self._after(state, number, ready), False, True

    def _with_news(self, number: int, local: int, peer: str) -> int:
        key = (number, local, f"news {peer}")
        if key not in self.known:
            value: Local = self.locals[number].values[local]
            heard = {peer} & self.agents[number].watched
            self.known[key] = self.locals[number](value._replace(news=value.news | heard))
        found: int = self.known[key]
        return found

    def _after(self, state: Flat, number: int, ready: Ready) -> Flat:
        """The state after an outcome of an agent."""
        if ready.again:
            return (f"{self.names[number]} begins an act twice in one conversation of {ready.again}",)
        for rule in ready.rules:
            if rule.broken(self, state):
                return (f"{rule.name}: {rule.text}",)
        self.used.add((self.names[number], ready.row))
        after = list(state)
        after[number] = ready.there
        if ready.fault and after[-1] > 0:
            after[-1] -= 1
        for slot, kind, said in ready.effects:
            if kind == SAY:
                words = (*self.queues.values[after[slot]], said)
                if len(words) > QUEUE_BOUND:
                    return (f"more than {QUEUE_BOUND} words wait: {', '.join(map(str, words))}",)
                after[slot] = self.queues(words)
            else:
                after[slot] = self._net_after(after[slot], kind, said)
        return tuple(after)

    def _net_after(self, net: int, kind: int, said: Said | None) -> int:
        key = (net, kind, said)
        found = self.net_steps.get(key)
        if found is None:
            found = self.net_steps[key] = self.nets(_NET[kind](self.nets.values[net], said))
        return found

    # --- outcomes, worked out once ------------------------------------------------------------------------------------

    def _cached(self, number: int, local: int, what: Any) -> Any:
        """Outcomes of a message, of what is "own", of a "restart"."""
        key = (number, local, what)
        if key not in self.known:
            self.known[key] = self._found(number, self.locals[number].values[local], what)
        return self.known[key]

    def _found(self, number: int, local: Local, what: Any) -> Any:
        agent = self.agents[number]
        if what == "own":
            return tuple(
                self._ready(
                    number,
                    outcome,
                    fair=event.cause is not Cause.PERSON,
                    fault=event.cause is Cause.LATE and not self.faults.gone,
                    late=event.cause is Cause.LATE,
                )
                for outcome, event in agent.spontaneous(local)
                if self.faults.expiries or event.cause is not Cause.LATE
            )
        if what == "restart":
            return tuple(self._ready(number, one, fair=False, fault=False) for one in agent.restarted(local))
        found = agent.take(local, what)
        if found is None or isinstance(found, str):
            return found
        return tuple(self._ready(number, one, fair=True, fault=False) for one in found)

    def _ready(self, number: int, outcome: Outcome, *, fair: bool, fault: bool, late: bool = False) -> Ready:
        agent = self.agents[number]
        effects = tuple(self._effect(agent, effect) for effect in outcome.effects)
        said = {effect.said for effect in outcome.effects}
        rules = tuple(rule for rule in self.rules if rule.agent == agent.machine.agent and rule.says & said)
        there = self.locals[number](outcome.there)
        return Ready(there, effects, outcome.label, fair and not fault, fault, outcome.again, rules, outcome.row, late)

    def _effect(self, agent: Agent, effect: Effect) -> tuple[int, int, Said | None]:
        use = agent.machine.uses[effect.use]
        if use.durable:
            return self.queue_of[agent.machine.agent, use.peer], SAY, effect.said
        slot, initiates = self.net_of[use.name], use.role is Role.INITIATOR
        if effect.kind == "close":
            return slot, CLOSE if initiates else ORPHAN, None
        if effect.kind == "owe":
            return slot, OWE, self.soft[slot - self.soft[0].slot].news
        if effect.kind == "open":
            return slot, OPEN, effect.said
        return slot, ADD if initiates else ANSWER, effect.said


_NET = {
    OPEN: lambda net, said: net.opened(said),
    CLOSE: lambda net, said: net.closed(),
    ORPHAN: lambda net, said: net.orphaned(),
    OWE: lambda net, said: net.owed(said),
    ANSWER: lambda net, said: net.answered(said),
    ADD: lambda net, said: net.added(said),
}


def _pairs(agents: list[Agent]) -> set[tuple[str, str]]:
    """Who has a durable stream to whom."""
    return {
        pair
        for agent in agents
        for use in agent.uses
        if use.durable
        for pair in ((agent.machine.agent, use.peer), (use.peer, agent.machine.agent))
    }


def _told(agent: Agent, local: Local) -> str:
    """A local state in words."""
    talks = [f"{use.name}: {talk}" for use, talk in zip(agent.uses, local.talks, strict=True) if talk]
    owed = [f"owes {use}" for use in sorted(local.owed)]
    return "; ".join((local.state, *talks, *owed))

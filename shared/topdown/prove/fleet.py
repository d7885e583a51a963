"""The composed system: every agent's rows and conversations on ideal durable queues, with faults of
all soft parts.

Durable streams are ideal FIFO queues here; layer 1 proves that they may be taken so. Queries,
subscriptions and observations are volatile (parts.py, soft.py): lost or doubled by faults, asked
again once nothing is on the way. A death and the coming back are one step: what is in the journal
stays, soft conversations are gone. What is left out, and why that is safe, stands in
abstractions.py. A state is a flat tuple of small numbers, so that millions fit into memory.
"""

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

from topdown.model.design import Design
from topdown.model.machines import Cause, Event, Machine, machines
from topdown.prove.chaos import composed, groups
from topdown.prove.local import GONE, Agent, Local
from topdown.prove.parts import OWN, RESTART, SAY, Parts, Ready, endless
from topdown.prove.soft import Ends, Soft

QUEUE_BOUND = 5
"""Longest durable queue (estimate): the outbox of a running agent holds 16; this alarms long before
back-pressure.
"""
OVERFULL = f"more than {QUEUE_BOUND} words wait"
ANY = -1
"""Any number of faults."""
Flat = tuple[Any, ...]
"""Numbers of the agents' local states, of the queues' contents, of the nets; last the faults that
may still come.
"""
Found = Any
"""A plain tuple of engine.Move's five fields: quicker made than a Move."""


class Faults(NamedTuple):
    """Bound on the faults that may happen in all (ANY: no limit): deaths, losses, copies, waits
    that are over.

    `gone`: an agent that may die for good, at any time; rest then means that all of `waiting` are
    idle, and after that death waits that are over count as what will happen. `boot`: all begins
    with the start of all agents, not at rest.
    """

    most: int = 0
    gone: str = ""
    waiting: tuple[str, ...] = ()
    boot: bool = False


class Fleet:
    """The model, for topdown.prove.engine.explore. Raises DesignError for rows that cannot be read.

    `groups`: the ends that nobody of the design runs; chaos.py has what they do.
    """

    def __init__(
        self, design: Design, faults: Faults | None = None, parts: dict[str, Machine] | None = None
    ) -> None:
        self.faults = faults or Faults()
        self.groups = frozenset(groups(design))
        whole = composed(design)
        self.parts = Parts(whole, parts or machines(whole))
        self.names, self.count = self.parts.names, len(self.parts.names)
        queues = self.parts.queue_of.items()
        self.inbound = [(slot, self.parts.place[to]) for (_, to), slot in queues]
        self.waiting = [self.parts.place[name] for name in self.faults.waiting]
        self.soft = [Soft(self.parts, use) for use in self.parts.soft]
        self.used: set[tuple[str, int]] = set()
        self.boot: Flat = ((0,) * (self.parts.size - 1)) + (self.faults.most,)
        first = self.boot if self.faults.boot else self._first_rest((0,) * self.parts.size)
        self.start: Flat = (*first[:-1], self.faults.most)

    def _first_rest(self, boot: Flat) -> Flat:
        """The first state at rest after all agents were started; the boot itself is what deaths at
        rest lead to.
        """
        seen, waiting = {boot}, deque([boot])
        while waiting:
            here = waiting.popleft()
            if self._all_rest(here):
                return here
            for _, _, there, fair, _ in self.moves(here):
                if fair and there not in seen and not self.wrong(there):
                    seen.add(there)
                    waiting.append(there)
        return boot

    # --- for the engine ---------------------------------------------------------------------------

    def moves(self, state: Flat) -> Iterator[Found]:
        """All that can happen; a group says nothing while a queue of its is full, as the runtime
        does.
        """
        for move in self._moves(state):
            if move[0] not in self.groups or not str(move[2][0]).startswith(OVERFULL):
                yield move

    def _moves(self, state: Flat) -> Iterator[Found]:
        faulty, parts, gone = state[-1] != 0, self.parts, self.faults.gone
        for number, name in enumerate(self.names):
            for ready in parts.unasked(number, state[number], OWN):
                # Waits are over as faults; or, with an agent that dies for good, once it has.
                if ready.late and not (self._is_gone(state) if gone else faulty):
                    continue
                there = self._after(list(state), state, number, ready)
                fair, fault = (True, False) if ready.late and gone else (ready.fair, ready.fault)
                yield name, ready.label, self._less(there) if fault else there, fair, fault
        for slot, number in self.inbound:
            if state[slot]:
                yield from self._from_queue(state, slot, number)
        for soft in self.soft:
            yield from self._from_net(state, soft, faulty)
        if faulty:
            yield from self._deaths(state)
        if gone and not self._is_gone(state):
            number = parts.place[gone]
            (ready,) = parts.unasked(number, state[number], GONE)
            yield gone, "dies for good", self._after(list(state), state, number, ready), False, True

    def at_rest(self, state: Flat) -> bool:
        """All idle, nothing on its way, subscriptions live, observations known; with `gone`: all
        who wait are.
        """
        if self.faults.gone:
            return all(self.parts.resting(number, state[number]) for number in self.waiting)
        return self._all_rest(state)

    def wrong(self, state: Flat) -> str:
        """The fault of a state: an event that no row covers."""
        if isinstance(state[0], str):
            return state[0]
        for slot, number in self.inbound:
            if state[slot]:
                said = self.parts.queues.values[state[slot]][0]
                found = self.parts.outcomes(number, state[number], said)
                if isinstance(found, str):
                    return found
        return ""

    def describe(self, state: Flat) -> dict[str, str]:
        """Each agent's state, with its open conversations."""
        if isinstance(state[0], str):
            return {}
        parts = self.parts
        return {
            name: _local_text(parts.agents[number], parts.local(number, state[number]))
            for number, name in enumerate(self.names)
        }

    def _all_rest(self, state: Flat) -> bool:
        if any(state[self.count : self.count + len(self.inbound)]):
            return False
        agents = all(self.parts.resting(number, state[number]) for number in range(self.count))
        return agents and all(soft.at_rest(self._ends(state, soft)) for soft in self.soft)

    # --- moves ------------------------------------------------------------------------------------

    def _is_gone(self, state: Flat) -> bool:
        number = self.parts.place[self.faults.gone]
        return self.parts.local(number, state[number]).state == GONE

    def _from_queue(self, state: Flat, slot: int, number: int) -> Iterator[Found]:
        words = self.parts.queues.values[state[slot]]
        found = self.parts.outcomes(number, state[number], words[0])
        if isinstance(found, tuple):
            rest = self.parts.queues(words[1:])
            for ready in found:
                after = list(state)
                after[slot] = rest
                there = self._after(after, state, number, ready)
                yield self.names[number], ready.label, there, True, False

    def _from_net(self, state: Flat, soft: Soft, faulty: bool) -> Iterator[Found]:
        for who, what, ends, number, ready, fault, wrong in soft.turns(self._ends(state, soft)):
            if wrong:
                yield who, what, (wrong,), True, False
            if wrong or (fault and not faulty):
                continue
            after = list(state)
            after[soft.asker], after[soft.server], after[soft.slot] = ends
            there = tuple(after) if ready is None else self._after(after, state, number, ready)
            yield who, what, self._less(there) if fault else there, not fault, fault

    def _ends(self, state: Flat, soft: Soft) -> Ends:
        return Ends(state[soft.asker], state[soft.server], state[soft.slot])

    def _deaths(self, state: Flat) -> Iterator[Found]:
        for number, name in enumerate(self.names):
            if self.parts.local(number, state[number]).state == GONE:
                continue
            for ready in self.parts.unasked(number, state[number], RESTART):
                there = self._after(list(state), state, number, ready)
                if not isinstance(there[0], str):
                    heard = enumerate(there[: self.count])
                    told = (self.parts.with_news(other, local, name) for other, local in heard)
                    there = (*told, *there[self.count :])
                if there != state:
                    yield name, ready.label, self._less(there), False, True

    def _less(self, state: Flat) -> Flat:
        """One fault less may come."""
        counted = isinstance(state[-1], int) and state[-1] > 0
        return (*state[:-1], state[-1] - 1) if counted else state

    def _after(self, after: list[Any], before: Flat, number: int, ready: Ready) -> Flat:
        """The state after an outcome of an agent."""
        if ready.again:
            twice = f"begins an act twice in one conversation of {ready.again}"
            return (f"{self.names[number]} {twice}",)
        for rule in ready.rules:
            if rule.broken(self.parts, before):
                return (f"{rule.name}: {rule.text}",)
        self.used.add((self.names[number], ready.row))
        after[number] = ready.there
        for slot, kind, said in ready.effects:
            if kind == SAY:
                words = (*self.parts.queues.values[after[slot]], said)
                if len(words) > QUEUE_BOUND:
                    return (f"{OVERFULL}: {', '.join(map(str, words))}",)
                after[slot] = self.parts.queues(words)
            else:
                after[slot] = self.parts.net_after(after[slot], kind, said)
        return tuple(after)

    # --- after the exploration --------------------------------------------------------------------

    def not_silent(self) -> tuple[str, ...]:
        """States reached in which a word that was left out would have changed something; none if
        all is well.
        """
        agents = zip(self.names, self.parts.agents, self.parts.locals, strict=True)
        return tuple(
            f"{name} in {_local_text(agent, local)}: {said} is not without effect"
            for name, agent, met in agents
            for said in sorted(self.parts.silent)
            if said.use in agent.index
            for local in met.values
            if agent.would_change(local, said)
        )

    def unused(self) -> tuple[str, ...]:
        """Rows that no path took: nobody needs them, or one needs more faults, or their guards are
        wrong.
        """
        found = []
        # what takes a silent word is not needed either
        silent = {Event(Cause.TAKE, *said) for said in self.parts.silent}
        for machine in self._machines():
            name = machine.agent
            quiet = {row.number for row in machine.rows if row.event in silent}
            for number, row in enumerate(machine.entry.row, start=1):
                if not row.several and number not in quiet and (name, number) not in self.used:
                    where = f"in {'|'.join(row.in_)} on {row.on}"
                    found.append(f"row never used: {name} {number} ({where})")
        return tuple(found)

    def endless(self) -> tuple[str, ...]:
        """The words that may fill a queue and are not in the model; of how many wait nothing is
        proven.
        """
        told = (words for one in self._machines() for words in endless(one, self.parts.silent))
        return tuple(dict.fromkeys(told))

    def _machines(self) -> list[Machine]:
        """Those that the design has, without groups."""
        machines = (agent.machine for agent in self.parts.agents)
        return [one for one in machines if one.agent not in self.groups]


def _local_text(agent: Agent, local: Local) -> str:
    """A local state in words."""
    talks = zip(agent.uses, local.talks, strict=True)
    told = [f"{use.name}: {talk}" for use, talk in talks if talk]
    return "; ".join((local.state, *told, *(f"owes {use}" for use in sorted(local.owed))))

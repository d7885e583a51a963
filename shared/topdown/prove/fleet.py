"""The composed system: every agent's rows and conversations on ideal durable queues, with faults of
all soft parts.

Durable streams are ideal FIFO queues here; layer 1 proves that they may be taken so. Queries,
subscriptions and observations are volatile (`Soft`): lost or doubled by faults, asked again once
nothing is on the way. A death and the coming back are one step: what is in the journal stays, soft
conversations are gone. What is left out, and why that is safe, stands in verify.ABSTRACTIONS. A
state is a flat tuple of small numbers, so that millions fit into memory.
"""

from collections import deque
from collections.abc import Collection, Iterable, Iterator
from typing import Any, NamedTuple

from msgspec.structs import replace

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row, Table
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.model.machines import Cause, Event, Machine, ProtocolAct, machines
from topdown.prove.fleet_tables import FleetTables, flat, state_of
from topdown.prove.local import GONE, Agent, Local, Stray
from topdown.prove.parts import OWN, RESTART, SAY, Net, Never, Parts, Ready, endless

# --- A group as an end of channels: it may say what the tables of its uses allow, at any time -----
# Nobody of the design runs a group, so nothing is known of it but its tables and the acts that its
# messages list. Its rows are made of these: what its peers say it takes, what it is asked it
# answers sooner or later, by any word that the table has there; what it opens, calls off or
# observes is its free choice, of which nobody may wait. An included system is such a group that may
# also die for good: all that it says is its free choice.


ANYTHING = "anything"
"""The one state of a group."""
SAYS, CHOOSES = "own says", "person there"
"""Events of its rows: what will happen if it matters, and what may happen."""


def groups(design: Design) -> tuple[str, ...]:
    """The groups at ends of uses of protocols, and the included systems that agents talk with.
    Raises DesignError for an end that is not a group either.
    """
    known = {group.name for group in design.file.group}
    found: dict[str, None] = {}
    for use in design.file.protocol:
        for end in (use.initiator, use.participant):
            if end not in design.agents:
                found[end] = None
                if end not in known:
                    agents, names = ", ".join(design.agents), ", ".join(sorted(known))
                    raise DesignError(
                        design.path or "design.toml",
                        None,
                        f"protocol {use.name}",
                        f"{end!r} is neither an agent nor a group",
                        f"agents are {agents or 'none'}, groups {names or 'none'}; give it an"
                        " [[agent]] or a [[group]]",
                    )
    found |= {use.participant: None for use in design.included_uses.values()}
    return tuple(found)


def composed(design: Design) -> Design:
    """The design with an agent for each of its groups and included systems; the same one where none
    is at an end of a use.
    """
    made = [_agent(design, name) for name in groups(design)]
    if not made:
        return design
    uses = (*design.file.protocol, *design.included_uses.values())
    tables = (*design.file.table, *_included_tables(design))
    agents = (*design.file.agent, *made)
    file = replace(design.file, agent=agents, protocol=uses, table=tables, include=())
    return Design(file, design.path, design.text, design.folder)


def among_groups(design: Design, kept: Collection[str]) -> Design:
    """The design in which only `kept` keep their rows: each other agent is a group, which may say
    whatever the tables of its uses allow. Rules on others, and uses between others, are left out.

    Explored from the boot on, what is wrong with the agents kept in the whole design (but for long
    queues) is wrong here too, with as many faults: a move of an agent that is a group here is one
    of that group, or of nobody. The other direction does not hold; and whether rest can be reached
    is another question, since nothing here makes a group say something.
    """
    left = tuple(agent for agent in design.file.agent if agent.name in kept)
    others = (elements.Group(name) for name in design.agents if name not in kept)
    uses = (use for use in design.file.protocol if {use.initiator, use.participant} & {*kept})
    rules = (rule for rule in design.file.never if ruled(rule) <= {*kept})
    file = replace(
        design.file,
        agent=left,
        group=(*design.file.group, *others),
        protocol=tuple(uses),
        never=tuple(rules),
    )
    return Design(file, design.path, design.text, design.folder)


def ruled(rule: elements.Never) -> frozenset[str]:
    """The agents that a rule is about."""
    return frozenset((rule.agent, *(text.partition(" ")[0] for text in rule.while_)))


def _included_tables(design: Design) -> Iterator[elements.Table]:
    """The tables of included designs that uses here follow."""
    known = set(design.own_tables)
    for use in design.included_uses.values():
        there = design.included[use.participant].design
        for table in there.file.table if there is not None else ():
            if table.name == use.follows and table.name not in known:
                known.add(table.name)
                yield table


def _agent(design: Design, group: str) -> elements.Agent:
    every = (*design.file.protocol, *design.included_uses.values())
    uses = [use for use in every if group in (use.initiator, use.participant)]
    tables, dies = design.tables, group in design.included
    ends = [_End(use, group, tables[use.follows], dies) for use in uses if use.follows in tables]
    rows = (*(row for end in ends for row in end.rows()), *_renewals(ends))
    state = elements.State(ANYTHING, "chaos", "never", talks=tuple(end.use.name for end in ends))
    return elements.Agent(name=group, initial=ANYTHING, state=(state,), row=rows)


class _End:
    """A group's end of one use. `dies`: it may say nothing more for ever."""

    def __init__(
        self, use: elements.Protocol, group: str, protocol: Protocol, dies: bool = False
    ) -> None:
        self.use, self.protocol, self.dies = use, protocol, dies
        self.role, self.peer = use.role(group), use.peer(group)
        self.table = protocol.tables[self.role]
        self.acts = {message.performative for message in use.message if message.sender == group}
        self.observed = use.latest and self.role is Role.PARTICIPANT
        self.subscribes = use.latest and self.role is Role.INITIATOR

    def rows(self) -> Iterator[elements.Row]:
        """All of this use: what is taken, said, and opened."""
        yield from self._taken()
        for said in dict.fromkeys(self._said()):
            free = self.dies or said.act is Performative.CANCEL or self._opens(said)
            yield _group_row(CHOOSES if free else SAYS, said)
        for said in self.openings():
            yield _group_row(
                SAYS if self.subscribes else CHOOSES, said, when=(f"{self.use.name} none",)
            )
        if self.observed:
            # what is observed before the answer to a subscription is sent after it: that is an
            # observation made later
            told = "|".join(("none", *sorted(map(str, self.table.resting))))
            when = (f"{self.use.name} {told}",)
            yield elements.Row((ANYTHING,), CHOOSES, owes=(self.use.name,), when=when)
        if self.role is Role.INITIATOR and not self.use.durable:
            yield elements.Row((ANYTHING,), f"late {self.use.name}")

    def openings(self) -> tuple[ProtocolAct, ...]:
        """The words that begin a conversation."""
        return tuple(map(self._word, filter(self._may_say, self.table.allowed(START, SEND))))

    def _taken(self) -> Iterator[elements.Row]:
        """Each word of the peer, with each way to say what is owed for it in the same step."""
        ways: dict[tuple[ProtocolAct, tuple[ProtocolAct, ...]], None] = {}
        for row in self.table:
            if row.way is RECEIVE:
                ways |= {(self._word(row), said): None for said in self._owed(str(row.to), ())}
        for heard, said in ways:
            yield _group_row(str(heard), *said)

    def _said(self) -> Iterator[ProtocolAct]:
        """Words in a conversation that is open; a volatile opening is asked again by the model
        itself.
        """
        for row in self.table:
            if row.way is SEND and row.state != START and row.to != START and self._may_say(row):
                said = self._word(row)
                again = self._opens(said) and (not self.use.durable or row.to == row.state)
                news = self.observed and (said.act, said.kind) == (Performative.INFORM, Kind.PLAIN)
                if not again and not news:
                    yield said

    def _owed(
        self, state: str, before: tuple[ProtocolAct, ...]
    ) -> Iterator[tuple[ProtocolAct, ...]]:
        """Ways to say what a state owes in the same step; one that says nothing where it owes
        nothing.
        """
        if state not in self.table.urgent:
            yield before
            return
        for row in self.table.allowed(state, SEND):
            if self._may_say(row) and self._word(row) not in before:
                yield from self._owed(str(row.to), (*before, self._word(row)))

    def _opens(self, said: ProtocolAct) -> bool:
        return self.role is Role.INITIATOR and said.act in self.protocol.openings

    def _may_say(self, row: Row) -> bool:
        """Whether its messages list the act; the answer to a cancel the runtime gives by itself."""
        return row.performative in self.acts or row.kind is Kind.CANCEL

    def _word(self, row: Row) -> ProtocolAct:
        return ProtocolAct(self.use.name, row.performative, row.kind)


def _renewals(ends: list[_End]) -> Iterator[elements.Row]:
    """A peer that came back is subscribed to once more, in each use, as the runtime does."""
    for peer in dict.fromkeys(end.peer for end in ends if end.subscribes):
        mine = [end for end in ends if end.subscribes and end.peer == peer]
        said = tuple(str(said) for end in mine for said in end.openings()[:1])
        dropped = tuple(end.use.name for end in mine)
        yield elements.Row(in_=(ANYTHING,), on=f"back {peer}", drop=dropped, say=said)


def _group_row(event: str, *said: ProtocolAct, when: tuple[str, ...] = ()) -> elements.Row:
    return elements.Row(in_=(ANYTHING,), on=event, say=tuple(map(str, said)), when=when)


# --- A volatile use: what of it may happen by itself, and to words on their way -------------------
# What may happen depends on the two ends and on what is on the way; it is worked out once and kept.
# Asked again is only what nothing more is on the way of: other repetitions are copies, which count
# as faults.


class Ends(NamedTuple):
    """The two ends' local states and the net, by number."""

    asker: int
    server: int
    net: int


class Turn(NamedTuple):
    """Something that may happen: the parts change to `ends`; then agent `number` does `ready`, if
    there is one.

    `wrong`: nobody has thought of it, and why.
    """

    who: str
    what: str
    ends: Ends
    number: int = -1
    ready: Ready | None = None
    fault: bool = False
    wrong: str = ""


class Soft:
    """One volatile use; `slot` is its net's place in a state."""

    def __init__(self, parts: Parts, use: elements.Protocol) -> None:
        self.parts, self.use, self.latest = parts, use.name, use.latest
        self.slot = parts.net_of[use.name]
        self.asker, self.server = parts.place[use.initiator], parts.place[use.participant]
        tables = parts.agents[self.asker].machine.uses[use.name].protocol.tables
        asker, server = tables[Role.INITIATOR], tables[Role.PARTICIPANT]
        said = {message.performative for message in use.message}
        opening = [row for row in asker.allowed(START, SEND) if row.performative in said]
        self.openings = {str(row.to): _act(use.name, row) for row in opening}
        self.asks = {**_repeated(use.name, asker), **self.openings}
        self.outward = {_act(use.name, row) for row in asker if row.way is SEND}
        self.unanswered = {str(row.to) for row in server.allowed(START, RECEIVE)}
        self.resting = server.resting
        self.late = parts.agents[self.server].late_answers(use.name)
        self.answers = {
            str(row.to): _act(use.name, row)
            for state in self.unanswered
            for row in reversed(server.allowed(state, SEND))
        }
        self.news = ProtocolAct(use.name, Performative.INFORM, Kind.PLAIN)
        self._turns: dict[Ends, tuple[Turn, ...]] = {}

    def at_rest(self, ends: Ends) -> bool:
        """Nothing on its way; a subscription is live, and its newest observation known."""
        net = self.parts.net(ends.net)
        live = bool(self.parts.talk(self.asker, ends.asker, self.use)) and net.current
        return not net.words and not net.stale and (live or not self.latest)

    def turns(self, ends: Ends) -> tuple[Turn, ...]:
        """All that may happen in this use, faults as well."""
        found = self._turns.get(ends)
        if found is None:
            found = (*self._taken(ends), *self.by_itself(ends), *self._lost(ends))
            self._turns[ends] = found
        return found

    def turns_between(self, asker: int, server: int, net: int) -> tuple[Turn, ...]:
        """The same by numbers."""
        return self.turns(Ends(asker, server, net))

    def _with(self, ends: Ends, net: Net) -> Ends:
        return ends._replace(net=self.parts.nets(net))

    # --- taken ------------------------------------------------------------------------------------

    def _taken(self, ends: Ends) -> Iterator[Turn]:
        net = self.parts.net(ends.net)
        for said in net.words:
            if said in self.openings.values():
                yield from self._asked(ends, net, said)
            elif said in self.outward and not net.current:
                yield self._unknown(ends, net, said)
            elif said in self.outward:
                yield from self._heard(ends, net, said, self.server, ends.server)
            else:
                yield from self._heard(ends, net, said, self.asker, ends.asker)

    def _asked(self, ends: Ends, net: Net, said: ProtocolAct) -> Iterator[Turn]:
        """An opening: of the present question once more, or of a newer one, whose conversation
        replaces the older.
        """
        talk = self.parts.talk(self.server, ends.server, self.use)
        if talk and net.current:
            answer, after = self.answers.get(talk), net.taken(said)
            after = after if answer is None else after.added(answer)
            name = self.parts.names[self.server]
            yield Turn(name, f"{said}: asked again", self._with(ends, after))
            return
        local = self.parts.without_talk(self.server, ends.server, self.use)
        forgot = ends._replace(server=local)
        for turn in self._heard(forgot, net, said, self.server, local):
            after = self.parts.net(turn.ends.net)
            after = after.accepted() if turn.ready else after
            yield turn._replace(ends=self._with(turn.ends, after))

    def _unknown(self, ends: Ends, net: Net, said: ProtocolAct) -> Turn:
        """A word in a conversation that the participant does not hold: a cancel is answered as the
        table says.
        """
        name, after = self.parts.names[self.server], net.taken(said)
        if said.act is not Performative.CANCEL:
            return Turn(name, f"{said} is dropped", self._with(ends, after))
        for answer in self.late:
            after = after.added(answer)
        what = f"{said} <- {self.parts.names[self.asker]}, too late"
        return Turn(name, what, self._with(ends, after))

    def _heard(
        self, ends: Ends, net: Net, said: ProtocolAct, number: int, local: int
    ) -> Iterator[Turn]:
        """An agent takes a word, or a copy of it; what nobody waits for is dropped. Of the newest
        observation nothing more is owed then; or (a fault) its receipt is lost.
        """
        observed = self.latest and said == self.news and number == self.asker
        found, name = self.parts.outcomes(number, local, said), self.parts.names[number]
        if isinstance(found, Stray):
            yield Turn(name, f"{said} is dropped", self._with(ends, net.taken(said)))
        elif isinstance(found, str):
            yield Turn(name, str(said), ends, wrong=found)
        for ready in found if isinstance(found, tuple) else ():
            if observed:
                local = self.parts.without_debt(self.server, ends.server, self.use)
                after = self._with(ends._replace(server=local), net.known(said))
                yield Turn(name, ready.label, after, number, ready)
                lost, unpaid = f"{ready.label}; its receipt is lost", net.taken(said)
                yield Turn(name, lost, self._with(ends, unpaid), number, ready, fault=True)
            else:
                yield Turn(name, ready.label, self._with(ends, net.taken(said)), number, ready)
                yield Turn(name, f"{ready.label} (a copy)", ends, number, ready, fault=True)

    # --- by itself --------------------------------------------------------------------------------

    def by_itself(self, ends: Ends) -> Iterator[Turn]:
        """What is said again when nothing of it is on the way."""
        net, names = self.parts.net(ends.net), self.parts.names
        asked = self.asks.get(self.parts.talk(self.asker, ends.asker, self.use))
        served = self.parts.talk(self.server, ends.server, self.use)
        thinks = net.current and served in self.unanswered
        if asked is not None and not net.words and (not thinks or asked.act is Performative.CANCEL):
            what = f"{asked} -> {names[self.server]}, again"
            yield Turn(names[self.asker], what, self._with(ends, net.added(asked)))
        owed = self.latest and self.use in self.parts.local(self.server, ends.server).owed
        heard = net.current and served in self.resting
        if owed and heard and self.news not in net.words:
            what = f"{self.news} -> {names[self.asker]}, again"
            yield Turn(names[self.server], what, self._with(ends, net.added(self.news)))

    def _lost(self, ends: Ends) -> Iterator[Turn]:
        net = self.parts.net(ends.net)
        for said in net.words:
            yield Turn("net", f"{said} is lost", self._with(ends, net.taken(said)), fault=True)


def _repeated(use: str, asker: Table) -> dict[str, ProtocolAct]:
    """What is repeated in each state: the newest word of the initiator until something is taken, or
    its cancel, which crossing messages do not answer, until the conversation has ended.
    """
    found = {str(row.to): row for row in asker if row.way is SEND and row.to not in asker.ended}
    waiting = [row for row in found.values() if row.performative is Performative.CANCEL]
    while waiting:
        cancel = waiting.pop()
        for row in asker.allowed(cancel.to, RECEIVE):
            if row.kind is not Kind.CANCEL and row.to not in asker.ended and row.to not in found:
                found[str(row.to)] = cancel._replace(to=row.to)
                waiting.append(found[str(row.to)])
    return {state: _act(use, row) for state, row in found.items()}


def _act(use: str, row: Row) -> ProtocolAct:
    return ProtocolAct(use, row.performative, row.kind)


# --- The composed system --------------------------------------------------------------------------


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

    `groups`: the ends that nobody of the design runs; `composed` has what they do.
    """

    def __init__(
        self, design: Design, faults: Faults | None = None, parts: dict[str, Machine] | None = None
    ) -> None:
        self.design, self.faults = design, faults or Faults()
        self.groups = frozenset(groups(design))
        whole = composed(design)
        # who waits for an included system has a limit that does not depend on it
        self.parts = Parts(whole, parts or machines(whole), frozenset(design.included_uses))
        self.names, self.count = self.parts.names, len(self.parts.names)
        # one that died in the middle of something rests as it is
        dying = {use.participant for use in design.included_uses.values()}
        self.resting = [place for name, place in self.parts.place.items() if name not in dying]
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
                there = self._after(list(state), number, ready)
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
            yield gone, "dies for good", self._after(list(state), number, ready), False, True

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
        agents = all(self.parts.resting(number, state[number]) for number in self.resting)
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
                there = self._after(after, number, ready)
                yield self.names[number], ready.label, there, True, False

    def _from_net(self, state: Flat, soft: Soft, faulty: bool) -> Iterator[Found]:
        for who, what, ends, number, ready, fault, wrong in soft.turns(self._ends(state, soft)):
            if wrong:
                yield who, what, (wrong,), True, False
            if wrong or (fault and not faulty):
                continue
            after = list(state)
            after[soft.asker], after[soft.server], after[soft.slot] = ends
            there = tuple(after) if ready is None else self._after(after, number, ready)
            yield who, what, self._less(there) if fault else there, not fault, fault

    def _ends(self, state: Flat, soft: Soft) -> Ends:
        return Ends(state[soft.asker], state[soft.server], state[soft.slot])

    def _deaths(self, state: Flat) -> Iterator[Found]:
        for number, name in enumerate(self.names):
            if self.parts.local(number, state[number]).state == GONE:
                continue
            for ready in self.parts.unasked(number, state[number], RESTART):
                there = self._after(list(state), number, ready)
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

    def _after(self, after: list[Any], number: int, ready: Ready) -> Flat:
        """The state after an outcome of an agent."""
        if ready.again:
            return (self.twice(number, ready),)
        for slot, kind, said in ready.happened:
            after[slot] = self.parts.net_after(after[slot], kind, said)
        for rule in ready.rules:
            if rule.broken(self.parts, after):
                return (self.broken(rule),)
        self.used.add((self.names[number], ready.row))
        after[number] = ready.there
        for slot, kind, said in ready.effects:
            if kind == SAY:
                words = (*self.parts.queues.values[after[slot]], said)
                overfull = self.overfull(words)
                if overfull:
                    return (overfull,)
                after[slot] = self.parts.queues(words)
            else:
                after[slot] = self.parts.net_after(after[slot], kind, said)
        return tuple(after)

    # --- what is wrong with a move ----------------------------------------------------------------

    def twice(self, number: int, ready: Ready) -> str:
        """An act was begun that had been begun before."""
        return f"{self.names[number]} begins an act twice in one conversation of {ready.again}"

    @staticmethod
    def broken(rule: Never) -> str:
        """A rule of the design is broken."""
        return f"{rule.name}: {rule.text}" if rule.text else rule.name

    @staticmethod
    def overfull(words: tuple[ProtocolAct, ...]) -> str:
        """Too many words wait in a queue; "" while there are not."""
        return f"{OVERFULL}: {', '.join(map(str, words))}" if len(words) > QUEUE_BOUND else ""

    # --- for the explorer in C --------------------------------------------------------------------

    @property
    def rows(self) -> tuple[tuple[str, int], ...]:
        """Numbers of the rows of each agent; 0 is what the runtime does by itself."""
        machines = (agent.machine for agent in self.parts.agents)
        return tuple((one.agent, row) for one in machines for row in range(len(one.entry.row) + 1))

    def tables(self) -> FleetTables:
        """The same model as tables."""
        return FleetTables(self, flat(self.start))

    def state_of(self, numbers: tuple[int, ...]) -> Flat:
        """The state that these numbers stand for."""
        return state_of(numbers)

    def wrong_state(self, text: str) -> Flat:
        """What _after says in place of a state."""
        return (text,)

    def note_taken(self, numbers: Iterable[int]) -> None:
        """Rows that the explorer in C took."""
        rows = self.rows
        self.used |= {rows[number] for number in numbers}

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

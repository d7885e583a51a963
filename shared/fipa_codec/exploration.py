"""Walks both roles of a protocol over two FIFO channels and says what nobody thought of.

A configuration is the state of each role and what is on its way to each. From every reachable one the end must be
reachable again (both ended or resting, channels empty) by steps that are not free: nobody can be waiting for a cancel,
a repetition or another report. The channels are bounded and a full one holds the sender back. Must not know: content,
time, faults of the wire (durable streams hide those).
"""

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, START, Protocol, Role, Row, Table

Message = tuple[Performative, Kind]

CAPACITY = 3
"""Messages on their way to one role: more found nothing new in these tables (tried: 2 to 5)."""


class Configuration(NamedTuple):
    """State of each role, and the messages on their way to each, the first to arrive first."""

    initiator: str
    participant: str
    to_initiator: tuple[Message, ...] = ()
    to_participant: tuple[Message, ...] = ()

    def state(self, role: Role) -> str:
        """State of a role."""
        return self.initiator if role is Role.INITIATOR else self.participant

    def inbound(self, role: Role) -> tuple[Message, ...]:
        """What is on its way to a role."""
        return self.to_initiator if role is Role.INITIATOR else self.to_participant


class Step(NamedTuple):
    """One role used one row."""

    role: Role
    row: Row

    def __str__(self) -> str:
        verb = "sends" if self.row.way is SEND else "takes"
        return f"{self.role} {verb} {self.row.word} -> {self.row.to}"


class Finding(NamedTuple):
    """Something wrong: where, what in words, and the shortest way there."""

    configuration: Configuration
    text: str
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        return "\n  ".join((self.text, *map(str, self.steps)))


class Exploration(NamedTuple):
    """What was found. `unreachable`: states no walk came through; `unused`: rows none used (no fault by themselves)."""

    configurations: int
    unspecified: tuple[Finding, ...]
    stuck: tuple[Finding, ...]
    unreachable: tuple[tuple[Role, str], ...]
    unused: tuple[tuple[Role, Row], ...]

    @property
    def sound(self) -> bool:
        """No reception without a row, no stuck configuration, all states reachable."""
        return not (self.unspecified or self.stuck or self.unreachable)


def explore(protocol: Protocol, capacity: int = CAPACITY) -> Exploration:
    """All reachable configurations of one conversation, with at most `capacity` messages on the way to each role."""
    walk = _Walk(protocol, capacity)
    seen = {(role, c.state(role)) for c in walk.parents for role in Role}
    used = {step for steps in walk.edges.values() for step, _ in steps}
    tables = protocol.tables.items()
    return Exploration(
        configurations=len(walk.parents),
        unspecified=tuple(walk.unspecified()),
        stuck=tuple(walk.stuck()),
        unreachable=tuple(sorted((role, str(s)) for role, t in tables for s in t.states if (role, s) not in seen)),
        unused=tuple((role, row) for role, t in tables for row in t if Step(role, row) not in used),
    )


def edges(protocol: Protocol, capacity: int = CAPACITY) -> dict[Configuration, list[tuple[Step, Configuration]]]:
    """Every reachable configuration, the start first, with the steps from there and where they lead."""
    return _Walk(protocol, capacity).edges


def shortest(protocol: Protocol) -> tuple[Step, ...]:
    """The steps of a shortest complete conversation: to where both have ended or rest, and nothing is on its way."""
    walk = _Walk(protocol, 1)
    first = next(iter(walk.parents))
    end = next((here for here in walk.parents if here != first and walk._at_rest(here)), None)
    return () if end is None else walk._way_to(end)


def with_not_understood(protocol: Protocol) -> Protocol:
    """The protocol with the rule outside its tables written into them, so that it can be explored too.

    Either side may say not-understood once the conversation is open; it ends it for who says and who hears it, and who
    said it is deaf to what was still on its way. What had ended stays as it ended.
    """
    return protocol.varied(
        initiator=_complaining(protocol, Role.INITIATOR), participant=_complaining(protocol, Role.PARTICIPANT)
    )


def _complaining(protocol: Protocol, role: Role) -> Table:
    old, peer = protocol.tables[role], protocol.tables[role.other]
    complaint = (Performative.NOT_UNDERSTOOD, Kind.PLAIN)
    audible = {(row.performative, row.kind) for row in peer if row.way is SEND} | {complaint}
    rows = [*old, *(Row(NOT_UNDERSTOOD, RECEIVE, *word, NOT_UNDERSTOOD) for word in sorted(audible))]
    for state in sorted(old.states - {START}):
        rows.append(Row(state, RECEIVE, *complaint, state if state in old.ended else NOT_UNDERSTOOD))
        if state not in old.ended | old.urgent:
            rows.append(Row(state, SEND, *complaint, NOT_UNDERSTOOD))
    return Table(rows, ended=(*old.ended, NOT_UNDERSTOOD), urgent=old.urgent, resting=old.resting)


class _Walk:
    """Breadth first from the start: `edges` of each configuration, `parents` on a shortest way."""

    def __init__(self, protocol: Protocol, capacity: int) -> None:
        self.protocol, self.capacity = protocol, capacity
        first = Configuration(START, START)
        self.parents: dict[Configuration, tuple[Step, Configuration] | None] = {first: None}
        self.edges: dict[Configuration, list[tuple[Step, Configuration]]] = {}
        waiting = deque([first])
        while waiting:
            here = waiting.popleft()
            self.edges[here] = list(self._steps(here))
            for step, there in self.edges[here]:
                if there not in self.parents:
                    self.parents[there] = (step, here)
                    waiting.append(there)

    def _steps(self, here: Configuration) -> Iterator[tuple[Step, Configuration]]:
        for role, table in self.protocol.tables.items():
            inbound, outbound = here.inbound(role), here.inbound(role.other)
            if len(outbound) < self.capacity:
                for row in table.allowed(here.state(role), SEND):
                    sent = (*outbound, (row.performative, row.kind))
                    yield Step(role, row), _made(role, row.to, inbound, here.state(role.other), sent)
            taken = self._reception(here, role)
            if taken:
                yield Step(role, taken), _made(role, taken.to, inbound[1:], here.state(role.other), outbound)

    def _reception(self, here: Configuration, role: Role) -> Row | None:
        """The row for the first message on its way; None also while the role owes a send."""
        table, state, inbound = self.protocol.tables[role], here.state(role), here.inbound(role)
        return table.find(state, RECEIVE, *inbound[0]) if inbound and state not in table.urgent else None

    def unspecified(self) -> Iterator[Finding]:
        """Configurations in which a role that is free to take has no row for what comes."""
        for here in self.edges:
            for role, table in self.protocol.tables.items():
                state, inbound = here.state(role), here.inbound(role)
                if inbound and state not in table.urgent and self._reception(here, role) is None:
                    performative, kind = inbound[0]
                    word = f"{performative}[{kind}]" if kind else performative
                    yield Finding(here, f"{role} in state {state} has no row for {word}", self._way_to(here))

    def stuck(self) -> Iterator[Finding]:
        """Configurations from which no steps but free ones lead to the end."""
        before: dict[Configuration, list[Configuration]] = {}
        for here, steps in self.edges.items():
            for step, there in steps:
                if not step.row.free:
                    before.setdefault(there, []).append(here)
        good = {here for here in self.edges if self._at_rest(here)}
        waiting = list(good)
        while waiting:
            found = [c for c in before.get(waiting.pop(), ()) if c not in good]
            good.update(found)
            waiting.extend(found)
        for here in self.edges:
            if here not in good:
                text = f"from initiator {here.initiator}, participant {here.participant} the end is out of reach"
                yield Finding(here, text, self._way_to(here))

    def _at_rest(self, here: Configuration) -> bool:
        tables = self.protocol.tables.items()
        quiet = not (here.to_initiator or here.to_participant)
        return quiet and all(here.state(role) in table.ended | table.resting for role, table in tables)

    def _way_to(self, here: Configuration) -> tuple[Step, ...]:
        steps: list[Step] = []
        parent = self.parents[here]
        while parent is not None:
            step, here = parent
            steps.append(step)
            parent = self.parents[here]
        return tuple(reversed(steps))


def _made(
    role: Role, state: str, inbound: tuple[Message, ...], other: str, outbound: tuple[Message, ...]
) -> Configuration:
    """A configuration seen from `role`."""
    if role is Role.INITIATOR:
        return Configuration(state, other, inbound, outbound)
    return Configuration(other, state, outbound, inbound)

"""Exhaustive exploration of a protocol: both roles, connected by two bounded FIFO channels.

A configuration is the state of each role and the messages in transit to each. From every reachable
configuration the end (both roles ended or resting, channels empty) must be reachable without free
steps, since nobody may wait for a cancel, a repetition or another report. A full channel blocks its
sender. Content, time and faults of the transport are not modelled (durable streams hide the
latter).
"""

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import NamedTuple, TypeVar

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, START, Protocol, Role, Row, Table

Message = tuple[Performative, Kind]
One = TypeVar("One", bound=Hashable)

CAPACITY = 3
"""Messages in transit to one role.

Measured: capacities 2 to 5 give the same findings for the tables of this package.
"""


class Configuration(NamedTuple):
    """State of each role, and the messages in transit to each in order of arrival."""

    initiator: str
    participant: str
    to_initiator: tuple[Message, ...] = ()
    to_participant: tuple[Message, ...] = ()

    def state(self, role: Role) -> str:
        """The state of a role."""
        return self.initiator if role is Role.INITIATOR else self.participant

    def inbound(self, role: Role) -> tuple[Message, ...]:
        """The messages in transit to a role."""
        return self.to_initiator if role is Role.INITIATOR else self.to_participant


class Step(NamedTuple):
    """A transition: one role uses one row."""

    role: Role
    row: Row

    def __str__(self) -> str:
        verb = "sends" if self.row.way is SEND else "receives"
        return f"{self.role} {verb} {self.row.word} -> {self.row.to}"


class Finding(NamedTuple):
    """An error: the configuration, its description, and a shortest sequence of steps to it."""

    configuration: Configuration
    text: str
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        return "\n  ".join((self.text, *map(str, self.steps)))


class Exploration(NamedTuple):
    """The result. `unspecified`: receptions without a row; `stuck`: configurations from which the
    end is unreachable.

    `unreachable`: states in no configuration; `unused`: rows in no step (not an error by
    themselves).
    """

    configurations: int
    unspecified: tuple[Finding, ...]
    stuck: tuple[Finding, ...]
    unreachable: tuple[tuple[Role, str], ...]
    unused: tuple[tuple[Role, Row], ...]

    @property
    def sound(self) -> bool:
        """Whether there is no unspecified reception, no stuck configuration and no unreachable
        state.
        """
        return not (self.unspecified or self.stuck or self.unreachable)


def reached(first: Iterable[One], onward: Callable[[One], Iterable[One]]) -> set[One]:
    """All that `onward` leads to from `first`, in any number of steps; with `first` itself."""
    found = set(first)
    waiting = list(found)
    while waiting:
        more = set(onward(waiting.pop())) - found
        found |= more
        waiting += more
    return found


def explore(protocol: Protocol, capacity: int = CAPACITY) -> Exploration:
    """Explore one conversation with at most `capacity` messages in transit to each role; return the
    result.
    """
    search = _Search(protocol, capacity)
    seen = {(role, c.state(role)) for c in search.parents for role in Role}
    used = {step for steps in search.edges.values() for step, _ in steps}
    tables = protocol.tables.items()
    return Exploration(
        configurations=len(search.parents),
        unspecified=tuple(search.unspecified()),
        stuck=tuple(search.stuck()),
        unreachable=tuple(
            sorted((role, str(s)) for role, t in tables for s in t.states if (role, s) not in seen)
        ),
        unused=tuple((role, row) for role, t in tables for row in t if Step(role, row) not in used),
    )


def edges(
    protocol: Protocol, capacity: int = CAPACITY
) -> dict[Configuration, list[tuple[Step, Configuration]]]:
    """Every reachable configuration, the initial one first, with its steps and their successors."""
    return _Search(protocol, capacity).edges


def shortest(protocol: Protocol) -> tuple[Step, ...]:
    """The steps of a shortest conversation to the end: both ended or resting, no message in
    transit.
    """
    search = _Search(protocol, 1)
    first = next(iter(search.parents))
    end = next((here for here in search.parents if here != first and search._finished(here)), None)
    return () if end is None else search._path_to(end)


def with_not_understood(protocol: Protocol) -> Protocol:
    """The protocol with the rule of not-understood as rows, so that it can be explored too.

    Either role may send not-understood once the conversation is open. It ends the conversation for
    its sender, who ignores what is still in transit, and for its receiver. A conversation that has
    ended keeps its state.
    """
    initiator = _table_with_not_understood(protocol, Role.INITIATOR)
    participant = _table_with_not_understood(protocol, Role.PARTICIPANT)
    return protocol.with_tables(initiator=initiator, participant=participant)


def _table_with_not_understood(protocol: Protocol, role: Role) -> Table:
    old, peer = protocol.tables[role], protocol.tables[role.other]
    not_understood = (Performative.NOT_UNDERSTOOD, Kind.PLAIN)
    ignored = {(row.performative, row.kind) for row in peer if row.way is SEND} | {not_understood}
    late = (Row(NOT_UNDERSTOOD, RECEIVE, *message, NOT_UNDERSTOOD) for message in sorted(ignored))
    rows = [*old, *late]
    for state in sorted(old.states - {START}):
        rows.append(
            Row(state, RECEIVE, *not_understood, state if state in old.ended else NOT_UNDERSTOOD)
        )
        if state not in old.ended | old.urgent:
            rows.append(Row(state, SEND, *not_understood, NOT_UNDERSTOOD))
    return Table(rows, ended=(*old.ended, NOT_UNDERSTOOD), urgent=old.urgent, resting=old.resting)


class _Search:
    """Breadth-first search from the start: `edges` of each configuration, `parents` on a shortest
    path.
    """

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
                    peer = here.state(role.other)
                    yield Step(role, row), _configuration(role, row.to, inbound, peer, sent)
            received = self._reception(here, role)
            if received:
                peer = here.state(role.other)
                there = _configuration(role, received.to, inbound[1:], peer, outbound)
                yield Step(role, received), there

    def _reception(self, here: Configuration, role: Role) -> Row | None:
        """The row for the first message in transit; None also while the role must send first."""
        table, state, inbound = self.protocol.tables[role], here.state(role), here.inbound(role)
        if not inbound or state in table.urgent:
            return None
        return table.find(state, RECEIVE, *inbound[0])

    def unspecified(self) -> Iterator[Finding]:
        """Yield the configurations in which a role that may receive has no row for the next
        message.
        """
        for here in self.edges:
            for role, table in self.protocol.tables.items():
                state, inbound = here.state(role), here.inbound(role)
                if inbound and state not in table.urgent and self._reception(here, role) is None:
                    performative, kind = inbound[0]
                    word = f"{performative}[{kind}]" if kind else performative
                    yield Finding(
                        here, f"{role} in state {state} has no row for {word}", self._path_to(here)
                    )

    def stuck(self) -> Iterator[Finding]:
        """Yield the configurations from which the end is not reachable without free steps."""
        before: dict[Configuration, list[Configuration]] = {}
        for here, steps in self.edges.items():
            for step, there in steps:
                if not step.row.free:
                    before.setdefault(there, []).append(here)
        ends = filter(self._finished, self.edges)
        good = reached(ends, lambda there: before.get(there, ()))
        for here in self.edges:
            if here not in good:
                text = (
                    f"from initiator {here.initiator}, participant {here.participant} the end is"
                    " unreachable"
                )
                yield Finding(here, text, self._path_to(here))

    def _finished(self, here: Configuration) -> bool:
        tables = self.protocol.tables.items()
        quiet = not (here.to_initiator or here.to_participant)
        return quiet and all(
            here.state(role) in table.ended | table.resting for role, table in tables
        )

    def _path_to(self, here: Configuration) -> tuple[Step, ...]:
        steps: list[Step] = []
        parent = self.parents[here]
        while parent is not None:
            step, here = parent
            steps.append(step)
            parent = self.parents[here]
        return tuple(reversed(steps))


def _configuration(
    role: Role, state: str, inbound: tuple[Message, ...], other: str, outbound: tuple[Message, ...]
) -> Configuration:
    """The configuration whose parts are given from the view of `role`."""
    if role is Role.INITIATOR:
        return Configuration(state, other, inbound, outbound)
    return Configuration(other, state, outbound, inbound)

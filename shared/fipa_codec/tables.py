"""Protocols as data: a table per role, (state, way, performative, kind) -> next state; and the
registry of their names.

The tables alone decide whether a communicate is in sequence: a message without a row is an error.
They do not depend on which agent has the role. One rule is outside the tables, that of
not-understood (SC00037J: at any point, about any message, ends the interaction); it is in
`conversation.py`. Independent of content, time and transport.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import StrEnum
from typing import NamedTuple, Self

from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative

START = "start"
"""State of both roles before the first message."""
NOT_UNDERSTOOD = "not-understood"
"""State of both roles after a not-understood: ended; messages still in transit are ignored."""


class Role(StrEnum):
    """The two sides of a conversation."""

    INITIATOR = "initiator"
    PARTICIPANT = "participant"

    @property
    def other(self) -> "Role":
        """The peer's role."""
        return Role.PARTICIPANT if self is Role.INITIATOR else Role.INITIATOR


class Way(StrEnum):
    """Direction of a message, seen from the role of the table."""

    SEND = "send"
    RECEIVE = "receive"


SEND, RECEIVE = Way.SEND, Way.RECEIVE
"""The two ways, for short tables."""


class Row(NamedTuple):
    """A transition: in `state` the role may send, or must accept, `performative` of `kind`; its
    next state is `to`.
    """

    state: str
    way: Way
    performative: Performative
    kind: Kind
    to: str

    @property
    def word(self) -> str:
        """The performative with its kind, for people: `inform[progress]`."""
        return f"{self.performative}[{self.kind}]" if self.kind else str(self.performative)

    @property
    def free(self) -> bool:
        """Whether the role may never send this: a cancel, a not-understood, a message without a
        change of state.
        """
        choice = self.performative in (Performative.CANCEL, Performative.NOT_UNDERSTOOD)
        return self.way is SEND and (choice or self.to == self.state)


class Table:
    """The rows of one role.

    `ended`: states in which the conversation is over for this role; they may have rows (a late
    cancel is answered, a repeated answer dropped). `urgent`: states in which the role must send in
    the same step and accepts nothing. `resting`: states that may last for ever although the
    conversation is open (a live subscription). Raise LocalProtocolError for two rows of one message
    in one state, and for a state without a row.
    """

    def __init__(
        self,
        rows: Iterable[Row],
        *,
        ended: Iterable[str],
        urgent: Iterable[str] = (),
        resting: Iterable[str] = (),
    ) -> None:
        self._rows: dict[tuple[str, Way, Performative, Kind], Row] = {}
        for row in rows:
            if self._rows.setdefault(row[:4], row) is not row:
                raise LocalProtocolError(
                    "rows", f"two rows for {row.word} ({row.way}) in state {row.state}"
                )
        self.ended, self.urgent = frozenset(ended), frozenset(urgent)
        self.resting = frozenset(resting)
        known = self.states
        for state in self.ended | self.urgent | self.resting:
            if state not in known:
                raise LocalProtocolError("rows", f"no row leads to or from state {state!r}")

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows.values())

    @property
    def states(self) -> frozenset[str]:
        """All states of the rows."""
        return frozenset(state for row in self for state in (row.state, row.to))

    def same_as(self, other: "Table") -> bool:
        """Whether both have the same rows, and states of the same meaning."""
        mine = (self._rows, self.ended, self.urgent, self.resting)
        return mine == (other._rows, other.ended, other.urgent, other.resting)

    def find(
        self, state: str, way: Way, performative: Performative, kind: Kind = Kind.PLAIN
    ) -> Row | None:
        """The row, or None if the message is not allowed in this state."""
        return self._rows.get((state, way, performative, kind))

    def allowed(self, state: str, way: Way) -> tuple[Row, ...]:
        """All rows of a state in one way."""
        return tuple(row for row in self if row.state == state and row.way is way)

    def without(
        self, state: str, way: Way, performative: Performative, kind: Kind = Kind.PLAIN
    ) -> "Table":
        """The table without one row. Raise LocalProtocolError if there is no such row."""
        gone = self.find(state, way, performative, kind)
        if gone is None:
            raise LocalProtocolError(
                "rows", f"no row for {performative}[{kind}] ({way}) in state {state}"
            )
        return self.only(row for row in self if row is not gone)

    def with_rows(self, *rows: Row) -> "Table":
        """The table with these rows; each replaces the row of the same message and state, if there
        is one.
        """
        merged = self._rows | {row[:4]: row for row in rows}
        return self.only(merged.values())

    def only(self, rows: Iterable[Row]) -> "Table":
        """The table with these rows in place of its own; the marks of states without a row go with
        them.
        """
        kept = tuple(rows)
        states = {state for row in kept for state in (row.state, row.to)}
        ended = self.ended & states
        return Table(kept, ended=ended, urgent=self.urgent & states, resting=self.resting & states)


class Protocol:
    """A name and a table per role.

    `aliases`: other names on the wire (`fipa-request`). `confirmed`: performatives each of whose
    messages is answered by a confirm (informs of coordinate); the confirm has the kind of the
    message it confirms. `rounds`: openings that start a new round with a new m_w when sent again
    (cfp of icfp); any other opening sent again is a repetition. `openings`: performatives that
    start a conversation.
    """

    def __init__(
        self,
        name: str,
        *,
        initiator: Table,
        participant: Table,
        aliases: tuple[str, ...] = (),
        confirmed: Iterable[Performative] = (),
        rounds: Iterable[Performative] = (),
    ) -> None:
        self.name, self.aliases, self.confirmed = name, aliases, frozenset(confirmed)
        self.rounds = frozenset(rounds)
        self.tables: Mapping[Role, Table] = {
            Role.INITIATOR: initiator,
            Role.PARTICIPANT: participant,
        }
        self.openings = frozenset(row.performative for row in initiator.allowed(START, SEND))

    def __repr__(self) -> str:
        return f"Protocol({self.name!r})"

    def same_as(self, other: "Protocol") -> bool:
        """Whether both have the same names, tables and rules."""
        mine = (self.name, self.aliases, self.confirmed, self.rounds)
        alike = mine == (other.name, other.aliases, other.confirmed, other.rounds)
        return alike and all(
            table.same_as(other.tables[role]) for role, table in self.tables.items()
        )

    def with_tables(
        self, *, initiator: Table | None = None, participant: Table | None = None
    ) -> Self:
        """The protocol with other tables: a variant to be explored, not to be registered."""
        return type(self)(
            self.name,
            initiator=initiator or self.tables[Role.INITIATOR],
            participant=participant or self.tables[Role.PARTICIPANT],
            aliases=self.aliases,
            confirmed=self.confirmed,
            rounds=self.rounds,
        )


class _Registry(dict[str, Protocol]):
    def __missing__(self, name: str) -> Protocol:
        raise LocalProtocolError(
            "protocol", f"{name!r} is unknown, known are {', '.join(sorted(self))}"
        )


_registered = _Registry()
named: Callable[[str], Protocol] = _registered.__getitem__
"""The protocol of a name or alias. Raise LocalProtocolError, with the known names, if there is
none.

The protocol of a system is known once the module that registers it is imported."""


def known() -> tuple[Protocol, ...]:
    """Every registered protocol once, in the order of registration."""
    return tuple(dict.fromkeys(_registered.values()))


def register(protocol: Protocol) -> Protocol:
    """Make a protocol known by its name and aliases, for conversations read from a wire or a
    journal; return it.

    One that is registered again, since its module was read twice, is the same. Raise
    LocalProtocolError if another protocol has one of the names.
    """
    for name in (protocol.name, *protocol.aliases):
        if not _registered.setdefault(name, protocol).same_as(protocol):
            raise LocalProtocolError("protocol", f"{name!r} is already another protocol")
    return protocol

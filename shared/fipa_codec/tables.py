"""What a protocol is: a table per role, (state, way, performative, kind) -> next state, looked up once.

Whatever decides if a communicate is in sequence is in such a table, and a table does not know which agent plays a role.
A missing row is the error. The one rule outside the tables is that of not-understood (SC00037J: at any point, about any
message, ends the interaction); `conversation.py` holds it. Must not know: content, time, transport.
"""

from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum
from typing import NamedTuple, Self

from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative

START = "start"
"""State of both roles before the opening."""
NOT_UNDERSTOOD = "not-understood"
"""State of both roles after a not-understood: ended, and deaf to what was still on its way."""


class Role(StrEnum):
    """The two sides of a conversation."""

    INITIATOR = "initiator"
    PARTICIPANT = "participant"

    @property
    def other(self) -> "Role":
        """The role of the peer."""
        return Role.PARTICIPANT if self is Role.INITIATOR else Role.INITIATOR


class Way(StrEnum):
    """Who speaks, seen from the role of the table."""

    SEND = "send"
    RECEIVE = "receive"


SEND, RECEIVE = Way.SEND, Way.RECEIVE


class Row(NamedTuple):
    """In `state` this role may send, or must take, `performative` of this `kind`, and then is in state `to`."""

    state: str
    way: Way
    performative: Performative
    kind: Kind
    to: str

    @property
    def word(self) -> str:
        """The performative with its guard word, as people read it."""
        return f"{self.performative}[{self.kind}]" if self.kind else str(self.performative)

    @property
    def free(self) -> bool:
        """A send that may never come, so nobody may wait for it: a cancel, a complaint, what changes no state."""
        choice = self.performative in (Performative.CANCEL, Performative.NOT_UNDERSTOOD)
        return self.way is SEND and (choice or self.to == self.state)


class Table:
    """The rows of one role.

    `ended`: the conversation is over for this role; rows may still leave or stay there (late cancels are answered,
    repeated answers dropped). `urgent`: left by a send in the same step, so nothing is taken meanwhile. `resting`: may
    last for ever though nothing has ended (a live subscription).
    """

    def __init__(
        self, rows: Iterable[Row], *, ended: Iterable[str], urgent: Iterable[str] = (), resting: Iterable[str] = ()
    ) -> None:
        self._rows: dict[tuple[str, Way, Performative, Kind], Row] = {}
        for row in rows:
            if self._rows.setdefault(row[:4], row) is not row:
                raise LocalProtocolError("rows", f"two rows for {row.word} ({row.way}) in state {row.state}")
        self.ended, self.urgent, self.resting = frozenset(ended), frozenset(urgent), frozenset(resting)
        known = self.states
        for state in self.ended | self.urgent | self.resting:
            if state not in known:
                raise LocalProtocolError("rows", f"no row leads to or from state {state!r}")

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows.values())

    @property
    def states(self) -> frozenset[str]:
        """Every state a row names."""
        return frozenset(state for row in self for state in (row.state, row.to))

    def find(self, state: str, way: Way, performative: Performative, kind: Kind = Kind.PLAIN) -> Row | None:
        """The one row, or None: not allowed there."""
        return self._rows.get((state, way, performative, kind))

    def allowed(self, state: str, way: Way) -> tuple[Row, ...]:
        """All rows of a state in one way."""
        return tuple(row for row in self if row.state == state and row.way is way)

    def without(self, state: str, way: Way, performative: Performative, kind: Kind = Kind.PLAIN) -> "Table":
        """The same table less one row. LocalProtocolError if there is no such row."""
        gone = self.find(state, way, performative, kind)
        if gone is None:
            raise LocalProtocolError("rows", f"no row for {performative}[{kind}] ({way}) in state {state}")
        return self._replaced(row for row in self if row is not gone)

    def with_rows(self, *rows: Row) -> "Table":
        """The same table with these rows added, or put in the place of the row for the same message and state."""
        merged = self._rows | {row[:4]: row for row in rows}
        return self._replaced(merged.values())

    def _replaced(self, rows: Iterable[Row]) -> "Table":
        kept = tuple(rows)
        states = {state for row in kept for state in (row.state, row.to)}
        return Table(kept, ended=self.ended & states, urgent=self.urgent & states, resting=self.resting & states)


class Protocol:
    """A name and a table per role.

    `aliases`: other names on the wire (`fipa-request`). `confirmed`: performatives whose every use is confirmed by
    name (coordinate: the informs), so that a confirm has the kind of the message it answers. `rounds`: openings that,
    said once more, ask anew with a new m_w (icfp: the cfp); any other opening said once more is the same question.
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
        self.tables: Mapping[Role, Table] = {Role.INITIATOR: initiator, Role.PARTICIPANT: participant}
        self.openings = frozenset(row.performative for row in initiator.allowed(START, SEND))

    def __repr__(self) -> str:
        return f"Protocol({self.name!r})"

    def varied(self, *, initiator: Table | None = None, participant: Table | None = None) -> Self:
        """The same protocol with another table for a role: variants to be explored, never to be registered."""
        return type(self)(
            self.name,
            initiator=initiator or self.tables[Role.INITIATOR],
            participant=participant or self.tables[Role.PARTICIPANT],
            aliases=self.aliases,
            confirmed=self.confirmed,
            rounds=self.rounds,
        )

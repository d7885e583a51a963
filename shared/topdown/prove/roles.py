"""Common parts of both kinds of pairs: the two role tables of a protocol as they are, and the names
of its players.

Nothing here adds or takes away a row: a model made of these is the running conversation's own
tables.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from fipa_codec.exploration import reached
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row, Table
from topdown.prove.net import Command, Effect, Guard, Net, Queue, Set, Variable, Wrong, is_

CANCEL = Performative.CANCEL
WRONG = "wrong"
"""Variable of a net: what is wrong, "" for nothing."""


class Players(NamedTuple):
    """Names of the two agents, as drawings show them."""

    initiator: str = "initiator"
    participant: str = "participant"

    def named(self, role: Role) -> str:
        """The one who plays it."""
        return self.initiator if role is Role.INITIATOR else self.participant


class Pair:
    """A protocol and its players: the words of each side, states, rows by purpose."""

    def __init__(self, protocol: Protocol, players: Players) -> None:
        self.protocol, self.players = protocol, players
        self.tables = protocol.tables

    def state(self, role: Role) -> Variable:
        """The state of a role."""
        table = self.tables[role]
        others = sorted(str(state) for state in table.states if state != START)
        return Variable(self.players.named(role), (START, *others), owner=self.players.named(role))

    def words(self, role: Role) -> tuple[str, ...]:
        """All that a role says, sorted."""
        return tuple(sorted({row.word for row in self.tables[role] if row.way is SEND}))

    def spoken(self, role: Role) -> tuple[Row, ...]:
        """One row of each word that a role says."""
        return tuple({row.word: row for row in self.tables[role] if row.way is SEND}.values())

    def over(self, role: Role) -> frozenset[str]:
        """States in which a role has no conversation: not begun, or ended and forgotten."""
        return frozenset({START, *map(str, self.tables[role].ended)})

    def opens(self, row: Row) -> bool:
        """Whether a row is about an act that opens conversations; in a later state it is another
        round, or repeats.
        """
        return row.performative in self.protocol.openings

    def sends(self, role: Role) -> Iterator[Row]:
        """Rows that say something within a conversation, or begin one; asking again is the
        delivery's business.
        """
        for row in self.tables[role]:
            if row.way is SEND and not (self.opens(row) and row.to == row.state):
                yield row

    def sources(self, role: Role, row: Row) -> frozenset[str]:
        """States in which a row applies: that of a conversation which is not open also after the
        last one has ended.
        """
        return self.over(role) if row.state == START else frozenset({str(row.state)})

    def takes(self, role: Role) -> Iterator[tuple[Row, frozenset[str]]]:
        """Rows that take something, and the states in which they apply: remembered or forgotten, if
        it has ended.
        """
        said = self.words(role.other)
        for row in self.tables[role]:
            if row.way is RECEIVE and row.word in said:
                yield row, frozenset({str(row.state)})
                forgotten = self.over(role) - {str(row.state)}
                if row.state == START and forgotten:
                    yield row, forgotten

    def untaken(self, role: Role) -> Iterator[tuple[str, str, bool]]:
        """(state, word, forgotten): what the peer may say and this role has no row for, though it
        is free to take.

        An opening that comes while a conversation is open waits for its end. What a participant
        meets after an end must be taken by the rows of the ended state and, an act without answer
        apart, by those of an unknown conversation.
        """
        table, over = self.tables[role], self.over(role)
        for row in self.spoken(role.other):
            for state in sorted(table.states - table.urgent):
                here = table.find(state, RECEIVE, row.performative, row.kind)
                unknown = table.find(START, RECEIVE, row.performative, row.kind)
                if self.opens(row):
                    if state in over and unknown is None:
                        yield str(state), row.word, False
                elif here is None:
                    yield str(state), row.word, False
                elif state in table.ended and unknown is None and row.performative is CANCEL:
                    yield str(state), row.word, True

    def wrong_words(self, role: Role, state: str, word: str, forgotten: bool) -> str:
        """In words the row that is missing."""
        where = f"in state {state}" + (", its conversation forgotten," if forgotten else "")
        return f"{self.players.named(role)} {where} has no row for {word}"

    def at_rest(self) -> tuple[tuple[Guard, ...], ...]:
        """Alternatives: neither has an open conversation, or in both it may last for ever."""
        roles = tuple(Role)
        over = tuple(is_(self.players.named(role), *self.over(role)) for role in roles)
        resting = {role: sorted(map(str, self.tables[role].resting)) for role in roles}
        if not all(resting.values()):
            return (over,)
        return over, tuple(is_(self.players.named(role), *resting[role]) for role in roles)

    @property
    def name(self) -> str:
        """Of a net of it."""
        return f"{self.protocol.name} {self.players.initiator} {self.players.participant}"

    def net(
        self,
        commands: tuple[Command, ...],
        texts: list[str],
        empty: tuple[Guard, ...],
        variables: tuple[Variable, ...] = (),
        queues: tuple[Queue, ...] = (),
    ) -> Net:
        """The net of these commands, some of which set WRONG to one of `texts`; at rest is what is
        `empty` and neither role waits in.
        """
        wrong = Variable(WRONG, ("", *dict.fromkeys(texts)))
        everything = (*(self.state(role) for role in Role), *variables, wrong)
        rest = tuple((*states, *empty) for states in self.at_rest())
        wrongs = tuple(Wrong(text, (is_(WRONG, text),)) for text in wrong.values[1:])
        return Net(self.name, everything, queues, commands, rest, wrongs, tuple(self.players))


def to(variable: str, value: object) -> Effect:
    """The effect, shorter to write."""
    return Set(variable, str(value))


def fault(who: str, what: str, guards: tuple[Guard, ...], effects: tuple[Effect, ...]) -> Command:
    """A fault of the surroundings."""
    return Command(who, what, guards, effects, fair=False, fault=True)


def spoilt_copies(name: str, words: str) -> Iterator[Command]:
    """Yield the loss and the duplication of what a variable counts copies of."""
    for before, after, verb in ((1, 0, "loses"), (2, 1, "loses"), (1, 2, "doubles")):
        yield fault("wire", f"{verb} {words}", (is_(name, str(before)),), (to(name, after),))


def reachable(table: Table) -> Table:
    """The rows that a walk from the start reaches, whatever the peer does."""
    known = reached([START], lambda state: (row.to for row in table if row.state == state))
    return table.only(row for row in table if row.state in known)


def restricted(protocol: Protocol, says: Mapping[Role, Collection[str]]) -> Protocol:
    """The protocol as a use of it has it: each role says only these words, and what needs others is
    out of reach.

    Answers to a cancel stay: the runtime gives them by itself where the cancel came too late.
    """

    def kept(row: Row, role: Role) -> bool:
        speaker = role if row.way is SEND else role.other
        return row.word in says[speaker] or row.kind is Kind.CANCEL

    tables = {
        role.value: reachable(table.only(row for row in table if kept(row, role)))
        for role, table in protocol.tables.items()
    }
    return protocol.with_tables(**tables)

"""An agent's conversational behaviour as rows: which event, in which state, makes it say what, and
wait where next.

The rows stand in the design file beside the states and arcs (elements.Row). Two readers use them:
the running agent takes a message only where a row of its state names it, and its steps are compared
with the rows; the proof composes the rows of all agents. Nothing here knows a particular system.
"""

import re
from collections.abc import Collection
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Protocol, Role
from topdown.model import elements
from topdown.model.design import Design, act_word
from topdown.model.errors import DesignError
from topdown.model.loading import Path_, line_of

NONE = "none"
"""Word for a conversation that is not open, in a row's `when`."""
SETTLED, UNSETTLED = "settled", "unsettled"
"""Words for what is due to a subscriber: nothing, or something."""
WAITING, SERVED = "waiting", "served"
"""Words for a conversation that waits for its turn, as a row's `waits` said, and for one that does
not.
"""
WORDS = frozenset((SETTLED, UNSETTLED, WAITING, SERVED))
"""Words of guards, not states: a protocol's state of the same name is not meant (request-when has
`waiting`).
"""


class Cause(StrEnum):
    """Kinds of events of a row."""

    TAKE = "take"
    LATE = "late"
    BACK = "back"
    RESTART = "restart"
    OWN = "own"
    PERSON = "person"


class ProtocolAct(NamedTuple):
    """An act in a use of a protocol."""

    use: str
    act: Performative
    kind: Kind

    def __str__(self) -> str:
        return f"{self.use} {self.act}[{self.kind}]" if self.kind else f"{self.use} {self.act}"


class Event(NamedTuple):
    """The event of a row. `name`: the use (take, late), the peer (back), a word (own, person)."""

    cause: Cause
    name: str = ""
    act: Performative | None = None
    kind: Kind = Kind.PLAIN

    def __str__(self) -> str:
        if self.cause is Cause.TAKE and self.act is not None:
            return str(ProtocolAct(self.name, self.act, self.kind))
        return f"{self.cause} {self.name}".strip()


class Guard(NamedTuple):
    """A condition on one of the agent's own conversations, or on what is due in it."""

    use: str
    words: frozenset[str]

    @property
    def states(self) -> frozenset[str]:
        """The states among its words, and NONE."""
        return self.words - WORDS


class Row(NamedTuple):
    """elements.Row, read."""

    number: int
    states: frozenset[str]
    event: Event
    say: tuple[ProtocolAct, ...]
    may: tuple[ProtocolAct, ...]
    drop: tuple[str, ...]
    when: tuple[Guard, ...]
    owes: tuple[str, ...]
    waits: tuple[str, ...]
    moves: str
    to: str
    several: bool

    def __str__(self) -> str:
        says = f" say {', '.join(map(str, self.say))}" if self.say else ""
        owes = f", owes {' and '.join(self.owes)}" if self.owes else ""
        to = f", to {self.to}" if self.to else ""
        return f"row {self.number} (on {self.event}{says}{owes}{to})"


class Use(NamedTuple):
    """An agent's side of a use of a protocol."""

    name: str
    peer: str
    role: Role
    protocol: Protocol
    durable: bool
    latest: bool


class Machine:
    """The rows of one agent, by state and event. Raises DesignError for a row that cannot be
    read.
    """

    def __init__(self, design: Design, agent: str) -> None:
        self.agent = agent
        self.entry = design.agent(agent)
        self.uses = {
            use.name: Use(
                name=use.name,
                peer=use.peer(agent),
                role=use.role(agent),
                protocol=design.tables[use.follows],
                durable=use.durable,
                latest=use.latest,
            )
            for use in (*design.file.protocol, *design.included_uses.values())
            if agent in (use.initiator, use.participant) and use.follows in design.tables
        }
        read = _Rows(self, design)
        read.choices()
        self.rows = tuple(
            read.row(number, row, onward)
            for number, row in enumerate(self.entry.row, start=1)
            for onward in read.onwards(number, row)
        )

    @property
    def rest(self) -> frozenset[str]:
        """States in which the agent is idle."""
        return frozenset(self.entry.rest or (self.entry.initial,))

    @cached_property
    def waits(self) -> frozenset[str]:
        """The states it waits in between two steps: those that rows name."""
        ends = {row.to for row in self.rows if row.to} | {self.entry.initial}
        return frozenset(ends.union(*(row.states for row in self.rows)))

    @cached_property
    def by_event(self) -> dict[tuple[str, Event], tuple[Row, ...]]:
        """Rows for an event in a state."""
        found: dict[tuple[str, Event], list[Row]] = {}
        for row in self.rows:
            for state in row.states:
                found.setdefault((state, row.event), []).append(row)
        return {key: tuple(rows) for key, rows in found.items()}

    @cached_property
    def spontaneous(self) -> dict[str, tuple[Row, ...]]:
        """Rows of a state that need no message: everything but what is taken."""
        return {
            state: tuple(
                row
                for row in self.rows
                if state in row.states and row.event.cause is not Cause.TAKE
            )
            for state in self.waits
        }

    def own(self, state: str) -> tuple[str, ...]:
        """Words of the own side that rows of this state wait for; none in a state of rest."""
        rows = self.spontaneous.get(state, ()) if state not in self.rest else ()
        words = (row.event.name for row in rows if row.event.cause is Cause.OWN)
        return tuple(dict.fromkeys(words))

    def ends_wait(self, use: str) -> bool:
        """Whether a row is for the end of the wait in a conversation that this agent opens."""
        ends = (row for row in self.rows if row.event.cause is Cause.LATE and row.event.name == use)
        return self.uses[use].role is Role.INITIATOR and any(True for _ in ends)

    def takes(self, state: str, use: str, act: Performative, kind: Kind) -> bool:
        """Whether a message is taken in this state; what is not waits in the inbox. Without rows
        everything is.
        """
        return not self.rows or (state, Event(Cause.TAKE, use, act, kind)) in self.by_event


def machines(design: Design) -> dict[str, Machine]:
    """The machine of every agent, by name."""
    return {name: Machine(design, name) for name in design.agents}


_CAUSE = re.compile(r"(late|back|own|person) (\S+)|restart")


class References:
    """Reads words of a design that name something else of it; every error names where, and what
    there is.
    """

    def __init__(self, design: Design, where: str = "", at: Path_ = ()) -> None:
        self.file, self.where = design.path or "design.toml", where
        self.text, self.at = design.text, at

    def among(self, kind: str, name: str, known: Collection[str]) -> None:
        """Raises DesignError where nothing of this kind has the name."""
        if name not in known:
            raise self.error(
                f"no {kind} {name!r}", f"there are {', '.join(sorted(known)) or 'none'}"
            )

    def said(self, text: str, uses: Collection[str], kind: str = "protocol") -> ProtocolAct:
        """An act in one of these uses."""
        use, _, word = text.partition(" ")
        self.among(kind, use, uses)
        try:
            return ProtocolAct(use, *act_word(word))
        except ValueError as error:
            raise self.error(f"{text!r}: {error}", 'write "USE act" or "USE act[kind]"') from error

    def error(self, wrong: str, right: str) -> DesignError:
        """What is wrong here."""
        line = line_of(self.text, self.at) if self.text and self.at else None
        return DesignError(self.file, line, self.where, wrong, right, self.at)


class _Rows(References):
    def __init__(self, machine: Machine, design: Design) -> None:
        index = next(i for i, one in enumerate(design.file.agent) if one.name == machine.agent)
        super().__init__(design, at=("agent", index))
        self.machine, self.mine = machine, self.at
        uses = machine.uses.values()
        self.peers = {use.peer for use in uses}
        self.volatile = {use.name for use in uses if not use.durable}
        self.observed = {use.name for use in uses if use.latest and use.role is Role.PARTICIPANT}

    def onwards(self, number: int, row: elements.Row) -> tuple[elements.Onward, ...]:
        """The ways a row goes on; one that adds nothing where it names no choice."""
        self._at_row(number)
        if not row.then:
            return (elements.Onward(),)
        choices = {choice.name: choice.ways for choice in self.machine.entry.choice}
        self.among("choice", row.then, choices.keys())
        return choices[row.then]

    def choices(self) -> None:
        """Raises DesignError for a way that cannot be read, whichever rows go on with it."""
        states = {state.name for state in self.machine.entry.state}
        for index, choice in enumerate(self.machine.entry.choice):
            for number, way in enumerate(choice.ways):
                self.where = f"agent {self.machine.agent}, choice {choice.name}, way {number + 1}"
                self.at = (*self.mine, "choice", index, "ways", number)
                if way.to:
                    self.among("state", way.to, states)
                for text in way.say:
                    self.said(text, self.machine.uses)
                for text in way.when:
                    self.guard(text)

    def _at_row(self, number: int) -> None:
        self.where = f"agent {self.machine.agent}, row {number}"
        self.at = (*self.mine, "row", number - 1)

    def row(self, number: int, row: elements.Row, onward: elements.Onward) -> Row:
        self._at_row(number)
        states, to = {state.name for state in self.machine.entry.state}, onward.to or row.to
        if not row.in_:
            raise self.error("stands in no state", "name under `in` the states it stands in")
        for state in (*row.in_, *((row.to,) if row.to else ())):
            self.among("state", state, states)
        for use in row.drop:
            self.among("volatile protocol to drop", use, self.volatile)
        for use in row.owes:
            kind = "latest protocol with a subscriber, in which it owes observations,"
            self.among(kind, use, self.observed)
        for use in row.waits:
            self.among("protocol", use, self.machine.uses)
        if row.moves:
            self.among("protocol", row.moves, self.machine.uses)
        for field, use in (*(("waits", use) for use in row.waits), ("moves", row.moves)):
            if use and self.machine.uses[use].role is Role.INITIATOR:
                wrong = f"`{field}` names {use}, which this agent opens itself"
                raise self.error(wrong, "name a use in which a peer asks it")
        return Row(
            number,
            frozenset(row.in_),
            self.event(row.on),
            tuple(self.said(text, self.machine.uses) for text in (*row.say, *onward.say)),
            tuple(self.said(text, self.machine.uses) for text in row.may),
            row.drop,
            tuple(map(self.guard, (*row.when, *onward.when))),
            row.owes,
            row.waits,
            row.moves,
            to,
            row.several,
        )

    def event(self, text: str) -> Event:
        match = _CAUSE.fullmatch(text)
        if match is None:
            return Event(Cause.TAKE, *self.said(text, self.machine.uses))
        if match[1] == Cause.LATE:
            self.among("protocol", match[2], self.machine.uses)
        if match[1] == Cause.BACK and match[2] not in self.peers:
            wrong = f"`{text}` is about no peer of {self.machine.agent}"
            raise self.error(wrong, f"its peers are {', '.join(sorted(self.peers)) or 'none'}")
        return Event(Cause(match[1] or "restart"), match[2] or "")

    def guard(self, text: str) -> Guard:
        use, _, words = text.partition(" ")
        if use not in self.machine.uses:
            right = f'write "USE state|state"; its protocols are {", ".join(self.machine.uses)}'
            wrong = f"guard {text!r} begins with no protocol of {self.machine.agent}"
            raise self.error(wrong, right)
        table = self.machine.uses[use].protocol.tables[self.machine.uses[use].role]
        known = {*map(str, table.states), NONE, *WORDS}
        for word in words.split("|"):
            self.among(f"state of {use}", word, known)
        return Guard(use, frozenset(words.split("|")))

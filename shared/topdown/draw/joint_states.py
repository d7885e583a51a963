"""Two roles of a protocol walked together as if every message arrived at once: where they can be, what is said there.

Nothing crosses on the way, so what is found is what people draw; `fipa_codec.exploration` looks at all that may cross.
"""

from collections.abc import Container, Iterator, Mapping
from typing import NamedTuple

from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row

Place = tuple[str, str]
"""States of initiator and participant."""
Sayable = Mapping[Role, Container[Performative]]
"""The acts each role uses of those that its table has."""


class Edge(NamedTuple):
    """Messages that may be said in a place, the rows that say them, and the place after each."""

    sender: Role
    sent: Row
    taken: Row
    to: Place

    @property
    def interrupts(self) -> bool:
        """Said at will, and the main line is left."""
        return self.sent.free and self.sent.to != self.sent.state

    @property
    def said(self) -> tuple[Role, str]:
        """Return the sender and its words."""
        return self.sender, self.sent.word


Meeting = dict[Place, tuple[Edge, ...]]


def spoken(role: Role, row: Row, sayable: Sayable | None) -> bool:
    """Whether the act of a row is among those its speaker uses."""
    speaker = role if row.way is SEND else role.other
    return sayable is None or row.performative in sayable[speaker]


def meet(protocol: Protocol, sayable: Sayable | None = None) -> Meeting:
    """Every place both roles can reach if messages arrive at once, with what may be said there."""
    found: Meeting = {}
    waiting: list[Place] = [(START, START)]
    for place in waiting:
        found[place] = tuple(_edges(protocol, place, sayable))
        waiting += dict.fromkeys(e.to for e in found[place] if e.to not in waiting)
    return found


def _edges(protocol: Protocol, place: Place, sayable: Sayable | None) -> Iterator[Edge]:
    states = dict(zip((Role.INITIATOR, Role.PARTICIPANT), place, strict=True))
    for role, table in protocol.tables.items():
        peer = protocol.tables[role.other]
        if states[role.other] in peer.urgent:
            continue
        for sent in table.allowed(states[role], SEND):
            taken = peer.find(states[role.other], RECEIVE, sent.performative, sent.kind)
            if taken and spoken(role, sent, sayable):
                to = {role: str(sent.to), role.other: str(taken.to)}
                yield Edge(role, sent, taken, (to[Role.INITIATOR], to[Role.PARTICIPANT]))


def name_of(place: Place) -> str:
    """The states of both roles in words."""
    one, other = place
    return one if one == other else f"{one} / {other}"

"""A group as an end of channels in the composed model: it may say whatever the tables of its uses
allow, at any time.

Nobody of the design runs a group, so nothing is known of it but its tables and the acts that its
messages list. Its rows are made of these: what its peers say it takes, what it is asked it answers
sooner or later, by any word that the table has there; what it opens, calls off or observes is its
free choice, of which nobody may wait.
"""

from collections.abc import Iterator

from msgspec.structs import replace

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role
from fipa_codec.tables import Row as TableRow
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.model.machines import ProtocolAct

ANYTHING = "anything"
"""The one state of a group."""
SAYS, CHOOSES = "own says", "person there"
"""Events of its rows: what will happen if it matters, and what may happen."""


def groups(design: Design) -> tuple[str, ...]:
    """The groups at ends of uses of protocols. Raises DesignError for an end that is not a group
    either.
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
    return tuple(found)


def composed(design: Design) -> Design:
    """The design with an agent for each of its groups; the same one where none is at an end of a
    use.
    """
    made = [_agent(design, name) for name in groups(design)]
    if not made:
        return design
    file = replace(design.file, agent=(*design.file.agent, *made))
    return Design(file, design.path, design.text, design.folder)


def _agent(design: Design, group: str) -> elements.Agent:
    uses = [use for use in design.file.protocol if group in (use.initiator, use.participant)]
    tables = design.tables
    ends = [_End(use, group, tables[use.follows]) for use in uses if use.follows in tables]
    rows = (*(row for end in ends for row in end.rows()), *_renewals(ends))
    state = elements.State(ANYTHING, "chaos", "never", talks=tuple(end.use.name for end in ends))
    return elements.Agent(name=group, initial=ANYTHING, state=(state,), row=rows)


class _End:
    """A group's end of one use."""

    def __init__(self, use: elements.Protocol, group: str, protocol: Protocol) -> None:
        self.use, self.protocol = use, protocol
        self.role = Role.INITIATOR if use.initiator == group else Role.PARTICIPANT
        self.peer = use.participant if use.initiator == group else use.initiator
        self.table = protocol.tables[self.role]
        self.acts = {message.performative for message in use.message if message.sender == group}
        self.observed = use.latest and self.role is Role.PARTICIPANT
        self.subscribes = use.latest and self.role is Role.INITIATOR

    def rows(self) -> Iterator[elements.Row]:
        """All of this use: what is taken, said, and opened."""
        yield from self._taken()
        for said in dict.fromkeys(self._said()):
            free = said.act is Performative.CANCEL or self._opens(said)
            yield _row(CHOOSES if free else SAYS, said)
        for said in self.openings():
            yield _row(SAYS if self.subscribes else CHOOSES, said, when=(f"{self.use.name} none",))
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
            yield _row(str(heard), *said)

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

    def _may_say(self, row: TableRow) -> bool:
        """Whether its messages list the act; the answer to a cancel the runtime gives by itself."""
        return row.performative in self.acts or row.kind is Kind.CANCEL

    def _word(self, row: TableRow) -> ProtocolAct:
        return ProtocolAct(self.use.name, row.performative, row.kind)


def _renewals(ends: list[_End]) -> Iterator[elements.Row]:
    """A peer that came back is subscribed to once more, in each use, as the runtime does."""
    for peer in dict.fromkeys(end.peer for end in ends if end.subscribes):
        mine = [end for end in ends if end.subscribes and end.peer == peer]
        said = tuple(str(said) for end in mine for said in end.openings()[:1])
        dropped = tuple(end.use.name for end in mine)
        yield elements.Row(in_=(ANYTHING,), on=f"back {peer}", drop=dropped, say=said)


def _row(event: str, *said: ProtocolAct, when: tuple[str, ...] = ()) -> elements.Row:
    return elements.Row(in_=(ANYTHING,), on=event, say=tuple(map(str, said)), when=when)

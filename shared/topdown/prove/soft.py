"""A volatile use in the composed model: what of it may happen by itself, and to words on their way.

What may happen depends on the two ends and on what is on the way; it is worked out once and kept.
Asked again is only what nothing more is on the way of: other repetitions are copies, which count as
faults.
"""

from collections.abc import Iterator
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Role, Row, Table
from topdown.model import elements
from topdown.model.machines import ProtocolAct
from topdown.prove.local import Stray
from topdown.prove.parts import Net, Parts, Ready


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
            elif self.latest and said == self.news:
                yield from self._observed(ends, net)
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
        """An agent takes a word, or a copy of it; what nobody waits for is dropped."""
        found, name = self.parts.outcomes(number, local, said), self.parts.names[number]
        if isinstance(found, Stray):
            yield Turn(name, f"{said} is dropped", self._with(ends, net.taken(said)))
        elif isinstance(found, str):
            yield Turn(name, str(said), ends, wrong=found)
        for ready in found if isinstance(found, tuple) else ():
            yield Turn(name, ready.label, self._with(ends, net.taken(said)), number, ready)
            yield Turn(name, f"{ready.label} (a copy)", ends, number, ready, fault=True)

    def _observed(self, ends: Ends, net: Net) -> Iterator[Turn]:
        """The newest observation is taken, and nothing more is owed; or (a fault) its receipt is
        lost.
        """
        found = self.parts.outcomes(self.asker, ends.asker, self.news)
        name = self.parts.names[self.asker]
        if isinstance(found, Stray):
            yield Turn(name, f"{self.news} is dropped", self._with(ends, net.taken(self.news)))
        elif isinstance(found, str):
            yield Turn(name, str(self.news), ends, wrong=found)
        for ready in found if isinstance(found, tuple) else ():
            paid = ends._replace(server=self.parts.without_debt(self.server, ends.server, self.use))
            yield Turn(name, ready.label, self._with(paid, net.known(self.news)), self.asker, ready)
            lost, unpaid = f"{ready.label}; its receipt is lost", net.taken(self.news)
            yield Turn(name, lost, self._with(ends, unpaid), self.asker, ready, fault=True)

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

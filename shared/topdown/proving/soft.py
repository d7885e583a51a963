"""A volatile use in the composed model: what of it may happen by itself, and to words on their way.

Asked again is only what nothing more is on the way of: other repetitions are copies, which count as faults.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Role
from topdown import elements
from topdown.machines import Said
from topdown.proving.nets import Net

if TYPE_CHECKING:
    from topdown.proving.fleet import Flat, Fleet, Ready


Found = Any
"""As in fleet.py: a plain tuple of engine.Move's five fields."""


class Soft:
    """One volatile use; `slot` is its place in a state."""

    def __init__(self, fleet: "Fleet", slot: int, use: elements.Protocol) -> None:
        self.fleet, self.slot, self.use, self.latest = fleet, slot, use.name, use.latest
        self.initiator, self.participant = fleet.place[use.initiator], fleet.place[use.participant]
        tables = fleet.agents[self.initiator].machine.uses[use.name].protocol.tables
        asker, server = tables[Role.INITIATOR], tables[Role.PARTICIPANT]
        said = {message.performative for message in use.message}
        self.openings = {
            str(row.to): self._said(row.performative, row.kind)
            for row in asker.allowed(START, SEND)
            if row.performative in said
        }
        self.outward = {self._said(row.performative, row.kind) for row in asker if row.way is SEND}
        self.unanswered = {str(row.to) for row in server.allowed(START, RECEIVE)}
        self.resting = server.resting
        self.answers = {
            str(row.to): self._said(row.performative, row.kind)
            for state in self.unanswered
            for row in reversed(server.allowed(state, SEND))
        }
        self.news = self._said(Performative.INFORM)

    def _said(self, act: Performative, kind: Kind = Kind.PLAIN) -> Said:
        return Said(self.use, act, kind)

    def at_rest(self, state: "Flat") -> bool:
        """Nothing on its way; a subscription is live, and its newest observation known."""
        net = self.fleet.net(state, self.slot)
        live = bool(self._talk(state, self.initiator)) and net.current
        return not net.words and not net.stale and (live or not self.latest)

    def moves(self, state: "Flat", faulty: bool) -> Iterator[Found]:
        """All that can happen in this use."""
        net = self.fleet.net(state, self.slot)
        for said in net.words:
            yield from self._taken(state, net, said, faulty)
        yield from self.by_itself(state, net)
        if faulty and self.fleet.faults.losses:
            yield from self._losses(state, net)

    def _talk(self, state: "Flat", number: int) -> str:
        return self.fleet.agents[number].talk(self.fleet.local(state, number), self.use)

    def _name(self, number: int) -> str:
        return self.fleet.names[number]

    # --- taken --------------------------------------------------------------------------------------------------------

    def _taken(self, state: "Flat", net: Net, said: Said, faulty: bool) -> Iterator[Found]:
        number = self.participant if said in self.outward else self.initiator
        opening = said in self.openings.values()
        if opening and self._talk(state, number) and net.current:
            yield self._repeated(state, net, said)
            return
        asked = self._without_talk(state, number) if opening else state
        found = self.fleet.heard(asked, number, said)
        if self.latest and said == self.news:
            yield from self._observed(state, net, found, faulty)
            return
        if found is None:
            return
        if isinstance(found, str):
            there = self.fleet.with_net(state, self.slot, net.taken(said))
            yield self._name(number), f"{said} is dropped", there, True, False
            return
        for copy in (False, True) if faulty and self.fleet.faults.copies else (False,):
            after = net.taken(said, copy=copy)
            after = after.accepted() if opening else after
            for ready in found:
                yield self.fleet.from_net(asked, self.slot, after, number, ready, fault=copy)

    def _observed(
        self, state: "Flat", net: Net, found: "tuple[Ready, ...] | str | None", faulty: bool
    ) -> Iterator[Found]:
        """The newest observation is taken, and nothing more is owed; or (a fault) its receipt is lost."""
        if found is None or isinstance(found, str):
            return
        for lost in (False, True) if faulty and self.fleet.faults.losses else (False,):
            before = state if lost else self.fleet.without_debt(state, self.participant, self.use)
            after = net.taken(self.news) if lost else net.known(self.news)
            for ready in found:
                yield self.fleet.from_net(before, self.slot, after, self.initiator, ready, fault=lost)

    def _without_talk(self, state: "Flat", number: int) -> "Flat":
        """An opening of a newer question takes the place of an older conversation."""
        return self.fleet.without_talk(state, number, self.use)

    def _repeated(self, state: "Flat", net: Net, said: Said) -> Found:
        """The same question once more: the answer once more, if it was given."""
        answer = self.answers.get(self._talk(state, self.participant))
        after = net.taken(said)
        after = after.added(answer) if answer is not None else after
        return (
            self._name(self.participant),
            f"{said}: asked again",
            self.fleet.with_net(state, self.slot, after),
            True,
            False,
        )

    # --- by itself ----------------------------------------------------------------------------------------------------

    def by_itself(self, state: "Flat", net: Net) -> Iterator[Found]:
        opening = self.openings.get(self._talk(state, self.initiator))
        served = self._talk(state, self.participant)
        if opening is not None and not net.words and not (net.current and served in self.unanswered):
            there = self.fleet.with_net(state, self.slot, net.added(opening))
            yield self._name(self.initiator), f"{opening} -> {self._name(self.participant)}, again", there, True, False
        if not self.latest:
            return
        owed = self.use in self.fleet.local(state, self.participant).owed
        if owed and net.current and served in self.resting and self.news not in net.words:
            there = self.fleet.with_net(state, self.slot, net.added(self.news))
            yield (
                self._name(self.participant),
                f"{self.news} -> {self._name(self.initiator)}, again",
                there,
                True,
                False,
            )

    def _losses(self, state: "Flat", net: Net) -> Iterator[Found]:
        for said in net.words:
            there = self.fleet.with_net(state, self.slot, net.taken(said), fault=True)
            yield "net", f"{said} is lost", there, False, True

"""The composed system as tables for the explorer in C: the same moves in the same order as
fleet.Fleet has them, each by the few slots it depends on.
"""

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from topdown.model.machines import NONE, ProtocolAct
from topdown.prove.flat import NOTHING, Case, Do, Has, If, Move, Reads, Row, Site, Step, Tables
from topdown.prove.local import GONE
from topdown.prove.parts import IN, OWES, OWN, RESTART, SAY, Ready, While

if TYPE_CHECKING:
    from topdown.prove.fleet import Fleet, Soft, Turn


class FleetTables(Tables):
    """Of a fleet."""

    def __init__(self, fleet: "Fleet", start: tuple[int, ...]) -> None:
        self.fleet, self.parts = fleet, fleet.parts
        self.row_of = {row: number for number, row in enumerate(fleet.rows)}
        super().__init__(start, len(start) - 1, len(self.row_of))
        count, parts = range(fleet.count), self.parts
        self.sites += [Site((number,), partial(self._own, number)) for number in count]
        self.sites += [
            Site((slot, number), partial(self._taken, slot, number), reads)
            for slot, number in fleet.inbound
            for reads in (Reads.IF_FILLED | Reads.MAY_BE_WRONG,)
        ]
        self.sites += [
            Site((soft.asker, soft.server, soft.slot), partial(self._soft, soft))
            for soft in fleet.soft
        ]
        self.sites += [
            Site((number,), partial(self._dies, number), Reads.IF_FAULTS) for number in count
        ]
        if fleet.faults.gone:
            number = parts.place[fleet.faults.gone]
            self.sites.append(Site((number,), partial(self._goes, number)))
        self.rest.append(Case(tuple(self._rest())))

    # --- rest -------------------------------------------------------------------------------------

    def _rest(self) -> Iterator[If]:
        """Fleet.at_rest, slot by slot."""
        fleet, gone = self.fleet, self.fleet.faults.gone
        for number in fleet.waiting if gone else fleet.resting:
            yield self.condition(number, ("rest", number), partial(self.parts.resting, number))
        if gone:
            return
        for slot, _ in fleet.inbound:
            yield self.condition(slot, "empty", lambda words: words == 0)
        for soft in fleet.soft:
            yield self.condition(
                soft.slot, ("quiet", soft.latest), partial(self._quiet, soft.latest)
            )
            if soft.latest:
                talks = partial(self._talks, soft.asker, soft.use)
                yield self.condition(soft.asker, ("talks", soft.asker, soft.use), talks)

    def _quiet(self, latest: bool, number: int) -> bool:
        net = self.parts.net(number)
        return not net.words and not net.stale and (net.current or not latest)

    def _talks(self, number: int, use: str, local: int) -> bool:
        return bool(self.parts.talk(number, local, use))

    # --- rows -------------------------------------------------------------------------------------

    def _own(self, number: int, local: int) -> Row:
        found = self.parts.unasked(number, local, OWN)
        return Row(tuple(self._unasked(number, ready) for ready in found))

    def _unasked(self, number: int, ready: Ready) -> Move:
        """Waits are over as faults; or, with an agent that dies for good, once it has."""
        if not ready.late:
            return self._move(number, ready)
        if not self.fleet.faults.gone:
            move = self._move(number, ready)
            return move._replace(has=move.has | Has.IF_FAULTS)
        slot = self.parts.place[self.fleet.faults.gone]
        is_gone = self.function((IN, slot, GONE), partial(self._is_in, slot, (GONE,)))
        steps = (Step(Do.ONLY_IF, slot, is_gone), *self._after(number, ready))
        return Move(Has.FAIR | self._held(number), steps)

    def _move(self, number: int, ready: Ready) -> Move:
        fair = Has.FAIR if ready.fair else Has(0)
        fault = Has.FAULT | Has.PAYS if ready.fault else Has(0)
        return Move(fair | fault | self._held(number), tuple(self._after(number, ready)))

    def _taken(self, slot: int, number: int, words: int, local: int) -> Row:
        waiting = self.parts.queues.values[words]
        found = self.parts.outcomes(number, local, waiting[0])
        if not isinstance(found, tuple):
            return Row() if found is None else Row(wrong=self.text(found))
        rest = Step(Do.SET, slot, self.parts.queues(waiting[1:]))
        has = Has.FAIR | self._held(number)
        return Row(tuple(Move(has, (rest, *self._after(number, ready))) for ready in found))

    def _soft(self, soft: "Soft", *ends: int) -> Row:
        turns = soft.turns_between(*ends)
        return Row(tuple(move for turn in turns for move in self._turned(soft, turn)))

    def _turned(self, soft: "Soft", turn: "Turn") -> Iterator[Move]:
        if turn.wrong:
            yield Move(Has.FAIR, (Step(Do.IS_BAD, self.text(turn.wrong)),))
            return
        slots = (soft.asker, soft.server, soft.slot)
        steps = [Step(Do.SET, *pair) for pair in zip(slots, turn.ends, strict=True)]
        after = self._after(turn.number, turn.ready) if turn.ready is not None else ()
        has = Has.FAULT | Has.PAYS | Has.IF_FAULTS if turn.fault else Has.FAIR
        yield Move(has | self._held(self.parts.place.get(turn.who)), (*steps, *after))

    def _dies(self, number: int, local: int) -> Row:
        parts = self.parts
        if parts.local(number, local).state == GONE:
            return Row()
        name = parts.names[number]
        news = [
            Step(Do.MAP, other, self.function(("news", other, name), call))
            for other in range(self.fleet.count)
            for call in (lambda local, other=other: parts.with_news(other, local, name),)
        ]
        has = Has.FAULT | Has.PAYS | Has.IF_CHANGED | self._held(number)
        return Row(
            tuple(
                Move(has, (*self._after(number, ready), *news))
                for ready in parts.unasked(number, local, RESTART)
            )
        )

    def _goes(self, number: int, local: int) -> Row:
        if self.parts.local(number, local).state == GONE:
            return Row()
        (ready,) = self.parts.unasked(number, local, GONE)
        return Row((Move(Has.FAULT | self._held(number), tuple(self._after(number, ready))),))

    def _held(self, number: int | None) -> Has:
        """A group says nothing while a queue of its is full."""
        groups = number is not None and self.parts.names[number] in self.fleet.groups
        return Has.IF_ROOM if groups else Has(0)

    # --- after a move -----------------------------------------------------------------------------

    def _after(self, number: int, ready: Ready) -> Iterator[Step | If]:
        """Fleet._after, as steps."""
        if ready.again:
            yield Step(Do.IS_BAD, self.text(self.fleet.twice(number, ready)))
            return
        for effect in ready.happened:
            yield self._effect(*effect)
        for rule in ready.rules:
            whiles = [one for condition in rule.whiles for one in self._while(condition)]
            yield Step(Do.NEVER, self.text(self.fleet.broken(rule)), len(whiles))
            yield from whiles
        yield Step(Do.TAKEN, self.row_of[self.parts.names[number], ready.row])
        yield Step(Do.SET, number, ready.there)
        for effect in ready.effects:
            yield self._effect(*effect)

    def _effect(self, slot: int, kind: int, said: ProtocolAct | None) -> Step:
        call = partial(self._said, said) if kind == SAY else partial(self._net, kind, said)
        return Step(Do.MAP, slot, self.function((kind, said), call))

    def _said(self, said: Any, waiting: int) -> int:
        words = (*self.parts.queues.values[waiting], said)
        overfull = self.fleet.overfull(words)
        return self.bad(overfull) if overfull else self.parts.queues(words)

    def _net(self, kind: int, said: Any, net: int) -> int:
        return self.parts.net_after(net, kind, said)

    def _while(self, condition: While) -> Iterator[If]:
        """While.holds, slot by slot: of news owed in several uses one is enough."""
        number, what, words = condition
        if what == OWES:
            for alternative, use in enumerate(sorted(words)):
                owed = self.condition(self.parts.net_of[use], "stale", self._stale)
                yield owed._replace(begins=not alternative)
            return
        holds = partial(self._is_in, number) if what == IN else partial(self._talk_in, number, what)
        yield self.condition(number, (what, number, words), partial(holds, words))

    def _stale(self, net: int) -> bool:
        return self.parts.net(net).stale

    def _is_in(self, number: int, states: Any, local: int) -> bool:
        return self.parts.local(number, local).state in states

    def _talk_in(self, number: int, use: str, states: Any, local: int) -> bool:
        return (self.parts.talk(number, local, use) or NONE) in states


def flat(state: tuple[int, ...]) -> tuple[int, ...]:
    """A state of a fleet, in which any number of faults is -1, as numbers from 0 on."""
    return (*state[:-1], state[-1] if state[-1] >= 0 else NOTHING)


def state_of(numbers: tuple[int, ...]) -> tuple[int, ...]:
    """The other way."""
    return (*numbers[:-1], numbers[-1] if numbers[-1] != NOTHING else -1)

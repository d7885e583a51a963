"""Layer 1: one durable numbered stream in micro-steps, under any number of faults, right and in
naive variants.

A sender issues a few messages, a receiver takes them. A step is: run, one synced record, then
receipt and sends; the journal of the sender has the counter and the outbox, that of the receiver
the last number taken together with its effect. Unreceipted messages are sent again; a number below
the expected one is receipted again, one above it dropped. Faults: loss, duplication and reordering
of copies and receipts, death of either side between any two micro-steps. Numbers are compared with
last + 1 only, so a few messages stand for any number (argued, not proved).
"""

from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple

from topdown.prove.engine import Exploration, Move, explore

SENDER, RECEIVER, WIRE = "sender", "receiver", "wire"


class Variant(StrEnum):
    """The scheme, and what one might have built instead."""

    RIGHT = "as designed"
    RECEIPT_FIRST = "receipt before the record"
    SEND_FIRST = "send before the record"
    OUTBOX_IN_RAM = "outbox not in the record"
    NO_RESENDING = "record, but no re-sending"
    COUNTER_IN_RAM = "counter in RAM, no incarnation"
    LAST_IN_RAM = "last number in RAM"
    MARK_THEN_EFFECT = "two records, the mark first"
    EFFECT_THEN_MARK = "two records, the effect first"
    ANY_ORDER = "a set of ids, taken in any order"


class Phase(StrEnum):
    """Phase of a side within its step."""

    IDLE = "idle"
    RUN = "has run"
    HALF = "between its two records"
    SAID = "has said it, not recorded"
    RECORDED = "has recorded"


class Place(NamedTuple):
    """State of the whole. In RAM: `phase`, `issued`, `low` (receipted up to), `counter` (last
    number given); `taking`, `now` (message in work), `last`. On disk: `kept` (issued), `kept_low`;
    `mark` (last number), `effects` (messages worked on, in order). On the way: `copies` of
    messages, `receipts`.
    """

    phase: Phase = Phase.IDLE
    issued: int = 0
    low: int = 0
    counter: int = 0
    kept: int = 0
    kept_low: int = 0
    taking: Phase = Phase.IDLE
    now: int = 0
    last: int = 0
    mark: int = 0
    effects: tuple[int, ...] = ()
    copies: tuple[int, ...] = ()
    receipts: tuple[int, ...] = ()


class Stream:
    """`messages` are issued, at most `copies` of them and as many receipts are on their way at a
    time; `fifo`: copies arrive in the order in which they were sent.
    """

    def __init__(
        self,
        variant: Variant = Variant.RIGHT,
        *,
        messages: int = 3,
        copies: int = 2,
        fifo: bool = False,
    ) -> None:
        self.variant, self.messages, self.copies, self.fifo = variant, messages, copies, fifo
        self.start = Place()

    def moves(self, state: Place) -> Iterator[Move]:
        """Of the sender, the receiver and the wire, then the deaths."""
        yield from self._sender(state)
        yield from self._receiver(state)
        yield from self._wire(state)
        low = state.kept if self.variant is Variant.OUTBOX_IN_RAM else state.kept_low
        counter = 0 if self.variant is Variant.COUNTER_IN_RAM else state.kept
        restored = state._replace(phase=Phase.IDLE, issued=state.kept, low=low, counter=counter)
        yield Move(SENDER, "dies and is restored", restored, fault=True)
        last = 0 if self.variant is Variant.LAST_IN_RAM else state.mark
        restored = state._replace(taking=Phase.IDLE, now=0, last=last)
        yield Move(RECEIVER, "dies and is restored", restored, fault=True)

    def at_rest(self, state: Place) -> bool:
        """All issued, taken and receipted, nothing on the way."""
        idle = state.phase is state.taking is Phase.IDLE and not (state.copies or state.receipts)
        return idle and state.low == state.issued == self.messages == state.mark

    def wrong(self, state: Place) -> str:
        """Doubled, out of order, lost, taken though never decided, or two messages under one
        number.
        """
        effects = state.effects
        if len(set(effects)) < len(effects):
            return f"message {effects[-1]} was worked on twice"
        if effects != tuple(range(1, len(effects) + 1)):
            return f"message {effects[-1]} was taken before the one it follows"
        if len(effects) > state.kept:
            unknown = "was taken, and its sender's journal knows of no such decision"
            return f"message {effects[-1]} {unknown}"
        if state.counter != state.issued and state.phase is not Phase.IDLE:
            again = f"goes out under number {state.counter}, which was given before"
            return f"message {state.issued} {again}"
        lost = [number for number in range(1, state.kept + 1) if self._lost(state, number)]
        where = "is lost: in no outbox and not on the way, or thought taken"
        return f"message {lost[0]} {where}" if lost else ""

    def describe(self, state: Place) -> dict[str, str]:
        """RAM and disk of both sides, and what is on its way."""
        outbox = ",".join(map(str, range(state.low + 1, state.issued + 1)))
        kept = ",".join(map(str, range(state.kept_low + 1, state.kept + 1)))
        done = ",".join(map(str, state.effects))
        wire = [*map(str, state.copies), *(f"receipt {number}" for number in state.receipts)]
        return {
            SENDER: f"{state.phase}; outbox {outbox or 'empty'}; on disk {kept or 'none'}",
            WIRE: ", ".join(wire) or "empty",
            RECEIVER: (
                f"{state.taking}; last {state.last}; on disk {state.mark}, done {done or 'none'}"
            ),
        }

    # --- the sender -------------------------------------------------------------------------------

    def _sender(self, state: Place) -> Iterator[Move]:
        sends_first = self.variant is Variant.SEND_FIRST
        match state.phase:
            case Phase.IDLE:
                yield from self._idle_sender(state)
            case Phase.RUN if sends_first:
                yield self._sent(state, state.counter, Phase.SAID)
            case Phase.RUN | Phase.SAID:
                after = Phase.IDLE if sends_first else Phase.RECORDED
                kept = state._replace(phase=after, kept=state.issued, kept_low=state.low)
                yield Move(SENDER, "record", kept)
            case Phase.RECORDED:
                yield self._sent(state, state.counter, Phase.IDLE)

    def _idle_sender(self, state: Place) -> Iterator[Move]:
        if state.issued < self.messages:
            issued, counter = state.issued + 1, state.counter + 1
            run = state._replace(phase=Phase.RUN, issued=issued, counter=counter)
            yield Move(SENDER, f"issue {issued}", run)
        if self.variant is not Variant.NO_RESENDING:
            for number in range(state.low + 1, state.issued + 1):
                if len(state.copies) < self.copies:
                    yield self._sent(state, number, Phase.IDLE, "send again")
        for receipt in state.receipts:
            left = _less(state.receipts, receipt)
            after = state._replace(low=max(state.low, receipt), receipts=left)
            yield Move(SENDER, f"receipt {receipt} <- {RECEIVER}", after)

    def _sent(self, state: Place, number: int, phase: Phase, verb: str = "send") -> Move:
        """Put a copy on the wire; where there is no room it is lost at once."""
        room = len(state.copies) < self.copies
        copies = self._with(state, number) if room else state.copies
        after = state._replace(phase=phase, copies=copies)
        return Move(SENDER, f"{verb} {number} -> {RECEIVER}", after)

    def _with(self, state: Place, number: int) -> tuple[int, ...]:
        copies = (*state.copies, number)
        return copies if self.fifo else tuple(sorted(copies))

    # --- the receiver -----------------------------------------------------------------------------

    def _receiver(self, state: Place) -> Iterator[Move]:
        match state.taking:
            case Phase.IDLE:
                yield from self._take(state)
            case Phase.RUN if self.variant is Variant.RECEIPT_FIRST:
                yield self._receipted(state, Phase.SAID)
            case Phase.RECORDED:
                yield self._receipted(state, Phase.IDLE)
            case _:
                yield self._recorded(state)

    def _take(self, state: Place) -> Iterator[Move]:
        any_order = self.variant is Variant.ANY_ORDER
        for number in state.copies[:1] if self.fifo else dict.fromkeys(state.copies):
            rest, verb = state._replace(copies=_less(state.copies, number)), f"{number} <- {SENDER}"
            if number not in state.effects if any_order else number == state.last + 1:
                taken = rest._replace(taking=Phase.RUN, now=number, last=number)
                yield Move(RECEIVER, f"take {verb}", taken)
            elif number <= state.last or any_order:
                yield Move(RECEIVER, f"had {verb}", rest._replace(taking=Phase.RECORDED))
            else:
                yield Move(RECEIVER, f"too early, drop {verb}", rest)

    def _recorded(self, state: Place) -> Move:
        half, mark = state._replace(taking=Phase.HALF), state.last
        effects = (*state.effects, state.now)
        match self.variant, state.taking:
            case Variant.MARK_THEN_EFFECT, Phase.RUN:
                return Move(RECEIVER, "record the mark", half._replace(mark=mark))
            case Variant.EFFECT_THEN_MARK, Phase.RUN:
                return Move(RECEIVER, "record the effect", half._replace(effects=effects))
            case Variant.EFFECT_THEN_MARK, Phase.HALF:
                after = state._replace(taking=Phase.RECORDED, mark=mark, now=0)
                return Move(RECEIVER, "record the mark", after)
        taking = Phase.IDLE if state.taking is Phase.SAID else Phase.RECORDED
        both = state._replace(taking=taking, mark=mark, effects=effects, now=0)
        return Move(RECEIVER, "record", both)

    def _receipted(self, state: Place, after: Phase) -> Move:
        receipts = tuple(sorted({*state.receipts, state.last}))
        receipts = receipts if len(receipts) <= self.copies else state.receipts
        there = state._replace(taking=after, receipts=receipts)
        return Move(RECEIVER, f"receipt {state.last} -> {SENDER}", there, True)

    # --- the wire ---------------------------------------------------------------------------------

    def _wire(self, state: Place) -> Iterator[Move]:
        for number in dict.fromkeys(state.copies):
            lost = state._replace(copies=_less(state.copies, number))
            yield Move(WIRE, f"loses {number}", lost, fault=True)
            if len(state.copies) < self.copies:
                twice = state._replace(copies=self._with(state, number))
                yield Move(WIRE, f"doubles {number}", twice, fault=True)
        for receipt in state.receipts:
            lost = state._replace(receipts=_less(state.receipts, receipt))
            yield Move(WIRE, f"loses receipt {receipt}", lost, fault=True)
            late = state._replace(low=max(state.low, receipt))
            if state.phase is Phase.IDLE and late != state:
                yield Move(WIRE, f"delivers receipt {receipt} and keeps a copy", late, fault=True)

    def _lost(self, state: Place, number: int) -> bool:
        """In the journal of its sender as issued, not worked on, and nobody will send it or take it
        any more.
        """
        if number in state.effects or number == state.now:
            return False
        marked = number <= state.mark and self.variant is not Variant.ANY_ORDER
        return marked or not (state.low < number or number in state.copies)


def _less(items: tuple[int, ...], item: int) -> tuple[int, ...]:
    place = items.index(item)
    return items[:place] + items[place + 1 :]


def explore_stream(
    variant: Variant = Variant.RIGHT, *, messages: int = 3, copies: int = 2, fifo: bool = False
) -> Exploration:
    """Everything that can happen on a stream; where something is wrong, the shortest way there
    first.
    """
    return explore(
        Stream(variant, messages=messages, copies=copies, fifo=fifo), first=variant is Variant.RIGHT
    )

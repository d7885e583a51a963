"""The running `Core.step` itself, of two toy agents, in everything a wire and deaths can do to a
few messages.

States are whole agents with their journals and what is on its way. What grows and decides nothing
is made canonical: times (a step happens at 0, a tick 1 s later, and clocks are set back), step
counters, counts, incarnations.
"""

from typing import Any, NamedTuple

import msgspec
import pytest
from driven import message
from toy_agents import Double, Doubled, asker, server, wirings

from agent_runtime.core import reception, streams
from agent_runtime.core.errors import BehaviourError
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Effects,
    LogLine,
    Next,
    Receipt,
    Receipted,
    Received,
    Started,
    Tick,
)
from agent_runtime.core.state import CoreState, Soft, restored
from agent_runtime.core.step import Core
from agent_runtime.core.streams import preceding, receipted
from fipa_codec.communicate import encode
from fipa_codec.performatives import Performative
from topdown.prove.engine import UNREACHED, WRONG, Exploration, Move, explore

pytestmark = pytest.mark.timeout(300)

WANTED = (1, 2)
ASKER, SERVER = 0, 1
NAMES = ("asker", "server")
JOURNALS = ("a", "s")
STOLEN = 9
"""The number that a thief wants doubled."""
LATER = 1.0
"""A tick is this much after its step [s]: all that is to be sent again is due, reply-by (5 s) is
not.
"""


class Side(NamedTuple):
    """An agent: numbers of its state and its journal; it has more to take; it wants a tick;
    something was out of sequence.
    """

    state: int
    journal: int
    more: bool
    tick: bool
    stray: str = ""


class Place(NamedTuple):
    """Both agents, and what is on its way: (to whom, number of the event), sorted; a set, since
    copies are alike.

    `thefts`: words that a thief may still say in the asker's name.
    """

    sides: tuple[Side, Side]
    way: tuple[tuple[int, int], ...] = ()
    thefts: int = 0


Stepped = tuple[int, int, Effects, list[tuple[int, int]]]
"""Numbers of the state after a step and of its record (0: none), the effects, and what they put on
the way.
"""


class Running:
    """The model: each distinct state, journal and event has a number, and each step is computed
    once.

    `room`: messages and receipts on their way to one agent at a time. `thefts`: how many words a
    thief says in the name of `thief`, each under whatever number of the first ones.
    """

    def __init__(
        self, wanted: tuple[int, ...] = WANTED, room: int = 2, thefts: int = 0, thief: int = ASKER
    ) -> None:
        self.wanted, self.room = wanted, room
        self.thief = thefts > 0
        self.cores: tuple[Core[Any], Core[Any]] = tuple(
            Core(agent, wiring)
            for agent, wiring in zip((asker(*wanted), server()), wirings(), strict=True)
        )
        self.things: list[Any] = [None]
        self.numbers: dict[Any, int] = {None: 0}
        self.taken: dict[tuple[int, int], int] = {}
        self.steps: dict[Any, Stepped] = {}
        one, other = (Side(0, self._first(who), False, False) for who in (ASKER, SERVER))
        place = Place((one, other), thefts=thefts)
        self.stolen = [
            (1 - thief, self._number(("stolen", number), stolen(thief, number)))
            for number in range(1, 2 + thefts)
        ]
        for who in (ASKER, SERVER):
            place = self._restored(place, who)
        self.start = place

    def _first(self, who: int) -> int:
        """The number of the record an agent begins with: it knows the other one's journal."""
        core = self.cores[who]
        record = restored(core.agent, core.first(JOURNALS[who]))
        record.journals = {NAMES[1 - who]: JOURNALS[1 - who]}
        return self._number(("first", who), core.record(record))

    # --- steps ------------------------------------------------------------------------------------

    def _number(self, key: Any, thing: Any) -> int:
        if key not in self.numbers:
            self.numbers[key] = len(self.things)
            self.things.append(thing)
        return self.numbers[key]

    def _step(self, who: int, state: int, event: AnyEvent) -> "Stepped":
        """The step, computed once."""
        # those of `things` live on
        key = (who, state, id(event) if isinstance(event, Arrived) else event)
        if key not in self.steps:
            now = LATER if isinstance(event, Tick) else 0.0
            try:
                after, effects = self.cores[who].step(self.things[state], event, now)
            except BehaviourError as error:
                after = self.things[state]
                effects = Effects(logs=(LogLine(str(error), {}, "error"),))
            after = canonical(after)
            record, soft = self.cores[who].record(after), after.soft
            kept = [soft.inbox, soft.resend, soft.conversations, soft.over]
            number = self._number((who, record, msgspec.msgpack.encode(kept)), after)
            said = (*effects.receipts, *effects.sends)
            outputs = [self._on_way(1 - who, output, after) for output in said]
            written = self._number(record, record) if effects.record else 0
            self.steps[key] = (number, written, effects, outputs)
        return self.steps[key]

    def _after(self, place: Place, who: int, event: AnyEvent, *, said: int | None = None) -> Place:
        """The place after a step whose record is on disk, and of whose outputs only the first
        `said` went out.
        """
        old = place.sides[who]
        state, record, effects, outputs = self._step(who, old.state, event)
        stray = out_of_order(self.things[old.state], effects, thief=self.thief)
        side = Side(state, record or old.journal, effects.more, effects.wake_at is not None, stray)
        way = crowded(place.way, outputs[:said], self.room)
        return placed(place, who, side)._replace(way=way)

    def _on_way(self, to: int, output: Any, state: CoreState) -> tuple[int, int]:
        names = JOURNALS[1 - to], JOURNALS[to]
        if isinstance(output, Receipt):
            came = receipted(NAMES[1 - to], output, *names)
            return to, self._number(("receipt", to, output), came)
        behind = preceding(state, output)
        return to, self._number((encode(output), behind), Arrived(output, *names, *behind))

    def _restored(self, place: Place, who: int) -> Place:
        journal = self.things[place.sides[who].journal]
        state = canonical(self.cores[who].boot(journal))
        number = self._number((who, "boot", self.cores[who].record(state)), state)
        side = Side(number, place.sides[who].journal, False, False)
        first = place.sides[who].journal == self.numbers["first", who]
        return self._after(placed(place, who, side), who, Started(first=first))

    # --- the model --------------------------------------------------------------------------------

    def moves(self, place: Place) -> Any:
        """Return all next events: arrivals, time, and deaths; an agent that has more to take does
        that first.
        """
        for who, side in enumerate(place.sides):
            if side.more:
                yield from self._happens(place, who, Next(), "takes the next one")
            elif side.tick:
                yield from self._happens(place, who, Tick(), "time passes")
            yield Move(NAMES[who], "dies and is restored", self._restored(place, who), fault=True)
        for one in self.stolen if place.thefts else ():
            said = place._replace(way=crowded(place.way, [one], self.room), thefts=place.thefts - 1)
            yield Move("thief", f"says {words(self.things[one[1]])}", said, fault=True)
        for one in place.way:
            to, event = one[0], self.things[one[1]]
            gone = place._replace(way=tuple(other for other in place.way if other != one))
            yield Move("wire", f"loses {words(event)}", gone, fault=True)
            if not place.sides[to].more:
                yield from self._happens(gone, to, event, f"{words(event)} <- {NAMES[1 - to]}")
                kept = self._after(place, to, event)
                yield Move("wire", f"gives {words(event)} and keeps a copy", kept, fault=True)

    def _happens(self, place: Place, who: int, event: AnyEvent, what: str) -> Any:
        """The step, and the step with a death after its record and some of its outputs."""
        yield Move(NAMES[who], what, self._after(place, who, event))
        effects = self._step(who, place.sides[who].state, event)[2]
        if effects.record is not None:
            for said in range(len(effects.receipts) + len(effects.sends)):
                dead = self._restored(self._after(place, who, event, said=said), who)
                dies = f"{what}, dies after {said} outputs and is restored"
                yield Move(NAMES[who], dies, dead, fault=True)

    def at_rest(self, place: Place) -> bool:
        """All answered, nothing kept to be sent again, nothing on its way."""
        states = [self.things[side.state] for side in place.sides]
        busy = any(side.more for side in place.sides) or any(state.outbox for state in states)
        answered = len(states[ASKER].memory.answers) == len(self.wanted)
        return answered and not place.way and not busy

    def wrong(self, place: Place) -> str:
        """Effects once and in order; receipts for what is journalled only; nothing out of
        sequence.
        """
        asking, serving = (self.things[side.state].memory for side in place.sides)
        done = tuple(one for one in serving.done if one != STOLEN)
        if done != self.wanted[: len(done)]:
            return f"the server worked on {serving.done}"
        if asking.answers != tuple((n, 2 * n) for n in self.wanted)[: len(asking.answers)]:
            return f"the asker was answered {asking.answers}"
        for to, number in place.way:
            event = self.things[number]
            if isinstance(event, Receipted) and event.taken > self._journalled(place, 1 - to):
                return f"{NAMES[1 - to]} receipted {event.taken}, and has not journalled it"
        strays = zip(NAMES, (side.stray for side in place.sides), strict=True)
        return ", ".join(f"{name}: {stray}" for name, stray in strays if stray)

    def _journalled(self, place: Place, who: int) -> int:
        number = place.sides[who].journal
        if (who, number) not in self.taken:
            taken = restored(self.cores[who].agent, self.things[number]).taken if number else {}
            self.taken[who, number] = taken.get(NAMES[1 - who], 0)
        return self.taken[who, number]

    def describe(self, place: Place) -> dict[str, str]:
        """State and memory of both."""
        states = [self.things[side.state] for side in place.sides]
        return {
            name: f"{state.state} {state.memory}" for name, state in zip(NAMES, states, strict=True)
        }


def placed(place: Place, who: int, side: Side) -> Place:
    """The place with another state of one agent."""
    asker, server = place.sides
    return place._replace(sides=(side, server) if who == ASKER else (asker, side))


def crowded(
    way: tuple[tuple[int, int], ...], outputs: list[tuple[int, int]], room: int
) -> tuple[tuple[int, int], ...]:
    """Return the words on their way with these outputs: those beyond the room are lost."""
    found = set(way)
    for output in outputs:
        if sum(to == output[0] for to, _ in found) < room:
            found.add(output)
    return tuple(sorted(found))


def canonical(state: CoreState) -> CoreState:
    """Without what only counts or tells the time."""
    state = state.fork()
    state.incarnation, state.counts = 1, {}
    state.wakes = dict.fromkeys(state.wakes, 0.1)
    resend = dict.fromkeys(state.soft.resend, (streams.RESEND_FIRST, streams.RESEND_FIRST))
    state.soft = msgspec.structs.replace(state.soft, step=0, peers={}, resend=resend)
    return state


def stolen(who: int, number: int) -> Arrived:
    """A thief's word in an agent's name, under this number."""
    asks = (Performative.REQUEST, Double(STOLEN)), (Performative.INFORM, Doubled(STOLEN))
    act, content = asks[who]
    labels = {"conversation": f"thief-{number}", "id": str(number), "reply_with": str(number)}
    said = message(act, f"{NAMES[who]}>{NAMES[1 - who]}", "request", content, **labels)
    return Arrived(said, JOURNALS[who], JOURNALS[1 - who])


def out_of_order(before: CoreState, effects: Effects, *, thief: bool) -> str:
    """Return in words the part of a step that breaks the order of a stream; beside a thief's words
    numbers may be left out.
    """
    handled = effects.handled
    if isinstance(handled, Received) and not thief:
        expected = before.taken.get(handled.communicate.sender, 0) + 1
        if int(handled.communicate.id) != expected:
            return f"took {handled.communicate.id}, expected {expected}"
    bad = [line for line in effects.logs if line.level in ("warning", "error")]
    return "".join(line.event for line in bad if not (thief and of_a_thief(line)))


def of_a_thief(line: LogLine) -> bool:
    """Whether a line tells of a thief, or of what only the thief said."""
    talk = str(line.fields.get("conversation"))
    return line.event == "another speaker" or talk.startswith("thief")


def words(event: Any) -> str:
    """An event on its way."""
    if isinstance(event, Receipted):
        refused = f", {event.refused.hex()} refused" if event.refused else ""
        return f"receipt {event.taken}{refused}"
    return f"{event.communicate.performative} {event.communicate.id}"


def explored(
    wanted: tuple[int, ...], *, room: int = 2, thefts: int = 0, thief: int = ASKER, **limits: Any
) -> Exploration:
    """Everything that can happen."""
    return explore(Running(wanted, room, thefts, thief), **limits)


def test_soft_state_is_all_in_the_key() -> None:
    """State lost in a death is told apart by its inbox, re-sending, open and finished
    conversations, or is not used here.
    """
    used = "inbox resend conversations over"
    unused = "step up full held asks peers parameters answer last renumbered untold"
    assert set(Soft.__struct_fields__) == {*used.split(), *unused.split()}


LONG = (pytest.mark.long, pytest.mark.timeout(900))


@pytest.mark.parametrize(
    ("wanted", "room", "thefts", "thief"),
    [
        ((1,), 2, 0, ASKER),
        *(((1,), 1, 1, thief) for thief in (ASKER, SERVER)),
        pytest.param(WANTED, 2, 0, ASKER, marks=LONG),
        *(
            pytest.param(wanted, room, thefts, thief, marks=LONG)
            for wanted, room, thefts in (((1,), 2, 1), (WANTED, 1, 1), ((1,), 1, 2))
            for thief in (ASKER, SERVER)
        ),
    ],
)
def test_requests_under_any_faults(
    wanted: tuple[int, ...], room: int, thefts: int, thief: int
) -> None:
    """Worked on once, in order, answered, receipted only when journalled, nothing out of sequence;
    rest in reach from all. A thief may say a word in an agent's name, whenever, under whatever
    number: the agent's own are taken once, too.
    """
    found = explored(wanted, room=room, thefts=thefts, thief=thief)
    assert found.holds, str(found.findings)


# --- the runtime, spoilt --------------------------------------------------------------------------


def receipt_on_arrival(monkeypatch: pytest.MonkeyPatch) -> None:
    """A receipt as soon as a message is in the inbox."""
    admit = reception._admit_durable

    def spoilt(state: Any, out: Any, wiring: Any, link: Any, arrived: Any) -> None:
        admit(state, out, wiring, link, arrived)
        out.receipts.append(Receipt(arrived.communicate.sender, taken=int(arrived.communicate.id)))

    monkeypatch.setattr(reception, "_admit_durable", spoilt)


def no_outbox(monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbered and sent, and not kept."""

    def spoilt(state: Any, out: Any, communicate: Any, now: float) -> None:
        state.issued[communicate.receiver] = int(communicate.id)
        out.durable = True
        streams.send(state, out, communicate)

    monkeypatch.setattr(streams, "issue", spoilt)


def no_resending(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kept, and never sent again."""
    monkeypatch.setattr(streams, "resend", lambda *_: None)


def counter_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every message is number 1 of its stream."""
    monkeypatch.setattr(streams, "next_id", lambda state, peer, durable: "1")


def last_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Receipt a word and forget its number."""

    def spoilt(state: Any, peer: str) -> Receipt:
        told = streams.receipt(state, peer)
        state.taken.pop(peer, None)
        state.recent.pop(peer, None)
        return told

    monkeypatch.setattr(reception, "receipt", spoilt)


def gaps_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A number beyond the next one is taken too."""
    admit = reception._admit_durable

    def spoilt(state: Any, out: Any, wiring: Any, link: Any, arrived: Any) -> None:
        said = arrived.communicate
        number = int(said.id)
        if number > state.taken.get(said.sender, 0) and not state.soft.inbox:
            how = {"peer": said.sender, "number": number, "digest": reception.digest_of(said)}
            reception._wait(state, wiring, link, said, **how)
        else:
            admit(state, out, wiring, link, arrived)

    monkeypatch.setattr(reception, "_admit_durable", spoilt)


def not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take any word under a taken number for a copy, and any receipt for the word with its
    number.
    """

    def copied(state: Any, out: Any, communicate: Any, number: int) -> None:
        out.receipts.append(Receipt(communicate.sender, taken=state.taken[communicate.sender]))

    monkeypatch.setattr(reception, "taken_before", copied)
    monkeypatch.setattr(streams, "covered", lambda sent, taken, word: taken)


def order_not_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """No word says which one it follows."""
    monkeypatch.setattr(streams, "_known", lambda *_: True)


def refused_by_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sender takes it that its own word was refused, whichever was."""

    def spoilt(one: Any, event: Any) -> bool:
        return one.number <= event.taken if event.refused else one.number == event.taken

    monkeypatch.setattr(streams, "_another_taken", spoilt)


@pytest.mark.parametrize(
    ("spoil", "kind", "thief", "thefts", "room"),
    [
        (not_compared, UNREACHED, ASKER, 1, 1),
        (order_not_said, WRONG, SERVER, 1, 2),
        (refused_by_number, WRONG, ASKER, 2, 1),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_a_runtime_that_a_thief_could_spoil_is_found_out(
    monkeypatch: pytest.MonkeyPatch, spoil: Any, kind: str, thief: int, thefts: int, room: int
) -> None:
    """Each rule of it is needed."""
    spoil(monkeypatch)
    findings = explored((1,), room=room, thefts=thefts, thief=thief).findings
    print(*findings, sep="\n")
    assert findings[0].kind == kind


@pytest.mark.parametrize(
    ("spoil", "kind", "most_steps"),
    [
        (receipt_on_arrival, WRONG, 3),
        (no_outbox, UNREACHED, 1),
        (no_resending, UNREACHED, 1),
        (counter_not_kept, WRONG, 4),
        (last_not_kept, WRONG, 6),
        (gaps_taken, WRONG, 6),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_a_spoilt_runtime_is_found_out(
    monkeypatch: pytest.MonkeyPatch, spoil: Any, kind: str, most_steps: int
) -> None:
    """Each by a way no longer than one would tell the story in."""
    # else too much is said in vain
    monkeypatch.setattr(streams, "ANSWERS_BOUND", streams.OUTBOX_BOUND // 2)
    spoil(monkeypatch)
    findings = explored((1,), first=False).findings
    print(*findings, sep="\n")
    assert findings[0].kind == kind
    assert len(findings[0].trace) <= most_steps

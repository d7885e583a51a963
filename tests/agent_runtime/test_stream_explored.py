"""The running `Core.step` itself, of two toy agents, in everything a wire and deaths can do to a few messages.

States are whole agents with their journals and what is on its way. What grows and decides nothing is made canonical:
times (a step happens at 0, a tick 1 s later, and clocks are set back), step counters, counts, incarnations.
"""

from typing import Any, NamedTuple

import msgspec
import pytest
from toy_agents import asker, server, wirings

from agent_runtime.core import intake, streams, verdict
from agent_runtime.core.effects import Effects, LogLine, Receipt
from agent_runtime.core.errors import BehaviourError
from agent_runtime.core.events import AnyEvent, Arrived, Next, Receipted, Received, Started, Tick
from agent_runtime.core.state import CoreState, Soft, restored
from agent_runtime.core.step import Core
from fipa_codec.communicate import encode
from topdown.prove.engine import UNREACHED, WRONG, Exploration, Move, explore

WANTED = (1, 2)
ASKER, SERVER = 0, 1
NAMES = ("asker", "server")
ROOM = 2
"""Messages and receipts on their way to one agent at a time."""
LATER = 1.0
"""A tick is this much after its step [s]: all that is to be sent again is due, reply-by (5 s) is not."""


class Side(NamedTuple):
    """An agent: numbers of its state and its journal; it has more to take; it wants a tick; something was out of
    sequence.
    """

    state: int
    journal: int
    more: bool
    tick: bool
    stray: str = ""


class Place(NamedTuple):
    """Both agents, and what is on its way: (to whom, number of the event), sorted; a set, since copies are alike."""

    sides: tuple[Side, Side]
    way: tuple[tuple[int, int], ...] = ()


Stepped = tuple[int, int, Effects, list[tuple[int, int]]]
"""Numbers of the state after a step and of its record (0: none), the effects, and what they put on the way."""


class Running:
    """The model: each distinct state, journal and event has a number, and each step is computed once."""

    def __init__(self, wanted: tuple[int, ...] = WANTED) -> None:
        self.wanted = wanted
        self.cores: tuple[Core[Any], Core[Any]] = tuple(
            Core(agent, wiring) for agent, wiring in zip((asker(*wanted), server()), wirings(), strict=True)
        )
        self.things: list[Any] = [None]
        self.numbers: dict[Any, int] = {None: 0}
        self.taken: dict[tuple[int, int], int] = {}
        self.steps: dict[Any, Stepped] = {}
        place = Place((Side(0, 0, False, False), Side(0, 0, False, False)))
        for who in (ASKER, SERVER):
            place = self._restored(place, who)
        self.start = place

    # --- steps --------------------------------------------------------------------------------------------------------

    def _number(self, key: Any, thing: Any) -> int:
        if key not in self.numbers:
            self.numbers[key] = len(self.things)
            self.things.append(thing)
        return self.numbers[key]

    def _step(self, who: int, state: int, event: AnyEvent) -> "Stepped":
        """The step, computed once."""
        key = (who, state, id(event) if isinstance(event, Arrived) else event)  # those of `things` live on
        if key not in self.steps:
            now = LATER if isinstance(event, Tick) else 0.0
            try:
                after, effects = self.cores[who].step(self.things[state], event, now)
            except BehaviourError as error:
                after, effects = self.things[state], Effects(logs=(LogLine(str(error), {}, "error"),))
            after = canonical(after)
            record = self.cores[who].record(after)
            soft = msgspec.msgpack.encode([after.soft.inbox, after.soft.resend, after.soft.conversations])
            number = self._number((who, record, soft), after)
            outputs = [self._on_way(1 - who, output, NAMES[who]) for output in (*effects.receipts, *effects.sends)]
            self.steps[key] = number, self._number(record, record) if effects.record else 0, effects, outputs
        return self.steps[key]

    def _after(self, place: Place, who: int, event: AnyEvent, *, said: int | None = None) -> Place:
        """The place after a step whose record is on disk, and of whose outputs only the first `said` went out."""
        old = place.sides[who]
        state, record, effects, outputs = self._step(who, old.state, event)
        stray = out_of_order(self.things[old.state], effects)
        side = Side(state, record or old.journal, effects.more, effects.wake_at is not None, stray)
        sides = (side, place.sides[SERVER]) if who == ASKER else (place.sides[ASKER], side)
        return Place(sides, crowded(place.way, outputs[:said]))

    def _on_way(self, to: int, output: Any, sender: str) -> tuple[int, int]:
        if isinstance(output, Receipt):
            return to, self._number(("receipt", to, output.taken), Receipted(sender, output.taken))
        output = msgspec.structs.replace(output, sent=0.0)
        return to, self._number(encode(output), Arrived(output))

    def _restored(self, place: Place, who: int) -> Place:
        journal = self.things[place.sides[who].journal]
        state = canonical(self.cores[who].boot(journal))
        number = self._number((who, "boot", self.cores[who].record(state)), state)
        side = Side(number, place.sides[who].journal, False, False)
        sides = (side, place.sides[SERVER]) if who == ASKER else (place.sides[ASKER], side)
        return self._after(Place(sides, place.way), who, Started(first=journal is None))

    # --- the model ----------------------------------------------------------------------------------------------------

    def moves(self, place: Place) -> Any:
        """Whatever arrives, time, and deaths; an agent that has more to take does that first."""
        for who, side in enumerate(place.sides):
            if side.more:
                yield from self._happens(place, who, Next(), "takes the next one")
            elif side.tick:
                yield from self._happens(place, who, Tick(), "time passes")
            yield Move(NAMES[who], "dies and is restored", self._restored(place, who), fault=True)
        for one in place.way:
            to, event = one[0], self.things[one[1]]
            gone = Place(place.sides, tuple(other for other in place.way if other != one))
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
                yield Move(NAMES[who], f"{what}, dies after {said} outputs and is restored", dead, fault=True)

    def at_rest(self, place: Place) -> bool:
        """All answered, nothing kept to be sent again, nothing on its way."""
        states = [self.things[side.state] for side in place.sides]
        quiet = not place.way and not any(
            side.more or state.outbox for side, state in zip(place.sides, states, strict=True)
        )
        return quiet and len(states[ASKER].memory.answers) == len(self.wanted)

    def wrong(self, place: Place) -> str:
        """Effects once and in order; receipts for what is journalled only; nothing out of sequence."""
        memories = [self.things[side.state].memory for side in place.sides]
        if memories[SERVER].done != self.wanted[: len(memories[SERVER].done)]:
            return f"the server worked on {memories[SERVER].done}"
        if memories[ASKER].answers != tuple((n, 2 * n) for n in self.wanted)[: len(memories[ASKER].answers)]:
            return f"the asker was answered {memories[ASKER].answers}"
        for to, number in place.way:
            event = self.things[number]
            if isinstance(event, Receipted) and event.taken > self._journalled(place, 1 - to):
                return f"{NAMES[1 - to]} receipted {event.taken}, and has not journalled it"
        strays = [f"{name}: {side.stray}" for name, side in zip(NAMES, place.sides, strict=True) if side.stray]
        return ", ".join(strays)

    def _journalled(self, place: Place, who: int) -> int:
        number = place.sides[who].journal
        if (who, number) not in self.taken:
            taken = restored(self.cores[who].agent, self.things[number]).taken if number else {}
            self.taken[who, number] = taken.get(NAMES[1 - who], 0)
        return self.taken[who, number]

    def describe(self, place: Place) -> dict[str, str]:
        """State and memory of both."""
        states = [self.things[side.state] for side in place.sides]
        return {name: f"{state.state} {state.memory}" for name, state in zip(NAMES, states, strict=True)}


def crowded(way: tuple[tuple[int, int], ...], outputs: list[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    """What is on its way with these outputs: what finds no room is lost."""
    found = set(way)
    for output in outputs:
        if sum(to == output[0] for to, _ in found) < ROOM:
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


def out_of_order(before: CoreState, effects: Effects) -> str:
    """What of a step is no part of a stream in order, in words."""
    handled = effects.handled
    if isinstance(handled, Received):
        expected = before.taken.get(handled.communicate.sender, 0) + 1
        if int(handled.communicate.id) != expected:
            return f"took {handled.communicate.id}, expected {expected}"
    return "".join(line.event for line in effects.logs if line.level in ("warning", "error"))


def words(event: Any) -> str:
    """An event on its way."""
    if isinstance(event, Receipted):
        return f"receipt {event.taken}"
    return f"{event.communicate.performative} {event.communicate.id}"


def explored(wanted: tuple[int, ...] = WANTED, **limits: Any) -> Exploration:
    """Everything that can happen."""
    return explore(Running(wanted), **limits)


def test_soft_state_is_all_in_the_key() -> None:
    """What a death takes is told apart by its inbox, its re-sending and its conversations, or is not used here."""
    used = {"inbox", "resend", "conversations"}
    unused = {"step", "up", "full", "asks", "peers", "parameters", "answer"}
    assert set(Soft.__struct_fields__) == used | unused


def test_one_request_under_any_faults() -> None:
    """Worked on once, answered, receipted only when journalled, nothing out of sequence; rest in reach from all."""
    found = explored((1,))
    assert found.holds, str(found.findings)


@pytest.mark.long
def test_two_requests_under_any_faults() -> None:
    """In order, too."""
    found = explored()
    assert found.holds, str(found.findings)


# --- the runtime, spoilt ----------------------------------------------------------------------------------------------


def receipt_on_arrival(monkeypatch: pytest.MonkeyPatch) -> None:
    """A receipt as soon as a message is in the inbox."""
    admit = intake._admit_durable

    def spoilt(state: Any, out: Any, wiring: Any, link: Any, communicate: Any) -> None:
        admit(state, out, wiring, link, communicate)
        out.receipts.append(Receipt(communicate.sender, taken=int(communicate.id)))

    monkeypatch.setattr(intake, "_admit_durable", spoilt)


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
    monkeypatch.setattr("agent_runtime.core.turn.streams.next_number", lambda state, peer: 1)


def last_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was taken is receipted, and its number forgotten."""
    mark = verdict._mark_taken

    def spoilt(state: Any, out: Any, waiting: Any) -> None:
        mark(state, out, waiting)
        state.taken.pop(waiting.peer, None)

    monkeypatch.setattr(verdict, "_mark_taken", spoilt)


def gaps_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A number beyond the next one is taken too."""
    admit = intake._admit_durable

    def spoilt(state: Any, out: Any, wiring: Any, link: Any, communicate: Any) -> None:
        number = int(communicate.id)
        if number > state.taken.get(communicate.sender, 0) and not state.soft.inbox:
            intake._wait(state, wiring, link, communicate, peer=communicate.sender, number=number)
        else:
            admit(state, out, wiring, link, communicate)

    monkeypatch.setattr(intake, "_admit_durable", spoilt)


@pytest.mark.parametrize(
    ("spoil", "kind", "most_steps"),
    [
        (receipt_on_arrival, WRONG, 3),
        (no_outbox, UNREACHED, 1),
        (no_resending, UNREACHED, 1),
        (counter_not_kept, UNREACHED, 6),
        (last_not_kept, WRONG, 6),
        (gaps_taken, WRONG, 6),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_a_spoilt_runtime_is_found_out(monkeypatch: pytest.MonkeyPatch, spoil: Any, kind: str, most_steps: int) -> None:
    """Each by a way no longer than one would tell the story in."""
    spoil(monkeypatch)
    findings = explored((1,), first=False).findings
    print(*findings, sep="\n")
    assert findings[0].kind == kind
    assert len(findings[0].trace) <= most_steps

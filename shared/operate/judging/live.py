"""live.jsonl: a run in lines for a person's eyes while it goes on (docs/run-folder.md), made of
records as they come.

Pure: a record in, lines out. Must not know: files, the terminal that shows them.
"""

from collections.abc import Iterator
from typing import Protocol

import msgspec

from agent_runtime.core import peers
from agent_runtime.core.peers import Unheard
from fipa_codec.communicate import UNREADABLE
from operate.live_lines import Again, AgentIn, Happened, LiveLine, Sent
from operate.recording.records import House, Record, Spoken, Token, fault_in
from operate.structs import alike
from operate.system import System
from topdown.judge.conversations import Remembered

KNOWN = 50_000
"""Communicates whose copies are told as such, 10 MB (estimate)."""


class _Beat(msgspec.Struct, frozen=True):
    """The fields of an agent's heartbeat that are read."""

    agent: str
    state: str
    paused: bool = False
    unheard: tuple[Unheard, ...] = ()


_beat = msgspec.json.Decoder(_Beat)


class More(Protocol):
    """Further lines of a system (operate.system.Additions.live)."""

    def lines(self, record: Record) -> Iterator[LiveLine]:
        """The lines of a record; of communicates each is given once."""


class Live:
    """Remembers what is needed to tell what is new."""

    def __init__(self, system: System) -> None:
        self._known = Remembered[bool](KNOWN)
        self._words, more = system.words, system.addition("live")
        self._more: More | None = more() if more is not None else None
        self._states: dict[str, AgentIn] = {}
        self._not_heard: dict[str, tuple[Unheard, ...]] = {}

    def lines(self, record: Record) -> Iterator[LiveLine]:
        """The lines of a record; none for what repeats."""
        match record:
            case Spoken():
                if not record.id or not self._known.note(record.identity, True):
                    yield self._spoken(record)
                    yield from self._further(record)
                else:
                    yield alike(Again, record, t=record.received)
            case Token(agent=agent, alive=alive, received=t):
                state = self._states[agent].state if agent in self._states else ""
                born = record.incarnation if alive else 0
                yield from self._entered(
                    AgentIn(t=t, agent=agent, state=state, alive=alive, incarnation=born)
                )
            case House(kind="state"):
                yield from self._house(record)
            case House(kind="fault"):
                yield from self._fault(record)
            case House():
                yield from self._further(record)

    def _further(self, record: Record) -> Iterator[LiveLine]:
        """Return the lines that the system adds; a repeated state gives one line."""
        for line in self._more.lines(record) if self._more is not None else ():
            if isinstance(line, AgentIn):
                yield from self._entered(line)
            else:
                yield line

    def _fault(self, house: House) -> Iterator[Happened]:
        """Return the line of a fault that begins or ends."""
        fault = fault_in(house)
        if fault is not None and fault.began:
            told = (
                "begins"
                if fault.ended is None
                else f"over after {fault.ended - fault.began:.1f} s, {fault.text}"
            )
            yield Happened(t=house.received, name="fault", text=f"{fault.words}: {told}")

    def _spoken(self, one: Spoken) -> Sent:
        communicate, content = one.communicate, one.content
        return alike(
            Sent,
            one,
            t=one.received,
            bytes=one.size,
            text=self._words(content),
            reply_with=communicate.reply_with,
            in_reply_to=communicate.in_reply_to,
            reply_by=communicate.reply_by,
            ontology=communicate.ontology,
            content="" if content is None else f"{one.language}.{type(content).__name__}",
            use=one.kind,
        )

    def _house(self, house: House) -> Iterator[LiveLine]:
        try:
            beat = _beat.decode(house.data)
        except UNREADABLE:
            return
        state = "paused" if beat.paused else beat.state
        yield from self._entered(AgentIn(t=house.received, agent=beat.agent, state=state))
        yield from self._unheard(beat, house.received)

    def _unheard(self, beat: _Beat, t: float) -> Iterator[Happened]:
        """Agents that do not hear a peer, once for each time."""
        before = self._not_heard.get(beat.agent, ())
        self._not_heard[beat.agent] = beat.unheard
        for one in beat.unheard:
            if one not in before:
                text = peers.unheard_text(beat.agent, one, t)
                yield Happened(t=t, name="unheard", text=text)

    def _entered(self, now: AgentIn) -> Iterator[AgentIn]:
        last = self._states.get(now.agent)
        if now.incarnation or last is None or (last.state, last.alive) != (now.state, now.alive):
            self._states[now.agent] = now
            yield now

"""A run as it was recorded: what was said, heard and told in it, judged, with what nobody took
named.

Must not know: what a report wants of it.
"""

import itertools
from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from operator import attrgetter
from typing import Any, TypeVar

import msgspec

from fipa_codec.communicate import UNREADABLE
from operate.fault_lines import Fault, done
from operate.fleet_file import ProcessStatus
from operate.judging import judged
from operate.recording import ends
from operate.recording.ends import HeardReceipt, Hearing, receipts
from operate.recording.records import (
    FAULT,
    HEARTBEAT,
    SETTING,
    Garbage,
    House,
    Origin,
    Record,
    Setting,
    Spoken,
    Token,
    fault_in,
    setting_in,
)
from operate.system import System
from operate.verdict_lines import Judged

NO_SIGNALS = (HEARTBEAT, ends.RECEIPT, SETTING, FAULT)
"""Kinds of samples that tell of agents and of what they say, as every system has them."""

T = TypeVar("T")
_received = attrgetter("received")


class Hole(msgspec.Struct, frozen=True):
    """Something of the run that was not recorded; times in unix seconds."""

    start: float
    end: float
    communicates: int
    text: str


class Entered(msgspec.Struct, frozen=True):
    """An agent told its state; `alive` False: its token vanished."""

    at: float
    agent: str
    state: str
    alive: bool = True


class Signals:
    """What came on house keys that the system can read (Additions.telemetry), in the order of time:
    when it was heard [unix s], and what. What cannot be read is left out.

    Each is decoded when it is asked for, and once: they are most of a recording, and who asks for
    the newest one need not wait for all.
    """

    def __init__(
        self, houses: Iterable[House] = (), decoders: Mapping[str, Callable[[bytes], Any]] = {}
    ) -> None:
        """`houses`: in the order of time. `decoders`: kind of a sample -> its decoder."""
        self.houses = tuple(house for house in houses if house.kind in decoders)
        self.decoders = decoders
        self._decoded: dict[int, tuple[tuple[float, Any], ...]] = {}

    def __iter__(self) -> Iterator[tuple[float, Any]]:
        return itertools.chain.from_iterable(map(self._at, range(len(self.houses))))

    def until(self, at: float, kind: str) -> Iterator[tuple[float, Any]]:
        """Those of a kind that were heard up to `at` [unix s], newest first."""
        return self._of(kind, reversed(range(bisect_right(self.houses, at, key=_received))))

    def after(self, at: float, kind: str) -> Iterator[tuple[float, Any]]:
        """Those of a kind that were heard after `at` [unix s], oldest first."""
        begin = bisect_right(self.houses, at, key=_received)
        return self._of(kind, range(begin, len(self.houses)))

    def _of(self, kind: str, places: Iterable[int]) -> Iterator[tuple[float, Any]]:
        for place in places:
            if self.houses[place].kind == kind:
                yield from self._at(place)

    def _at(self, place: int) -> tuple[tuple[float, Any], ...]:
        """The one at this place; () if it cannot be read."""
        if place not in self._decoded:
            house, found = self.houses[place], tuple[tuple[float, Any], ...]()
            with suppress(*UNREADABLE):
                found = ((house.received, self.decoders[house.kind](house.data)),)
            self._decoded[place] = found
        return self._decoded[place]


class History(msgspec.Struct, frozen=True, dict=True):
    """A run. `said`: communicates in the order of time, each once; `copies`: those that were
    re-sent.

    `hearing`: agent -> what it took, and when. `judged`: what the judge says of it all. `whole`:
    the recorder ended in order. `houses`: how many of each kind of samples that are not
    communicates. `setting`: as the recorder was told it, None in a recording without. `down`:
    processes that the fleet needs and that died or were given up, as its supervisor told last.
    `faults`: those that were done on purpose.
    """

    said: tuple[Spoken, ...] = ()
    copies: tuple[Spoken, ...] = ()
    receipts: tuple[HeardReceipt, ...] = ()
    hearing: dict[str, Hearing] = {}
    signals: Signals = Signals()
    entered: tuple[Entered, ...] = ()
    garbage: tuple[Garbage, ...] = ()
    houses: dict[str, int] = {}
    holes: tuple[Hole, ...] = ()
    judged: tuple[Judged, ...] = ()
    setting: Setting | None = None
    down: tuple[ProcessStatus, ...] = ()
    faults: tuple[Fault, ...] = ()
    whole: bool = True

    @property
    def begin(self) -> float:
        """Return the time of the first communicate, or without one of the first record [unix s]."""
        if self.said:
            return self.said[0].received
        return next((at for at, _ in self.signals), 0.0)

    def conversation(self, name: str) -> tuple[Spoken, ...]:
        """What was said in the conversations of this name, in the order of time."""
        return self._conversations.get(name, ())

    @cached_property
    def _conversations(self) -> dict[str, tuple[Spoken, ...]]:
        found: defaultdict[str, list[Spoken]] = defaultdict(list)
        for one in self.said:
            found[one.conversation].append(one)
        return {name: tuple(said) for name, said in found.items()}

    def during(self, start: float, end: float) -> tuple[Spoken, ...]:
        """What was received from `start` to `end` [unix s], both included."""
        first = bisect_left(self.said, start, key=_received)
        return self.said[first : bisect_right(self.said, end, key=_received)]

    def once(self, make: Callable[["History"], T]) -> T:
        """What a function makes of it, which is made when it is first asked for."""
        if make not in self._made:
            self._made[make] = make(self)
        found: T = self._made[make]
        return found

    @cached_property
    def _made(self) -> dict[Callable[["History"], Any], Any]:
        return {}

    def took(self, question: Spoken, heard: float | None) -> float | None:
        """Return the time [s] from a communicate to what its sender heard for it, at `heard`; None
        if not known.
        """
        sender = self.hearing.get(question.sender)
        return None if sender is None else sender.after(question.sent, heard)

    def answered(self, question: Spoken, answer: Spoken) -> float | None:
        """Return the time [s] from a question to an answer."""
        sender = self.hearing.get(question.sender)
        if sender is None:
            return None
        return sender.after(question.sent, sender.said.get(answer.identity))


class _Beat(msgspec.Struct, frozen=True):
    """The fields of an agent's heartbeat that are read (agent_runtime.io.shell)."""

    agent: str
    state: str


def of_records(
    records: Iterable[Record],
    system: System,
    *,
    whole: bool = True,
    verdicts: tuple[Judged, ...] | None = None,
) -> History:
    """The history in these records, in the order of time. `verdicts`: about them; None: they are
    judged now.
    """
    records = tuple(records)
    said, copies = _told_apart([record for record in records if isinstance(record, Spoken)])
    every = [record for record in records if isinstance(record, House)]
    houses = [house for house in every if house.kind not in (SETTING, FAULT)]
    return History(
        said=said,
        copies=copies,
        receipts=tuple(receipts(houses)),
        hearing=ends.of(records),
        signals=_signals(houses, system),
        entered=tuple(_entered(records)),
        garbage=tuple(record for record in records if isinstance(record, Garbage)),
        houses=dict(Counter(house.kind for house in houses)),
        holes=(*_not_taken(said, system), *_torn(records, whole)),
        judged=judged.of_records(records, system) if verdicts is None else verdicts,
        setting=next((one for record in records if (one := setting_in(record)) is not None), None),
        faults=done(fault for record in records if (fault := fault_in(record)) is not None),
        whole=whole,
    )


def _not_taken(said: tuple[Spoken, ...], system: System) -> Iterator[Hole]:
    """Yield what only senders' logs have, by receiver."""
    lost: defaultdict[str, list[Spoken]] = defaultdict(list)
    for one in said:
        if one.origin is Origin.SENDER and one.receiver in system.design.agents:
            lost[one.receiver].append(one)
    for agent, some in lost.items():
        text = (
            f"{_count(some)} to {agent} reached nobody: it was down, frozen or out of reach, or its"
            " log lost its end"
        )
        yield Hole(some[0].received, some[-1].received, len(some), text)


def _torn(records: tuple[Record, ...], whole: bool) -> Iterator[Hole]:
    """Yield that heartbeats and telemetry may be missing."""
    if not whole:
        end = records[-1].received if records else 0.0
        why = "the recorder was killed, or records still: heartbeats and telemetry may end before"
        yield Hole(end, end, 0, why)


def _told_apart(ordered: list[Spoken]) -> tuple[tuple[Spoken, ...], tuple[Spoken, ...]]:
    """First copies and later ones. One without an id is never a copy."""
    known: set[tuple[str, str, str]] = set()
    said: list[Spoken] = []
    copies: list[Spoken] = []
    for one in ordered:
        copy = bool(one.id) and one.identity in known
        (copies if copy else said).append(one)
        known.add(one.identity)
    return tuple(said), tuple(copies)


def _signals(houses: list[House], system: System) -> Signals:
    signals = [house for house in houses if house.kind not in NO_SIGNALS]
    if not signals:
        return Signals()  # what reads them may be slow to import
    return Signals(signals, system.addition("telemetry") or {})


def _entered(records: tuple[Record, ...]) -> Iterator[Entered]:
    """Changes of state only: a repeated heartbeat is not a change."""
    last: dict[str, tuple[str, bool]] = {}
    for record in records:
        now = state_in(record, last)
        if now is not None and last.get(now.agent) != (now.state, now.alive):
            last[now.agent] = (now.state, now.alive)
            yield now


def state_in(record: Record, last: dict[str, tuple[str, bool]]) -> Entered | None:
    """Return the change of an agent's state; `last`: agent -> (state, alive) so far. None: no
    change, or unreadable.
    """
    if isinstance(record, Token):
        return Entered(
            record.received, record.agent, last.get(record.agent, ("", True))[0], record.alive
        )
    if isinstance(record, House) and record.kind == "state":
        try:
            beat = msgspec.json.decode(record.data, type=_Beat)
        except UNREADABLE:
            return None
        return Entered(record.received, beat.agent, beat.state)
    return None


def _count(some: list[Spoken]) -> str:
    return f"{len(some)} communicate{'s' * (len(some) != 1)}"

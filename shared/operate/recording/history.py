"""A run as it was recorded: the monitor's MCAP, filled from the agents' own step logs, with what is missing named.

A communicate that only a step log has is taken from there (filled.py); where that happened is a hole in the recording.
Must not know: what a report wants of it.
"""

from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Any

import msgspec

from fipa_codec.communicate import UNREADABLE
from operate.fault_lines import done
from operate.judging.judged import of_records
from operate.recording import filled
from operate.recording.fault_file import KIND, FaultFile, fault_in
from operate.recording.hearing import Hearing, Identity, Told, Took, receipts
from operate.recording.records import SETTING, Garbage, House, Origin, Record, Resumed, Spoken, Token
from operate.run_folder import FLEET_FILE, Fault, Fleet, Judged, ProcessState, ProcessStatus
from operate.system import System

NOT_UP = (ProcessState.GIVEN_UP, ProcessState.BACKING_OFF)


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


class Setting(msgspec.Struct, frozen=True):
    """Settings with which the fleet was started: `speed` "1" or "max"; `scene`: its file, "" for the canonical one."""

    seed: int
    speed: str
    scene: str = ""


class History(msgspec.Struct, frozen=True):
    """A run. `said`: communicates in the order of time, each once; `copies`: those that were re-sent.

    `hearing`: agent with a step log -> what reached it, and when.
    `told`: what came on house keys that the system can read (Additions.telemetry): when it was heard, and what.
    `judged`: what the judge says of it all. `whole`: the recorder ended in order.
    `houses`: how many of each kind of samples that are not communicates. `setting`: as the recorder was told it, None
    in a recording without. `down`: processes that the fleet needs and that died or were given up, as its supervisor
    told last. `faults`: those that were done on purpose.
    """

    said: tuple[Spoken, ...] = ()
    copies: tuple[Spoken, ...] = ()
    receipts: tuple[Told, ...] = ()
    hearing: dict[str, Hearing] = {}
    told: tuple[tuple[float, Any], ...] = ()
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
        times = [self.said[0].received] if self.said else [at for at, _ in self.told[:1]]
        return min(times, default=0.0)

    def took(self, question: Spoken, own: float | None, heard: float | None) -> Took | None:
        """Return the time from a communicate to what came for it: its sender heard that at `own`, the recorder at
        `heard`. The recorder's counts where the sender's does not tell; None where neither does.
        """
        sender = self.hearing.get(question.sender)
        spent = None if sender is None else sender.after(question.sent, own)
        if spent is not None:
            return Took(spent, by_sender=True)
        return Took(heard - question.received) if heard is not None and heard >= question.received else None

    def answered(self, question: Spoken, answer: Spoken) -> Took | None:
        """Return the time from a question to an answer."""
        sender = self.hearing.get(question.sender)
        return self.took(question, None if sender is None else sender.said.get(answer.identity), answer.received)


class _Beat(msgspec.Struct, frozen=True):
    """The fields of an agent's heartbeat that are read (agent_runtime.io.shell)."""

    agent: str
    state: str


def load(run: Path, system: System) -> History:
    """The history of a run folder of this system. What cannot be read is a hole, never an error."""
    return in_folder(of_filled(filled.of_run(run, system), system), run)


def of(place: Path, system: System) -> History:
    """The history of a run folder, or of a recording (.mcap) alone. Raise NoRecordingError if it has no record."""
    past = of_filled(filled.of(place, system), system)
    return in_folder(past, place) if place.is_dir() else past


def in_folder(past: History, run: Path) -> History:
    """Return a history with what the files of its run folder tell besides: processes that did not run, faults."""
    return msgspec.structs.replace(past, down=_down(run), faults=_faults(run, past.faults))


def _faults(run: Path, recorded: tuple[Fault, ...]) -> tuple[Fault, ...]:
    """Return the faults of a run: those recorded, and what was written while no recorder lived."""
    return done(sorted((*recorded, *FaultFile(run).new()), key=lambda one: one.t))


def _down(run: Path) -> tuple[ProcessStatus, ...]:
    """Return the processes that did not run in the end, by the supervisor's file; () without one."""
    try:
        told = msgspec.json.decode((run / FLEET_FILE).read_bytes(), type=Fleet)
    except (OSError, msgspec.DecodeError):
        return ()
    return tuple(one for one in told.processes if one.state in NOT_UP and not one.optional)


def merged(
    records: Iterable[Record], logs: Mapping[str, tuple[Record, ...]], system: System, *, whole: bool = True
) -> History:
    """The history in these records and logs (agent -> what it noted)."""
    return of_filled(filled.filled(tuple(records), logs, system, whole=whole), system)


def of_filled(run: filled.Filled, system: System) -> History:
    """The history in a recording that was filled."""
    spoken = [record for record in run.records if isinstance(record, Spoken)]
    said, copies = _told_apart(spoken)
    houses = [record for record in run.records if isinstance(record, House) and record.kind not in (SETTING, KIND)]
    return History(
        said=said,
        copies=copies,
        receipts=tuple(receipts(houses)),
        hearing=run.hearing,
        told=tuple(_decoded(houses, system.addition("telemetry") or {})),
        entered=tuple(_entered(run.records)),
        garbage=tuple(record for record in run.records if isinstance(record, Garbage)),
        houses=dict(Counter(house.kind for house in houses)),
        holes=(*_unheard(spoken), *_lost(run), *_torn(run.records, run.whole)),
        judged=of_records(run.known, system),
        setting=next(_settings(run.records), None),
        faults=done(fault for record in run.records if (fault := fault_in(record)) is not None),
        whole=run.whole,
    )


def _lost(run: filled.Filled) -> Iterator[Hole]:
    """Communicates that the recorder heard and the receiver did not step on."""
    for agent, heard in run.hearing.items():
        lost = [one for one in run.records if isinstance(one, Spoken) and _is_lost(one, agent, heard.said)]
        if lost:
            text = (
                f"{_count(lost)} to {agent} went by, but {agent}'s step log has them not: lost on the way, or its tail"
            )
            yield Hole(lost[0].received, lost[-1].received, len(lost), text)


def _is_lost(one: Spoken, agent: str, known: Container[Identity]) -> bool:
    return one.receiver == agent and one.origin is Origin.TAP and one.identity not in known


def _unheard(ordered: list[Spoken]) -> Iterator[Hole]:
    """Stretches of time in which only step logs have what was said."""
    for origin, group in groupby(ordered, key=lambda one: one.origin):
        if origin is Origin.STEPS:
            stretch = list(group)
            agents = ", ".join(sorted({one.receiver for one in stretch}))
            text = f"the recorder did not hear {_count(stretch)}; taken from the step log of {agents}"
            yield Hole(stretch[0].received, stretch[-1].received, len(stretch), text)


def _torn(records: tuple[Record, ...], whole: bool) -> Iterator[Hole]:
    """Times in which no monitor lived, or none could hear, or it was too slow."""
    yield from _missed([one for one in records if isinstance(one, Resumed) and one.sender])
    for record in records:
        if isinstance(record, Resumed) and not record.sender:
            away = f"the recorder was away or cut off for {record.received - record.since:.1f} s"
            yield Hole(record.since, record.received, 0, f"{away}: only what agents logged is known of that time")
    if not whole:
        end = records[-1].received if records else 0.0
        yield Hole(end, end, 0, "the recording was not closed in order: what came after its last record is not in it")


def _missed(marks: list[Resumed]) -> Iterator[Hole]:
    """Return one hole for marks that overlap."""
    stretch: list[Resumed] = []
    for mark in [*sorted(marks, key=lambda one: one.since), None]:
        end = max((one.received for one in stretch), default=0.0)
        if stretch and (mark is None or mark.since > end):
            who = ", ".join(sorted({one.sender for one in stretch}))
            slow = f"the recorder was too slow for {end - stretch[0].since:.1f} s"
            yield Hole(stretch[0].since, end, 0, f"{slow}: of what {who} said then, a part is known from logs only")
            stretch = []
        if mark is not None:
            stretch.append(mark)


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


def _settings(records: tuple[Record, ...]) -> Iterator[Setting]:
    for record in records:
        if isinstance(record, House) and record.kind == SETTING:
            with suppress(*UNREADABLE):
                yield msgspec.json.decode(record.data, type=Setting)


def _decoded(houses: list[House], decoders: Mapping[str, Callable[[bytes], Any]]) -> Iterator[tuple[float, Any]]:
    for house in houses:
        decode = decoders.get(house.kind)
        if decode is not None:
            with suppress(*UNREADABLE):
                yield house.received, decode(house.data)


def _entered(records: tuple[Record, ...]) -> Iterator[Entered]:
    """Changes of state only: a repeated heartbeat is not a change."""
    last: dict[str, tuple[str, bool]] = {}
    for record in records:
        now = state_in(record, last)
        if now is not None and last.get(now.agent) != (now.state, now.alive):
            last[now.agent] = (now.state, now.alive)
            yield now


def state_in(record: Record, last: dict[str, tuple[str, bool]]) -> Entered | None:
    """Return the change of an agent's state; `last`: agent -> (state, alive) so far. None: no change, or unreadable."""
    if isinstance(record, Token):
        return Entered(record.received, record.agent, last.get(record.agent, ("", True))[0], record.alive)
    if isinstance(record, House) and record.kind == "state":
        try:
            beat = msgspec.json.decode(record.data, type=_Beat)
        except UNREADABLE:
            return None
        return Entered(record.received, beat.agent, beat.state)
    return None


def _count(some: list[Spoken]) -> str:
    return f"{len(some)} communicate{'s' * (len(some) != 1)}"

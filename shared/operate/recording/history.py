"""A run as it was recorded: the monitor's MCAP and the agents' own step logs, merged, with what is missing named.

The monitor may be killed; each agent also writes down what reached it. A communicate that only a step log has is taken
from there; where that happened is a hole in the recording. Must not know: what a report wants of it.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.core.effects import Receipt
from agent_runtime.core.events import Arrived
from agent_runtime.io import steplog
from fipa_codec.communicate import encode
from fipa_codec.errors import FipaError
from operate.judging.judged import of_records
from operate.recording import mcap_file
from operate.recording.records import SETTING, Garbage, House, Origin, Record, Resumed, Spoken, Token, spoken
from operate.run_folder import FLEET_FILE, Fleet, Judged, ProcessState, ProcessStatus
from operate.system import System

STEPS = "steps"
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


class Told(msgspec.Struct, frozen=True):
    """A receipt of `owner` that came by, for communicates of `peer`."""

    at: float
    owner: str
    peer: str
    receipt: Receipt


class Setting(msgspec.Struct, frozen=True):
    """Settings with which the fleet was started: `speed` "1" or "max"; `scene`: its file, "" for the canonical one."""

    seed: int
    speed: str
    scene: str = ""


class History(msgspec.Struct, frozen=True):
    """A run. `said`: communicates in the order of time, each once; `copies`: those that were re-sent.

    `told`: what came on house keys that the system can read (Additions.telemetry): when it was heard, and what.
    `judged`: what the judge says of what was recorded.
    `houses`: how many of each kind of samples that are not communicates. `setting`: as the recorder was told it, None
    in a recording without. `down`: processes that the fleet needs and that died or were given up, as its supervisor
    told last.
    """

    said: tuple[Spoken, ...] = ()
    copies: tuple[Spoken, ...] = ()
    receipts: tuple[Told, ...] = ()
    told: tuple[tuple[float, Any], ...] = ()
    entered: tuple[Entered, ...] = ()
    garbage: tuple[Garbage, ...] = ()
    houses: dict[str, int] = {}
    holes: tuple[Hole, ...] = ()
    judged: tuple[Judged, ...] = ()
    setting: Setting | None = None
    down: tuple[ProcessStatus, ...] = ()

    @property
    def begin(self) -> float:
        """Return the time of the first communicate, or without one of the first record [unix s]."""
        times = [self.said[0].received] if self.said else [at for at, _ in self.told[:1]]
        return min(times, default=0.0)


class _Beat(msgspec.Struct, frozen=True):
    """The fields of an agent's heartbeat that are read (agent_runtime.io.shell)."""

    agent: str
    state: str


def load(run: Path, system: System) -> History:
    """The history of a run folder of this system. What cannot be read is a hole, never an error."""
    heard = mcap_file.read(run / mcap_file.FILE, system)
    logs = {path.stem: tuple(arrivals(path, system)) for path in sorted((run / STEPS).glob(f"*.{STEPS}"))}
    return msgspec.structs.replace(merged(heard.records, logs, system, whole=heard.whole), down=_down(run))


def _down(run: Path) -> tuple[ProcessStatus, ...]:
    """Return the processes that did not run in the end, by the supervisor's file; () without one."""
    try:
        told = msgspec.json.decode((run / FLEET_FILE).read_bytes(), type=Fleet)
    except (OSError, msgspec.DecodeError):
        return ()
    return tuple(one for one in told.processes if one.state in NOT_UP and not one.optional)


def merged(
    records: Iterable[Record], logs: dict[str, tuple[Spoken, ...]], system: System, *, whole: bool = True
) -> History:
    """The history in these records and logs (agent -> what reached it)."""
    records = tuple(records)
    tapped = tuple(record for record in records if isinstance(record, Spoken))
    missed, lost = _missed(tapped, logs), _lost(tapped, logs)
    ordered = sorted((*tapped, *missed), key=lambda one: one.received)
    said, copies = _told_apart(ordered)
    houses = [record for record in records if isinstance(record, House) and record.kind != SETTING]
    holes = (*_unheard(ordered), *lost, *_torn(records, whole))
    return History(
        said=said,
        copies=copies,
        receipts=tuple(_receipts(houses)),
        told=tuple(_decoded(houses, system.addition("telemetry") or {})),
        entered=tuple(_entered(records)),
        garbage=tuple(record for record in records if isinstance(record, Garbage)),
        houses=dict(Counter(house.kind for house in houses)),
        holes=holes,
        judged=of_records(records, system),
        setting=next(_settings(records), None),
    )


def arrivals(path: Path, system: System) -> Iterator[Spoken]:
    """The communicates that reached the agent whose step log this is; the log may end anywhere."""
    try:
        for step in steplog.read(path):
            if step.kind == Arrived.__name__ and (one := _arrived(step, system)) is not None:
                yield one
    except (msgspec.MsgspecError, OSError):
        return


def _arrived(step: steplog.Step, system: System) -> Spoken | None:
    """Return the communicate that reached the agent in this step; None for one that the design does not have."""
    try:
        communicate = msgspec.msgpack.decode(step.input, type=Arrived).communicate
        return spoken(communicate, encode(communicate), step.at, system, Origin.STEPS)
    except (msgspec.MsgspecError, FipaError, LookupError):
        return None


def _missed(tapped: tuple[Spoken, ...], logs: dict[str, tuple[Spoken, ...]]) -> list[Spoken]:
    """Communicates that agents heard and the tap did not."""
    known = {one.identity for one in tapped}
    first = {one.identity: one for log in logs.values() for one in reversed(log)}
    return [one for identity, one in first.items() if identity not in known]


def _lost(tapped: tuple[Spoken, ...], logs: dict[str, tuple[Spoken, ...]]) -> Iterator[Hole]:
    """Communicates that the tap heard and the receiver did not step on."""
    for agent, log in logs.items():
        known = {one.identity for one in log}
        lost = [one for one in tapped if one.receiver == agent and one.identity not in known]
        if lost:
            text = (
                f"{_count(lost)} to {agent} went by, but {agent}'s step log has them not: lost on the way, or its tail"
            )
            yield Hole(lost[0].received, lost[-1].received, len(lost), text)


def _unheard(ordered: list[Spoken]) -> Iterator[Hole]:
    """Stretches of time in which only step logs have what was said."""
    for origin, group in groupby(ordered, key=lambda one: one.origin):
        if origin is Origin.STEPS:
            stretch = list(group)
            agents = ", ".join(sorted({one.receiver for one in stretch}))
            text = f"the recorder did not hear {_count(stretch)}; taken from the step log of {agents}"
            yield Hole(stretch[0].received, stretch[-1].received, len(stretch), text)


def _torn(records: tuple[Record, ...], whole: bool) -> Iterator[Hole]:
    """Times in which no monitor lived, or none could hear."""
    for record in records:
        if isinstance(record, Resumed):
            away = f"the recorder was away or cut off for {record.received - record.since:.1f} s"
            yield Hole(record.since, record.received, 0, f"{away}: only what agents logged is known of that time")
    if not whole:
        end = records[-1].received if records else 0.0
        yield Hole(end, end, 0, "the recording was not closed in order: what came after its last record is not in it")


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
            with suppress(msgspec.MsgspecError, UnicodeDecodeError):
                yield msgspec.json.decode(record.data, type=Setting)


def _receipts(houses: list[House]) -> Iterator[Told]:
    for house in houses:
        if house.kind == "receipt":
            try:
                receipt = msgspec.msgpack.decode(house.data, type=Receipt)
            except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
                continue
            yield Told(house.received, house.owner, house.peer, receipt)


def _decoded(houses: list[House], decoders: Mapping[str, Callable[[bytes], Any]]) -> Iterator[tuple[float, Any]]:
    for house in houses:
        decode = decoders.get(house.kind)
        if decode is not None:
            with suppress(msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
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
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
            return None
        return Entered(record.received, beat.agent, beat.state)
    return None


def _count(some: list[Spoken]) -> str:
    return f"{len(some)} communicate{'s' * (len(some) != 1)}"

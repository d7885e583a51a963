"""A recording with its holes filled: what the agents' step logs have and the recorder did not hear stands at its time.

While the recorder is dead or cut off, each agent still writes down what reaches it (agent_runtime.io.steplog): words of
its peers, its own lives, bytes that were no communicate. Where all agents of a run have a log, nothing of that time is
unknown, so whoever judges need not start again after a hole. Must not know: what a reader wants of it.
"""

import os
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import msgspec

from agent_runtime.core.errors import StepLogError
from agent_runtime.core.events import Arrived, Garbled
from agent_runtime.io import steplog
from agent_runtime.io.steplog import BOOT
from agent_runtime.io.tap import sender_of
from fipa_codec.communicate import UNREADABLE, Communicate, encode
from fipa_codec.errors import FipaError
from operate.judging.judged import SYSTEM
from operate.recording import mcap_file
from operate.recording.records import GARBAGE_BYTES, Garbage, Origin, Record, Resumed, Spoken, Token, spoken
from operate.system import System

STEPS = "steps"
RECORDER_PID = "monitor.pid"

FLUSHED_S = 0.5
"""Of a run that goes on: what was heard so long ago is in the file; five times the recorder's FLUSH_S (estimate)."""
TRAVEL_S = 60.0
"""Longest time from sending to taking for which `sent` is believed; estimate: outages of a minute are tried."""


class Filled(msgspec.Struct, frozen=True):
    """`records` in the order of time; `whole`: the recording was closed in order.

    `taken`: agent with a log -> identities of the communicates that reached it; `complete`: all agents have one.
    """

    records: tuple[Record, ...]
    whole: bool
    taken: dict[str, frozenset[tuple[str, str, str]]]
    complete: bool

    @property
    def known(self) -> tuple[Record, ...]:
        """Return the records as if no recorder had been away, where that is so."""
        return tuple(one for one in self.records if not (self.complete and isinstance(one, Resumed)))


def of_run(run: Path, system: System) -> Filled:
    """The recording of a run folder of this system, filled. What cannot be read is left out, never an error."""
    heard = mcap_file.read(run / mcap_file.FILE, system)
    logs = {path.stem: tuple(noted(path, system)) for path in sorted((run / STEPS).glob(f"*.{STEPS}"))}
    goes_on = bool(heard.records) and not heard.whole and _is_recorded(run)
    until = heard.records[-1].received - FLUSHED_S if goes_on else float("inf")
    return filled(heard.records, logs, system, whole=heard.whole, until=until)


def filled(
    records: tuple[Record, ...],
    logs: Mapping[str, tuple[Record, ...]],
    system: System,
    *,
    whole: bool = True,
    until: float = float("inf"),
) -> Filled:
    """Fill a recording from logs (agent -> what it noted), but for what came after `until` [unix s]."""
    missed = [one for one in _missed(records, logs) if one.received <= until]
    holes = [one for one in records if isinstance(one, Resumed)]
    ordered = sorted((*(_said_in(one, holes) for one in records), *missed), key=lambda one: one.received)
    taken = {agent: frozenset(one.identity for one in log if isinstance(one, Spoken)) for agent, log in logs.items()}
    return Filled(tuple(ordered), whole, taken, bool(logs) and _agents(ordered, system) <= logs.keys())


def noted(path: Path, system: System) -> Iterator[Record]:
    """Yield the records of an agent's step log: what reached it, and its own lives; the log may end anywhere."""
    try:
        for step in steplog.read(path):
            record = _record(step, path.stem, system)
            if record is not None:
                yield record
    except (*UNREADABLE, StepLogError, OSError):
        return


def _record(step: steplog.Step, agent: str, system: System) -> Record | None:
    match step.kind:
        case Arrived.__name__:
            return _arrived(msgspec.msgpack.decode(step.input, type=Arrived).communicate, step.at, agent, system)
        case Garbled.__name__:
            told = msgspec.msgpack.decode(step.input, type=Garbled)
            return Garbage(told.key, 0, told.reason, step.at, b"", log=agent) if "/" in told.key else None
        case kind if kind == BOOT:
            return Token(agent, step.incarnation, True, step.at, steplog.journal_of(step.input))
    return None


def _arrived(one: Communicate, at: float, agent: str, system: System) -> Record | None:
    """The record of a communicate that an agent took at `at`, at the time when it was sent."""
    sent = one.sent if at - TRAVEL_S < one.sent <= at else at
    try:
        wire = encode(one)
        return spoken(one, wire, sent, system, Origin.STEPS)
    except LookupError as error:
        return Garbage(_key(one, system), len(wire), str(error), sent, wire, log=agent)
    except FipaError:
        return None


def _key(one: Communicate, system: System) -> str:
    """The key of a communicate that the design does not have, on no channel of it."""
    told = {name: str(getattr(one, name)) for name in ("sender", "receiver", "protocol", "performative")}
    return system.design.file.system.key.format(system=SYSTEM, channel="unknown", **told)


def _is_recorded(run: Path) -> bool:
    """Whether the recorder of a run lives: what was heard last may not be in the file yet."""
    try:
        os.kill(int((run / RECORDER_PID).read_text()), 0)
    except (OSError, ValueError):
        return False
    return True


def _missed(records: Iterable[Record], logs: Mapping[str, tuple[Record, ...]]) -> Iterator[Record]:
    """Yield records that agents noted and the recorder did not hear; each once."""
    seen = _Seen(records)
    for log in logs.values():
        for record in log:
            if seen.is_new(record):
                yield record


class _Seen:
    """Records of a recording, and those added to it so far."""

    def __init__(self, records: Iterable[Record]) -> None:
        self._said: defaultdict[tuple[str, str, str], list[Spoken]] = defaultdict(list)
        self._others: set[bytes] = set()
        self._broken: defaultdict[str, list[float]] = defaultdict(list)
        self._lives: set[tuple[str, int, str]] = set()
        self._holes: list[Resumed] = []
        for record in records:
            match record:
                case Spoken():
                    self._said[record.identity].append(record)
                case Garbage():
                    self._others.add(record.data)
                    self._broken[record.key].append(record.received)
                case Token(alive=True):
                    self._lives.add((record.agent, record.incarnation, record.journal))
                case Resumed():
                    self._holes.append(record)

    def is_new(self, record: Record) -> bool:
        """Whether nobody has it yet; from now on it is had."""
        match record:
            case Spoken():
                new = not any(_same(record, one) for one in self._said[record.identity])
                self._said[record.identity] += [record] if new else []
            case Garbage(data=b""):  # its bytes are not in the log: where the recorder heard, it has them
                new = self._in_hole(record)
            case Garbage():
                new = record.data[:GARBAGE_BYTES] not in self._others
                self._others.add(record.data)
            case Token():
                new = (record.agent, record.incarnation, record.journal) not in self._lives
            case _:
                new = False
        return new

    def _in_hole(self, record: Garbage) -> bool:
        """Whether it came where something was not heard, and is none of those on its key that were."""
        sender, heard = sender_of(record.key), self._broken[record.key]
        for hole in self._holes:
            if hole.within(record.received, sender):
                other = next((at for at in heard if hole.within(at, sender)), None)
                if other is None:
                    return True
                heard.remove(other)
                return False
        return False


def _same(one: Spoken, other: Spoken) -> bool:
    """Whether both are the same words; a foreign agent may encode them in another way."""
    return one.wire in (other.wire, encode(other.communicate))


def _said_in(record: Record, holes: list[Resumed]) -> Record:
    """A communicate that was heard after a hole and sent in it (the router was away) stands where it was sent."""
    if isinstance(record, Spoken):
        for hole in holes:
            if not hole.sender and hole.since <= record.sent <= hole.received <= record.received:
                return record.moved(record.sent)
    return record


def _agents(records: Iterable[Record], system: System) -> frozenset[str]:
    """The agents of the design that took part."""
    found: set[str] = set()
    for record in records:
        match record:
            case Spoken():
                found |= {record.sender, record.receiver}
            case Token():
                found.add(record.agent)
    return frozenset(found) & frozenset(system.design.agents)

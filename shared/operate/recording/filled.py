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

from agent_runtime.io.tap import sender_of
from fipa_codec.communicate import encode
from operate.recording import hearing, mcap_file
from operate.recording.hearing import Hearing
from operate.recording.noted import noted, said_at
from operate.recording.records import GARBAGE_BYTES, Garbage, Record, Resumed, Spoken, Token
from operate.recording.stored import NoRecordingError
from operate.system import System

STEPS = "steps"
RECORDER_PID = "monitor.pid"

FLUSHED_S = 0.5
"""Of a run that goes on: what was heard so long ago is in the file; five times the recorder's FLUSH_S (estimate)."""


class Filled(msgspec.Struct, frozen=True):
    """`records` in the order of time; `whole`: the recording was closed in order.

    `hearing`: agent with a log -> what reached it; `complete`: all agents have one.
    """

    records: tuple[Record, ...]
    whole: bool
    hearing: dict[str, Hearing]
    complete: bool

    @property
    def known(self) -> tuple[Record, ...]:
        """Return the records as if no recorder had been away, where that is so."""
        return tuple(one for one in self.records if not (self.complete and isinstance(one, Resumed)))


def of(place: Path, system: System) -> Filled:
    """The recording of a run folder, filled, or a recording (.mcap) alone. Raise NoRecordingError: it has no record."""
    path = place / mcap_file.FILE if place.is_dir() else place
    if place.is_dir():
        found = of_run(place, system)
    else:
        read = mcap_file.read(path, system)
        found = filled(read.records, {}, system, whole=read.whole)
    if not found.records:
        raise NoRecordingError(path, "holds no record that can be read" if path.is_file() else "is not there")
    return found


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
    heard = {agent: hearing.of(log) for agent, log in logs.items()}
    return Filled(tuple(ordered), whole, heard, bool(logs) and _agents(ordered, system) <= logs.keys())


def _is_recorded(run: Path) -> bool:
    """Whether the recorder of a run lives: what was heard last may not be in the file yet."""
    try:
        os.kill(int((run / RECORDER_PID).read_text()), 0)
    except (OSError, ValueError):
        return False
    return True


def _missed(records: Iterable[Record], logs: Mapping[str, tuple[Record, ...]]) -> Iterator[Record]:
    """Yield records that agents noted and the recorder did not hear; each once, and where it was said."""
    seen = _Seen(records)
    for log in logs.values():
        for record in log:
            if seen.is_new(record):
                yield record.moved(said_at(record.sent, record.received)) if isinstance(record, Spoken) else record


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

"""traffic.mcap: written record by record, readable up to wherever its writing ended.

Topics: `communicates/<channel>`, `house/<kind>`, `tokens`, `garbage`, `unpaired`; messages in JSON
with a JSON schema, log time = heard, publish time = sent. While it is written, records are not
gathered in chunks: one that a kill cuts off would be lost as a whole. When it is closed, it is
written again in chunks (index.py).
"""

import fcntl
import os
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
from mcap.records import Channel, Footer, Header, McapRecord, Message, Metadata
from mcap.writer import IndexType, Writer

from agent_runtime.io.journal import free_name, worded
from agent_runtime.io.run_files import write_secret
from fipa_codec.communicate import UNREADABLE
from operate.file_names import TRAFFIC_FILE
from operate.recording import index
from operate.recording.index import CONTENTS, NOTE, TORN, NoRecordingError, stored
from operate.recording.records import Garbage, House, Record, Spoken, Token, Unpaired
from operate.system import System

# --- The JSON schema of a record, in the narrow form that viewers of MCAP read --------------------
# Foxglove's parser wants `type: object` at the root and a plain type for each field; it follows no
# `$ref`, which is what msgspec writes for a Struct and for an enumeration.


def schema(kind: type) -> dict[str, Any]:
    """The schema of a Struct whose fields are plain or enumerations; each reference stands where it
    points to.
    """
    (root,), parts = msgspec.json.schema_components((kind,))
    return _inlined(root, parts)


def _inlined(one: dict[str, Any], parts: dict[str, Any]) -> dict[str, Any]:
    if "$ref" in one:
        one = parts[one["$ref"].removeprefix("#/$defs/")]
    if "enum" in one:
        one = {"type": "string", **one}
    if "properties" in one:
        fields = one["properties"].items()
        one = one | {"properties": {name: _inlined(field, parts) for name, field in fields}}
    return one


# --- traffic.mcap ---------------------------------------------------------------------------------


CURSOR_FILE = "traffic.cursor.json"
PROFILE = "robot-companion"
_NS = 1_000_000_000
_encoder = msgspec.json.Encoder()
_KINDS: dict[str, type] = {
    "communicates": Spoken,
    "house": House,
    "tokens": Token,
    "unpaired": Unpaired,
}
_decoders: dict[type, msgspec.json.Decoder[Any]] = {
    kind: msgspec.json.Decoder(kind) for kind in (Spoken, House, Token, Garbage, Unpaired)
}


class Cursor(msgspec.Struct, frozen=True):
    """A place in a recording from which it goes on, in the file CURSOR_FILE beside it.

    `end`: bytes up to there; `count`, `until`: records, and the time of the last one [unix s];
    `topics`: in the order of their numbers; `schemas`: a checksum of what records look like;
    `logs`: agent -> offset in its step log.
    """

    end: int = 0
    count: int = 0
    until: float = 0.0
    topics: tuple[str, ...] = ()
    schemas: int = 0
    logs: dict[str, int] = {}


def cursor(run: Path) -> Cursor | None:
    """Return the place from which the recording of a run folder goes on; None: it begins."""
    try:
        found = msgspec.json.decode((run / CURSOR_FILE).read_bytes(), type=Cursor)
        fits = found.schemas == _schemas() and (run / TRAFFIC_FILE).stat().st_size >= found.end
    except (OSError, msgspec.DecodeError):
        return None
    return found if fits else None


class Recording:
    """An open recording, for its owner alone."""

    def __init__(self, path: Path, before: Cursor | None = None) -> None:
        """Begins the file, or goes on at `before`: what follows there is cut off. One that is there
        and has no cursor is kept under another name. The file has no statistics and no index of
        notes at its end then.
        """
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        if before is None and path.exists() and path.stat().st_size:
            path.rename(free_name(path))
        self._file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o600), "r+b")
        # until it is closed, nobody writes it again
        fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        alone = {} if before is None else {"use_statistics": False, "index_types": IndexType.NONE}
        self._writer = Writer(self._file, use_chunking=False, **alone)
        self._schemas: dict[type, int] = {}
        self._channels: dict[str, int] = {}
        self._count, self.taken_until = 0, 0.0
        """Time of the last record [unix s]; 0: there is none."""
        end = 0 if before is None else before.end
        self._file.seek(end)
        self._writer.start(profile=PROFILE)
        if before is not None:  # the writer repeats what stands in the file already
            self._count, self.taken_until = before.count, before.until
            for name in before.topics:
                self._channel(name, _kind(name))
            self._writer.flush()
            self._file.seek(end)
            self._file.truncate()
        self.flush()

    def add(self, record: Record) -> None:
        """Append a record."""
        self._count += 1
        self.taken_until = max(self.taken_until, record.received)
        heard = int(record.received * _NS)
        sent = heard
        if isinstance(record, Spoken) and 0 < record.sent < 1e10:
            sent = int(record.sent * _NS)
        channel = self._channel(topic(record), type(record))
        self._writer.add_message(channel, heard, _encoder.encode(record), sent, self._count)

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._file.tell()

    def note(self, name: str, facts: dict[str, str]) -> None:
        """Append words about the recording itself, as metadata."""
        self._writer.add_metadata(name, facts)

    def flush(self) -> None:
        """Hand everything to the operating system: from here on a kill cannot take it."""
        self._file.flush()

    def keep(self, logs: Mapping[str, int]) -> None:
        """Flush, and write down that a later recorder goes on here, and at these offsets of the
        agents' logs.
        """
        self.flush()
        self._keep(self.size, logs)

    def finish(self, logs: Mapping[str, int] | None = None) -> str:
        """Write the summary, close, and write it again with an index. Return why that failed, "" if
        it did not.

        The recording is whole all the same; Rerun, for one, reads nothing from it before `roco
        record repair`. With `logs` a later recorder can go on behind it.
        """
        end = self.size
        self._writer.finish()
        self._file.close()
        why = ""
        try:
            end = index.write(self._path) or end
        except OSError as error:
            why = worded(self._path, error)
        if logs is not None:
            self._keep(end, logs)
        return why

    def _keep(self, end: int, logs: Mapping[str, int]) -> None:
        topics = tuple(self._channels)
        now = Cursor(end, self._count, self.taken_until, topics, _schemas(), dict(logs))
        write_secret(self._path.with_name(CURSOR_FILE), _encoder.encode(now))

    def _channel(self, name: str, kind: type) -> int:
        if name not in self._channels:
            if kind not in self._schemas:
                data = _encoder.encode(schema(kind))
                made = self._writer.register_schema(kind.__name__, "jsonschema", data)
                self._schemas[kind] = made
            self._channels[name] = self._writer.register_channel(name, "json", self._schemas[kind])
        return self._channels[name]


@lru_cache(1)
def _schemas() -> int:
    return zlib.crc32(b"".join(_encoder.encode(schema(kind)) for kind in _decoders))


def topic(record: Record) -> str:
    """The topic a record stands under."""
    match record:
        case Spoken(channel=channel):
            return f"communicates/{channel}"
        case House(kind=kind):
            return f"house/{kind}"
        case Token():
            return "tokens"
        case Garbage():
            return "garbage"
        case Unpaired():
            return "unpaired"


class Read(msgspec.Struct, frozen=True):
    """A recording: its records; `whole`: it was closed in order, nothing is cut off."""

    records: tuple[Record, ...]
    whole: bool


class Reading:
    """The records of one traffic.mcap as they stand in it, one by one; of a missing file none.

    `whole`, once all are read: whether it was closed in order, nothing is cut off, nor was before a
    repair.
    """

    def __init__(
        self,
        path: Path,
        system: System | None = None,
        wanted: Callable[[str], bool] = lambda topic: True,
    ) -> None:
        """`system`: whose languages contents can be read in; without it none can. `wanted`: whether
        records of a topic are read; of all others not even their bytes are looked at.
        """
        self._path, self._system, self._wanted = path, system, wanted
        self._unwanted: set[int] = set()
        self.whole = False

    def __iter__(self) -> Iterator[Record]:
        """Ends where the file does, however. Raise NoRecordingError for contents of another
        version.
        """
        if not self._path.exists():
            return
        with self._path.open("rb") as file:
            try:
                yield from self._records(stored(file, self._unwanted))
            except TORN:
                self.whole = False

    def _records(self, stored: Iterator[McapRecord]) -> Iterator[Record]:
        kinds: dict[int, type] = {}
        repaired = False
        for found in stored:
            if isinstance(found, Header):  # another file begins, with numbers of its own
                self._unwanted.clear()
            elif isinstance(found, Channel):
                kinds[found.id] = _kind(found.topic)
                if not self._wanted(found.topic):
                    self._unwanted.add(found.id)
            elif isinstance(found, Message):
                if found.channel_id in self._unwanted or found.channel_id not in kinds:
                    continue
                with suppress(*UNREADABLE):  # cut off, or of another version
                    record = _decoders[kinds[found.channel_id]].decode(found.data)
                    if isinstance(record, Spoken) and self._system is not None:
                        record.read_in(self._system.languages)
                    yield record
            elif isinstance(found, Metadata):
                repaired |= found.name == index.REPAIRED
                if found.name == NOTE and self._system is not None:
                    self._check(found.metadata, self._system.contents)
            elif isinstance(found, Footer):
                self.whole = not repaired

    def _check(self, noted: dict[str, str], contents: int) -> None:
        recorded = noted.get(CONTENTS, "1")
        if recorded != str(contents):
            why = f"has messages of version {recorded}, and these tools read version {contents}"
            by = f"read it with the version that recorded it ({noted.get('version', 'not noted')})"
            raise NoRecordingError(self._path, why, by)


def read(
    path: Path, system: System | None = None, wanted: Callable[[str], bool] = lambda topic: True
) -> Read:
    """Everything readable of one traffic.mcap, recorded of this system, or what is on topics that
    are wanted; of a missing file nothing.
    """
    reading = Reading(path, system, wanted)
    return Read(tuple(reading), reading.whole)


def first(path: Path, system: System | None = None) -> Record | None:
    """The first record of a recording, which a recorder begins with its setting; None where nothing
    can be read.
    """
    return next(iter(Reading(path, system)), None)


def _kind(topic: str) -> type:
    return _KINDS.get(topic.partition("/")[0], Garbage)

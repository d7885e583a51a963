"""traffic.mcap: written record by record, readable up to wherever its writing ended.

Topics: `communicates/<channel>`, `house/<kind>`, `tokens`, `garbage`, `monitor`; messages in JSON with a JSON schema,
log time = heard, publish time = sent. While it is written, records are not gathered in chunks: one that a kill cuts off
would be lost as a whole. When it is closed, it is written again in chunks (index.py).
"""

import fcntl
import os
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
from mcap.records import Channel, Footer, McapRecord, Message, Metadata, Schema
from mcap.writer import IndexType, Writer

from agent_runtime.io.full_disk import worded
from fipa_codec.communicate import UNREADABLE
from operate.recording import index
from operate.recording.last_recording import Left, left
from operate.recording.records import Garbage, House, Record, Resumed, Spoken, Token
from operate.recording.schemas import schema
from operate.recording.stored import CONTENTS, NOTE, TORN, NoRecordingError, stored
from operate.system import System

FILE = "traffic.mcap"
PROFILE = "robot-companion"
_NS = 1_000_000_000
_encoder = msgspec.json.Encoder()
_KINDS: dict[str, type] = {"communicates": Spoken, "house": House, "tokens": Token, "monitor": Resumed}
_decoders: dict[type, msgspec.json.Decoder[Any]] = {
    kind: msgspec.json.Decoder(kind) for kind in (Spoken, House, Token, Garbage, Resumed)
}


class Recording:
    """An open traffic.mcap."""

    def __init__(self, path: Path, alive: Callable[[], None] = lambda: None) -> None:
        """Begins the file, for its owner alone, or goes on behind the last whole record that a recorder left.

        `alive` is called while it looks for that one. Such a file has no statistics and no index of notes at its end.
        """
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        before = left(path, alive)
        flags = os.O_RDWR | os.O_CREAT | (os.O_TRUNC if before is None else 0)
        self._file = os.fdopen(os.open(path, flags, 0o600), "r+b")
        fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # until it is closed, nobody writes it again
        alone = {} if before is None else {"use_statistics": False, "index_types": IndexType.NONE}
        self._writer = Writer(self._file, use_chunking=False, **alone)
        self._file.seek(0 if before is None else before.end)
        self._writer.start(profile=PROFILE)
        self._schemas: dict[type, int] = {}
        self._channels: dict[str, int] = {}
        self._count = 0
        self.taken_until = 0.0
        """Time of the last record left by an earlier recorder [unix s]; 0: there was none."""
        if before is not None:
            self._go_on(before)
        self.flush()

    def add(self, record: Record) -> None:
        """Append a record."""
        self._count += 1
        heard = int(record.received * _NS)
        sent = int(record.sent * _NS) if isinstance(record, Spoken) and 0 < record.sent < 1e10 else heard
        self._writer.add_message(self._channel(record), heard, _encoder.encode(record), sent, self._count)

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

    def finish(self) -> str:
        """Write the summary, close, and write it again with an index. Return why that failed, "" if it did not.

        The recording is whole all the same; Rerun, for one, reads nothing from it before `roco record repair`.
        """
        self._writer.finish()
        self._file.close()
        try:
            index.write(self._path)
        except OSError as error:
            return worded(self._path, error)
        return ""

    def _go_on(self, before: Left) -> None:
        """Have the writer repeat what stands in the file, which is cut off again, and the next record follow there."""
        for one in before.said:
            self._said(one)
        self._writer.flush()
        self._file.seek(before.end)
        self._file.truncate()
        if before.heard_ns:
            self._count, self.taken_until = before.number, before.heard_ns / _NS
            self.add(Resumed(self.taken_until, time.time()))

    def _said(self, one: Schema | Channel) -> None:
        match one:
            case Schema():
                kind = next((kind for kind in _decoders if kind.__name__ == one.name), None)
                number = self._writer.register_schema(one.name, one.encoding, one.data)
                if kind is not None and one.data == _encoder.encode(schema(kind)):
                    self._schemas[kind] = number
            case Channel():
                number = self._writer.register_channel(one.topic, one.message_encoding, one.schema_id, one.metadata)
                if one.schema_id in self._schemas.values():
                    self._channels[one.topic] = number

    def _channel(self, record: Record) -> int:
        name, kind = topic(record), type(record)
        if name not in self._channels:
            if kind not in self._schemas:
                data = _encoder.encode(schema(kind))
                self._schemas[kind] = self._writer.register_schema(kind.__name__, "jsonschema", data)
            self._channels[name] = self._writer.register_channel(name, "json", self._schemas[kind])
        return self._channels[name]


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
        case Resumed():
            return "monitor"


class Read(msgspec.Struct, frozen=True):
    """A recording: its records in the order they were heard; `whole`: it was closed in order, nothing is cut off."""

    records: tuple[Record, ...]
    whole: bool


class Reading:
    """The records of one traffic.mcap as they stand in it, one by one; of a missing file none.

    `whole`, once all are read: whether it was closed in order, nothing is cut off, nor was before a repair.
    """

    def __init__(self, path: Path, system: System | None = None) -> None:
        """`system`: whose languages contents can be read in; without it none can."""
        self._path, self._system = path, system
        self.whole = False

    def __iter__(self) -> Iterator[Record]:
        """Ends where the file does, however. Raise NoRecordingError for contents of another version."""
        if not self._path.exists():
            return
        with self._path.open("rb") as file:
            try:
                yield from self._records(stored(file))
            except TORN:
                self.whole = False

    def _records(self, stored: Iterator[McapRecord]) -> Iterator[Record]:
        kinds: dict[int, type] = {}
        repaired = False
        for found in stored:
            if isinstance(found, Channel):
                kinds[found.id] = _kind(found.topic)
            elif isinstance(found, Message) and found.channel_id in kinds:
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


def read(path: Path, system: System | None = None) -> Read:
    """Everything readable of one traffic.mcap, recorded of this system; of a missing file nothing."""
    reading = Reading(path, system)
    return Read(tuple(reading), reading.whole)


def first(path: Path) -> Record | None:
    """The first record of a recording, which a recorder begins with its setting; None where nothing can be read."""
    return next(iter(Reading(path)), None)


def _kind(topic: str) -> type:
    return _KINDS.get(topic.partition("/")[0], Garbage)

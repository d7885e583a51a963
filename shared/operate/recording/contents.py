"""Contents of a recording without reading its messages: topics and keys with counts and times, and
versions.

Must not know: what a content means, the network.
"""

import hashlib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec
from mcap.records import Channel, Footer, Header, McapRecord, Message, Metadata, Schema

from fipa_codec.communicate import UNREADABLE
from operate.file_names import TRAFFIC_FILE
from operate.recording.index import CONTENTS, NOTE, REPAIRED, TORN, NoRecordingError, stored
from operate.system import System

PROJECT = "robot-companion"
DIGITS = 12
"""Digits of a design's digest: enough to tell two designs apart."""


class Counted(msgspec.Struct):
    """A topic, or a key of it: messages, their bytes, when the first and the last was heard [unix
    s].

    Of a topic also its schema, and its keys: what stands on the router's keys behind the system's
    name.
    """

    name: str
    count: int = 0
    bytes: int = 0
    first: float = 0.0
    last: float = 0.0
    schema: str = ""
    keys: dict[str, "Counted"] = {}

    def add(self, at: float, size: int) -> None:
        """Count a message."""
        self.first = min(self.first, at) if self.count else at
        self.last = max(self.last, at)
        self.count += 1
        self.bytes += size


class Contents(msgspec.Struct):
    """A recording: its size, whether it was closed in order, topics, who wrote it, further notes in
    it.

    `versions`: of file format, writer and recorder; `design`: digest of the design's file that the
    recorder had.
    """

    file: str
    bytes: int
    whole: bool
    topics: list[Counted]
    versions: dict[str, str]
    notes: dict[str, dict[str, str]]

    @property
    def span(self) -> tuple[float, float]:
        """Times at which the first and the last message were heard; zeros without any."""
        heard = [one for one in self.topics if one.count]
        return min((one.first for one in heard), default=0.0), max(
            (one.last for one in heard), default=0.0
        )


class _Key(msgspec.Struct):
    """The fields used of a record: the parts of its key, whatever kind it is."""

    channel: str = ""
    sender: str = ""
    receiver: str = ""
    protocol: str = ""
    performative: str = ""
    kind: str = ""
    owner: str = ""
    peer: str = ""
    agent: str = ""
    key: str = ""

    def words(self) -> str:
        """Return the key as it was on the router, behind the system's name."""
        if self.channel:
            return (
                f"{self.channel}/{self.sender}/{self.receiver}/{self.protocol}/{self.performative}"
            )
        if self.kind:
            return "/".join(filter(None, ("_", self.kind, self.owner, self.peer)))
        return self.key or (f"_/alive/{self.agent}" if self.agent else "")


_decoder = msgspec.json.Decoder(_Key)


def versions_now(system: System) -> dict[str, str]:
    """Return what a recorder notes of itself: the version that is installed, the system, a digest
    of its design.
    """
    try:
        installed = version(PROJECT)
    except PackageNotFoundError:
        installed = "not installed"
    name, design = system.design.file.system.name, digest(system.design.text)
    return {"version": installed, "system": name, "design": design, CONTENTS: str(system.contents)}


def digest(text: str) -> str:
    """Return some digits by which two texts are told apart."""
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def contents(file: Path) -> Contents:
    """Return what is in a recording, or in the one of a run folder. Raise NoRecordingError."""
    path = file / TRAFFIC_FILE if file.is_dir() else file
    if not path.is_file():
        raise NoRecordingError(path, "is not there")
    told = Contents(str(path), path.stat().st_size, False, [], {}, {})
    with path.open("rb") as opened:
        try:
            _count(stored(opened), told)
        except TORN:
            told.whole = False
    if not told.versions:
        raise NoRecordingError(path, "holds no record that can be read")
    told.topics.sort(key=lambda one: one.name)
    return told


def _count(records: Iterator[McapRecord], told: Contents) -> None:
    topics: dict[int, Counted] = {}
    schemas: dict[int, str] = {}
    for found in records:
        match found:
            case Header():
                told.versions |= {"format": found.profile, "library": found.library}
            case Channel() if found.id not in topics:  # the summary at the end repeats them
                topics[found.id] = Counted(
                    found.topic, schema=schemas.get(found.schema_id, found.message_encoding)
                )
                told.topics.append(topics[found.id])
            case Message() if found.channel_id in topics:
                _add(topics[found.channel_id], found)
            case Metadata(name=name) if name == NOTE:
                told.versions |= found.metadata
            case Metadata():
                told.notes[found.name] = found.metadata
            case Footer():
                told.whole = REPAIRED not in told.notes
            case Schema():
                schemas[found.id] = found.name


def _add(topic: Counted, message: Message) -> None:
    at, size = message.log_time / 1e9, len(message.data)
    topic.add(at, size)
    try:
        words = _decoder.decode(message.data).words()
    except UNREADABLE:  # cut off, or of another version: counted all the same
        return
    if words:
        topic.keys.setdefault(words, Counted(words)).add(at, size)

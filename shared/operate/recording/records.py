"""Records of the monitor in traffic.mcap: one Struct per topic, in JSON that any MCAP reader can
show.

A communicate is recorded with its fields, its whole bytes and its two times; what is none is
recorded as it came. Must not know: where records come from, what is made of them.
"""

from contextlib import suppress
from enum import StrEnum
from functools import cached_property
from typing import Any, TypeVar

import msgspec

from agent_runtime.core.wiring import HOUSE, life, parse_life, service_key
from agent_runtime.io.tap import Sample
from fipa_codec.communicate import UNREADABLE, Communicate, decode, decode_strictly, encode
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind, Languages
from operate.fault_lines import Fault
from operate.live_lines import Sent
from operate.system import System
from topdown.model.design import Design

GARBAGE_BYTES = 64 * 1024
"""Number of bytes kept of a sample that is not a communicate; estimate: enough to see what it
was.
"""
SETTING = "setting"
"""Kind of the recorder's own first record."""
HEARTBEAT = "state"
"""Kind of what an agent tells each second."""
FAULT, OPERATOR = "fault", "operator"
"""Kind and owner of the records of faults; nobody says them on a key."""
RECORDED = "recorded"
"""Stands in the keys of records, which do not keep the system's name."""

T = TypeVar("T")
Identity = tuple[str, str, str]
"""Sender, receiver and id of a communicate: its copies share it."""


class Origin(StrEnum):
    """The agent whose log has a communicate."""

    RECEIVER = "receiver"
    SENDER = "sender"
    """Nobody took it, or its receiver keeps no log."""

    @classmethod
    def _missing_(cls, value: object) -> "Origin | None":
        """Recordings of older versions name the listener that heard it."""
        return cls.RECEIVER if value in ("tap", "steps") else None


class NotReadable(RuntimeError):
    """The content of a record was asked for, and nobody said in which languages it is."""

    def __init__(self) -> None:
        super().__init__(
            "the content cannot be read: give mcap_file.read the system, or call Spoken.read_in"
        )


class Spoken(msgspec.Struct, frozen=True, dict=True):
    """A communicate. Times in unix seconds: when it was sent, and when its receiver took it
    (nobody: when it was sent).

    `wire`: its bytes (base64 in JSON), `size`: their number. The content is not in `wire` if nobody
    took it, or if it is large: then the log of its receiver alone has it.

    `text`: its content in a few words, for viewers; "" in recordings of older versions. The content
    can be read once `read_in` was told the languages of its system.
    """

    size: int
    sender: str
    receiver: str
    performative: str
    protocol: str
    language: str
    conversation: str
    channel: str
    id: str
    sent: float
    received: float
    wire: bytes
    origin: Origin = Origin.RECEIVER
    text: str = ""

    @property
    def lost(self) -> bool:
        """Whether its content is not here."""
        return self.size > len(self.wire)

    @cached_property
    def communicate(self) -> Communicate:
        """All of its fields, with its content undecoded."""
        return decode(self.wire)

    @property
    def content(self) -> Any:
        """Return the content, an object of its language; None without content, or if it cannot be
        read.
        """
        return self._read[0]

    @property
    def kind(self) -> Kind:
        """Return the use that its content makes of its performative."""
        return self._read[1]

    @property
    def known(self) -> tuple[Any, Kind]:
        """Content and kind, where they were read already; (None, plain) where not."""
        found: tuple[Any, Kind] = self.__dict__.get("_read", (None, Kind.PLAIN))
        return found

    def read_in(self, languages: Languages | None) -> "Spoken":
        """The same communicate, whose content is read in these languages."""
        self.__dict__["languages"] = languages
        return self

    @cached_property
    def _read(self) -> tuple[Any, Kind]:
        if "languages" not in self.__dict__:
            raise NotReadable
        try:
            communicate = self.communicate
        except FipaError:
            return None, Kind.PLAIN
        return read_content(communicate, self.__dict__["languages"])

    def bare(self) -> "Spoken":
        """The same communicate without its content, which the log of its receiver has."""
        wire = encode(msgspec.structs.replace(self.communicate, content=msgspec.UNSET))
        return msgspec.structs.replace(self, wire=wire).read_in(self.__dict__.get("languages"))

    def sized(self, size: int) -> "Spoken":
        """The same communicate, of which more bytes were sent than are known."""
        return msgspec.structs.replace(self, size=size).read_in(self.__dict__.get("languages"))

    @property
    def identity(self) -> Identity:
        """Return the key shared by re-sent copies: ids are numbers of a stream, or names chosen by
        the sender.
        """
        return self.sender, self.receiver, self.id


class House(msgspec.Struct, frozen=True):
    """Traffic beside communicates (`kind`: receipt, ping, telemetry, ...) from `owner`, perhaps to
    `peer`.
    """

    kind: str
    owner: str
    peer: str
    received: float
    data: bytes


class Setting(msgspec.Struct, frozen=True):
    """Settings with which the fleet was started: `speed` "1" or "max"; `scene`: its file, "" for
    the canonical one.
    """

    seed: int
    speed: str
    scene: str = ""


class Token(msgspec.Struct, frozen=True):
    """The liveliness token of an agent's incarnation appeared or vanished; `journal`: the name of
    its journal.

    `noted`: the agent's own log tells that this life began.
    """

    agent: str
    incarnation: int
    alive: bool
    received: float
    journal: str = ""
    noted: bool = False


class Garbage(msgspec.Struct, frozen=True):
    """Bytes that are not a communicate, or not the one their key says, or one the design does not
    have.

    `log`: the agent that it reached. Its log does not keep bytes that are not a communicate, only
    the reason.
    """

    key: str
    size: int
    reason: str
    received: float
    data: bytes
    log: str = ""


class Unpaired(msgspec.Struct, frozen=True):
    """A communicate of which the logs of sender and receiver do not agree: the receiver took it at
    `received`, and the sender did not say it, or (`altered`) said other words.
    """

    sender: str
    receiver: str
    protocol: str
    performative: str
    conversation: str
    id: str
    altered: bool
    why: str
    received: float


Record = Spoken | House | Token | Garbage | Unpaired


def understood(sample: Sample, system: System) -> Record:
    """The record of a sample heard in this system. Never raises: what cannot be read is garbage."""
    chunks = sample.key.split("/")
    if len(chunks) > 3 and chunks[2] == HOUSE:
        return _house(sample, chunks[3:])
    try:
        communicate = decode_strictly(sample.data)
    except FipaError as error:
        return _garbage(sample, str(error))
    one = communicate
    told = (one.sender, one.receiver, one.protocol, str(one.performative))
    if tuple(chunks[3:]) != told:
        return _garbage(sample, f"the communicate says {'/'.join(told)}")
    try:
        channel = system.design.rule(communicate).channel
    except LookupError as error:
        return _garbage(sample, str(error))
    if chunks[2] != channel:
        return _garbage(sample, f"the design has it on {channel}")
    record = spoken(communicate, sample.data, sample.at, system)
    return record.sized(sample.size) if sample.size > len(sample.data) else record


def spoken(
    communicate: Communicate,
    wire: bytes,
    received: float,
    system: System,
    origin: Origin = Origin.RECEIVER,
    *,
    words: bool = True,
) -> Spoken:
    """The record of a communicate that the design knows, with its content in a few `words`. Raise
    LookupError for another one.
    """
    content = read_content(communicate, system.languages)
    one = communicate
    told = Spoken(
        size=len(wire),
        sender=one.sender,
        receiver=one.receiver,
        performative=str(one.performative),
        protocol=one.protocol,
        language=one.language,
        conversation=one.conversation,
        channel=system.design.rule(one).channel,
        id=one.id,
        sent=one.sent,
        received=received,
        wire=wire,
        origin=origin,
        text=system.words(content[0]) if words else "",
    ).read_in(system.languages)
    # what was decoded is not decoded again
    told.__dict__.update(communicate=communicate, _read=content)
    return told


def read_content(one: Communicate, languages: Languages | None) -> tuple[Any, Kind]:
    """The content of a communicate and its kind; None without content, or if it cannot be read."""
    try:
        return languages.read(one) if languages is not None else (None, Kind.PLAIN)
    except FipaError:
        return None, Kind.PLAIN


def _house(sample: Sample, chunks: list[str]) -> Record:
    kind, *rest = chunks
    if sample.token:
        found = parse_life(rest[1]) if len(rest) == 2 else None
        if found is not None:
            return Token(rest[0], found[0], not sample.gone, sample.at, found[1])
        return _garbage(sample, "a token is alive/<agent>/<incarnation>.<journal>")
    if not rest or len(rest) > 2:
        return _garbage(sample, "a house key is _/<kind>/<owner>[/<peer>]")
    return House(kind, rest[0], rest[1] if len(rest) == 2 else "", sample.at, sample.data)


def _garbage(sample: Sample, reason: str) -> Garbage:
    return Garbage(sample.key, len(sample.data), reason, sample.at, sample.data[:GARBAGE_BYTES])


def fault_in(record: Record) -> Fault | None:
    """Return the fault that a record tells of; None for any other record."""
    return _told_by_house(record, FAULT, Fault)


def setting_in(record: Record) -> Setting | None:
    """Return the setting of the fleet, if this is the record of it."""
    return _told_by_house(record, SETTING, Setting)


def _told_by_house(record: Record, kind: str, told: type[T]) -> T | None:
    if isinstance(record, House) and record.kind == kind:
        with suppress(*UNREADABLE):
            return msgspec.json.decode(record.data, type=told)
    return None


def communicate_in(record: Record) -> Communicate | None:
    """Return the communicate of a record, also of one that the design does not have; None where it
    is none.
    """
    if isinstance(record, Spoken):
        return record.communicate
    try:
        return decode_strictly(record.data) if isinstance(record, Garbage) else None
    except FipaError:
        return None


# --- A record as the sample that it was made of, to look at or to replay --------------------------


def sampled(record: Record, design: Design, system: str = RECORDED) -> Sample | None:
    """Return a record as a sample, on keys of this system; None for what nobody said (Unpaired)."""
    at = record.received
    match record:
        case Spoken():
            size = record.size if record.lost else 0
            key = key_of(record, design.file.system.key, system)
            return Sample(key, record.wire, at, size=size)
        case Garbage(data=b"", reason=reason):
            return Sample(record.key, b"", at, broken=reason)
        case Garbage():
            return Sample(record.key, record.data, at)
        case Token():
            own = life(record.incarnation, record.journal)
            key = service_key(system, "alive", record.agent, own)
            return Sample(key, b"", at, token=True, gone=not record.alive)
        case House():
            peer = (record.peer,) if record.peer else ()
            return Sample(service_key(system, record.kind, record.owner, *peer), record.data, at)
        case Unpaired():
            return None


def key_of(one: Spoken | Sent, form: str, system: str = RECORDED) -> str:
    """The key a recorded communicate was put on; `form`: how the design writes keys."""
    names = ("channel", "sender", "receiver", "protocol", "performative")
    return form.format(system=system, **{name: getattr(one, name) for name in names})

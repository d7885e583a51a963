"""The unsynced log of steps in the run folder: what came in, when, what went out to whom, and a hash of it.

It replays an agent to the same bytes: each life begins with the journal record it started from. The logs of all agents
are the record of a run: a communicate is in the log of its receiver, and its sender's log has all of it but the
content. The log is never synced: a kill -9 takes at most the lines of the last milliseconds. A line is
<length u32><msgpack array>, and behind it the content of the communicate that came, where that is much; a torn last
line is ignored.
"""

import hashlib
import struct
import zlib
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Annotated, Any

import msgspec

from agent_runtime.core import events
from agent_runtime.core.effects import Deed, Effects
from agent_runtime.core.errors import StepLogError
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.io.full_disk import worded
from fipa_codec.communicate import UNREADABLE, Communicate, encode

HEAD = struct.Struct("<I")
BULK = struct.Struct("<II")
MUCH_BYTES = 64 * 1024  # estimate: blake2b needs 80 us for that
BUFFER_BYTES = 4 * 1024 * 1024
"""Of lines that wait in memory for `flush`; estimate: some of the largest messages (852 kB), a wait of 1 to 10 ms."""
MOST_BYTES = 1024 * 1024 * 1024
"""Of a log; then no more steps are logged. Estimate: 200 B a step, so some days; a pour writes 3 MB in a minute."""
BOOT = "boot"
NOTHING = msgspec.Raw()
"""The end mark of a line whose input is whole."""


class Said(msgspec.Struct, frozen=True, array_like=True):
    """A communicate that a step said: without its content, unless its receiver keeps no log.

    `size`: of the whole communicate [bytes]; `check`: CRC-32 of the content, 0 without one.
    """

    communicate: Communicate
    size: int
    check: int = 0


class Step(msgspec.Struct, frozen=True, array_like=True):
    """`kind`: the event's class, or "boot" with the record a life starts from as input. `output`: 8 bytes of hash.

    `deed`: what was done, in the words of the design; None where no event reached the behaviour. `apart`: bytes of the
    content that stand behind the line instead of in `input`; 0 in what `read` gives. `took`: sender and id of the
    communicate that the behaviour saw, which may have come in an earlier step; "" for none, and in logs of older
    versions. `parents`: as in Effects. `said`: what the step said, with its time as `sent`; None in logs of older
    versions.
    """

    incarnation: int
    step: int
    at: float
    kind: str
    input: bytes
    output: bytes = b""
    deed: Deed | None = None
    apart: Annotated[int, msgspec.Meta(ge=0)] = 0
    took: str = ""
    parents: tuple[tuple[str, str], ...] = ()
    said: tuple[Said, ...] | None = None


_encoder = msgspec.msgpack.Encoder(enc_hook=repr)
_decoder = msgspec.msgpack.Decoder(Step)


def fingerprint(effects: Effects) -> bytes:
    """A hash of everything a step put out: record, receipts, communicates, words to the devices.

    It is to tell two runs apart, not to withstand anybody: of much a checksum (a fifth of the time) and the length do.
    """
    parted = [_parted(one) for one in effects.sends]
    sends = [(one, len(content), zlib.crc32(content)) if content else one for one, content in parted]
    data = _encoder.encode((effects.record, effects.receipts, sends, effects.tells))
    if len(data) > MUCH_BYTES:
        return BULK.pack(len(data), zlib.crc32(data))
    return hashlib.blake2b(data, digest_size=8).digest()


def noted(
    incarnation: int,
    step: int,
    at: float,
    event: events.AnyEvent,
    effects: Effects,
    seen: Communicate | None = None,
    sizes: Sequence[int] | None = None,
    without_log: Container[str] = (),
) -> tuple[Step, msgspec.Raw]:
    """One step of the core as it is written, and the content that stands behind it.

    `seen`: the communicate that the behaviour saw. `sizes`: bytes of each communicate that was sent. `without_log`:
    receivers that keep no log.
    """
    content, took = NOTHING, "" if seen is None else f"{seen.sender} {seen.id}"
    if isinstance(event, events.Arrived):
        bare, content = _parted(event.communicate)
        event = msgspec.structs.replace(event, communicate=bare)
    kind, data = type(event).__name__, _encoder.encode(event)
    hashed = fingerprint(effects)
    sizes = [len(encode(one)) for one in effects.sends] if sizes is None else sizes
    said = tuple(_said(one, size, without_log) for one, size in zip(effects.sends, sizes, strict=True))
    return Step(
        incarnation, step, at, kind, data, hashed, effects.deed, len(content), took, effects.parents, said
    ), content


def _said(one: Communicate, size: int, without_log: Container[str]) -> Said:
    bare, check = checked(one)
    return Said(one if one.receiver in without_log else bare, size, check)


def checked(one: Communicate) -> tuple[Communicate, int]:
    """Return a communicate without its content, and the CRC-32 of that; 0 without one."""
    if one.content is msgspec.UNSET:
        return one, 0
    return msgspec.structs.replace(one, content=msgspec.UNSET), zlib.crc32(one.content)


def _parted(communicate: Communicate) -> tuple[Communicate, msgspec.Raw]:
    """Without its content, and that, where it is much: who asks next waits for each copy. Else itself, and nothing."""
    content = communicate.content
    if content is msgspec.UNSET or len(content) <= MUCH_BYTES:
        return communicate, NOTHING
    return msgspec.structs.replace(communicate, content=msgspec.UNSET), content


def _joined(step: Step, content: bytes) -> Step:
    """A step whose input has its content again."""
    arrived = msgspec.msgpack.decode(step.input, type=events.Arrived)
    whole = msgspec.structs.replace(arrived.communicate, content=msgspec.Raw(content))
    arrived = msgspec.structs.replace(arrived, communicate=whole)
    return msgspec.structs.replace(step, input=_encoder.encode(arrived), apart=0)


class StepLog:
    """The open log of one agent; `waiting`: bytes that are not in the file yet.

    While the disk takes nothing, lines wait up to BUFFER_BYTES; those beyond are `lost`, and `trouble` says why.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._file = path.open("ab", buffering=BUFFER_BYTES)
        self.waiting = self.lost = 0
        self.trouble = ""
        self._size = path.stat().st_size

    @property
    def full(self) -> bool:
        """Whether nothing more is logged."""
        return self._size >= MOST_BYTES

    def boot(self, incarnation: int, record: bytes, now: float) -> None:
        """A life begins from this record; that of a first one has incarnation 0, and the name of its journal."""
        self.write([(Step(incarnation, 0, now, BOOT, record), NOTHING)])
        self.flush()

    def write(self, steps: Iterable[tuple[Step, msgspec.Raw]]) -> None:
        """Steps of the core, into the file at the next flush, or before it where they are too many to wait.

        Nothing is left of a line for a later write but of one that is longer than BUFFER_BYTES.
        """
        for step, content in steps:
            if self.full:
                return
            line = _encoder.encode(step)
            size = HEAD.size + len(line) + len(content)
            if self.waiting + size > BUFFER_BYTES:
                self.flush()
            if self.trouble and self.waiting + size > BUFFER_BYTES:
                self.lost += 1
                continue
            self._file.writelines((HEAD.pack(len(line)), line, content))
            self.waiting += size
            self._size += size

    def flush(self) -> None:
        """All that waits into the file, or `trouble` says why not."""
        try:
            self._file.flush()
        except OSError as error:
            self.trouble = worded(self._file.name, error)
            return
        self.waiting, self.trouble = 0, ""

    def close(self) -> None:
        """Close the file; what it cannot take is lost."""
        with suppress(OSError):
            self._file.close()


class Reader:
    """Reads a log from `at` [bytes] on, also while it is written: `new` goes on where the last call ended."""

    def __init__(self, path: Path, at: int = 0) -> None:
        self.path, self.at = path, at

    def new(self) -> Iterator[Step]:
        """The whole lines since the last call; a line is read once it is yielded. Raise StepLogError for one that is
        none, OSError.
        """
        if self.path.stat().st_size <= self.at:
            return
        with self.path.open("rb") as file:
            file.seek(self.at)
            while (found := self._line(file)) is not None:
                step, self.at = found
                yield step

    def _line(self, file: IO[bytes]) -> tuple[Step, int] | None:
        """Return the next step and the offset behind it; None where there is no whole one."""
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        (length,) = HEAD.unpack(head)
        body = file.read(length)
        if len(body) < length:
            return None
        try:
            step = _decoder.decode(body)
            content = file.read(step.apart)
            if len(content) < step.apart:
                return None
            return _joined(step, content) if step.apart else step, self.at + HEAD.size + length + step.apart
        except UNREADABLE as error:
            raise StepLogError(self.path, self.at, str(error)) from error


def read(path: Path) -> Iterator[Step]:
    """All whole lines of a log. Raise StepLogError for one that is none; a torn last line is left out."""
    return Reader(path).new()


def deeds(folder: Path) -> list[tuple[str, Deed]]:
    """Return (agent, deed) of all agents whose logs AGENT.steps lie in a folder, in an order in which it can have been.

    An agent's steps stay in their order, and what is taken was said before; the rest is put in order by time. Time
    alone does not do: clocks of two hosts differ, and one may be set back.
    """
    logs = {path.stem: list(read(path)) for path in sorted(folder.glob("*.steps"))}
    return [(agent, step.deed) for agent, step in _in_order(logs) if step.deed is not None]


def _in_order(logs: dict[str, list[Step]]) -> Iterator[tuple[str, Step]]:
    said_at = {(agent, step.at): place for agent, steps in logs.items() for place, step in enumerate(steps)}
    causes = {agent: _causes(steps, said_at) for agent, steps in logs.items()}
    begun = dict.fromkeys(logs, 0)
    while left := [agent for agent, steps in logs.items() if begun[agent] < len(steps)]:
        heads = {agent: (logs[agent][begun[agent]], causes[agent][begun[agent]]) for agent in left}
        free = [agent for agent, (_, cause) in heads.items() if cause is None or cause[1] < begun[cause[0]]]
        agent = min(free or left, key=lambda one: heads[one][0].at)
        yield agent, heads[agent][0]
        begun[agent] += 1


def _causes(steps: list[Step], said_at: dict[tuple[str, float], int]) -> list[tuple[str, int] | None]:
    """Return for each step the agent and place of the one that said what it took; None where no log shows it."""
    came: dict[str, tuple[str, float]] = {}
    causes: list[tuple[str, int] | None] = []
    for step in steps:
        if step.kind == events.Arrived.__name__ and step.input:
            with suppress(msgspec.MsgspecError):  # a recorded history may have been cut to its deeds
                one = msgspec.msgpack.decode(step.input, type=events.Arrived).communicate
                came.setdefault(f"{one.sender} {one.id}", (str(one.sender), one.sent))
        source = came.get(step.took)
        causes.append((source[0], said_at[source]) if source in said_at else None)
    return causes


def replay(core: Core[Any], steps: Iterator[Step]) -> Iterator[tuple[Step, Effects]]:
    """Run a core through a log: each step with its effects now; compare `fingerprint(effects)` with `step.output`."""
    state = core.boot(None)
    for step in steps:
        if step.kind == BOOT:
            state = booted(core, step.input)
            continue
        state, effects = core.step(state, _event(core, step), step.at)
        yield step, effects


def booted(core: Core[Any], record: bytes) -> CoreState:
    """Return the state in which a life of the log begins; a first one with the memory that the code gives it now."""
    if not record:
        return core.boot(None)
    begun = msgspec.msgpack.decode(record, type=_Begun)
    return core.boot(record if begun.incarnation else core.first(begun.journal))


def journal_of(record: bytes) -> str:
    """Return the name of the journal that a life of the log begins with. Raise msgspec.MsgspecError for no record."""
    return msgspec.msgpack.decode(record, type=_Begun).journal if record else ""


class _Begun(msgspec.Struct):
    incarnation: int
    journal: str = ""


def _event(core: Core[Any], step: Step) -> events.AnyEvent:
    kind = getattr(events, step.kind)
    if kind is not events.Local:
        event: events.AnyEvent = msgspec.msgpack.decode(step.input, type=kind)
        return event
    content = msgspec.msgpack.decode(step.input, type=_RawLocal).content
    return events.Local(msgspec.msgpack.decode(content, type=core.agent.local))


class _RawLocal(msgspec.Struct, tag="Local"):
    content: msgspec.Raw

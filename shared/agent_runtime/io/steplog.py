"""The unsynced log of steps in the run folder: what came in, when, what went out to whom, and a
hash of it.

It replays an agent to the same bytes: each life begins with the journal record it started from. The
logs of all agents are the record of a run: a communicate is in the log of its receiver, and its
sender's log has all of it but the content. The log is never synced: a kill -9 takes at most the
lines of the last milliseconds. A line is <length u32><msgpack array>, and behind it the content of
the communicate that came, where that is much; a torn last line is ignored.
"""

import hashlib
import struct
import sys
import threading
import time
import zlib
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Annotated, Any

import msgspec

from agent_runtime.core import events
from agent_runtime.core.agent import Agent
from agent_runtime.core.errors import StepLogError
from agent_runtime.core.events import AnyEvent, Arrived, Deed, Effects, Receipt, Received
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.core.wiring import Delivery, Wiring
from agent_runtime.io.journal import worded
from agent_runtime.io.logs import Log
from fipa_codec.communicate import UNREADABLE, Communicate, encode
from fipa_codec.errors import FipaError

HEAD = struct.Struct("<I")
BULK = struct.Struct("<II")
MUCH_BYTES = 64 * 1024  # estimate: blake2b needs 80 us for that
BUFFER_BYTES = 4 * 1024 * 1024
"""Of lines that wait in memory for `flush`; estimate: some of the largest messages (852 kB), a wait
of 1 to 10 ms.
"""
MOST_BYTES = 1024 * 1024 * 1024
"""Of a log; then no more steps are logged. Estimate: 200 B a step, so some days; a pour writes 3 MB
in a minute.
"""
BOOT = "boot"
NOTHING = msgspec.Raw()
"""The end mark of a line whose input is whole."""


class SentMessage(msgspec.Struct, frozen=True, array_like=True):
    """A communicate that a step said: without its content, unless its receiver keeps no log.

    `size`: of the whole communicate [bytes]; `check`: CRC-32 of the content, 0 without one.
    """

    communicate: Communicate
    size: int
    check: int = 0


class Step(msgspec.Struct, frozen=True, array_like=True):
    """`kind`: the event's class, or "boot" with the record a life starts from as input. `output`: 8
    bytes of hash.

    `deed`: what was done, in the words of the design; None where no event reached the behaviour.
    `apart`: bytes of the content that stand behind the line instead of in `input`; 0 in what `read`
    gives. `took`: sender and id of the communicate that the behaviour saw, which may have come in
    an earlier step; "" for none, and in logs of older versions. `parents`: as in Effects. `said`:
    what the step said, with its time as `sent`; None in logs of older versions.
    """

    incarnation: int
    step: int
    at: float
    kind: str
    input: bytes
    output: bytes = b""
    deed: Deed | None = None
    apart: Annotated[int, msgspec.Meta(ge=0, lt=2**32)] = 0
    took: str = ""
    parents: tuple[tuple[str, str], ...] = ()
    said: tuple[SentMessage, ...] | None = None


_encoder = msgspec.msgpack.Encoder(enc_hook=repr)
_decoder = msgspec.msgpack.Decoder(Step)


def fingerprint(effects: Effects) -> bytes:
    """A hash of everything a step put out: record, receipts, communicates, words to the devices.

    It is to tell two runs apart, not to withstand anybody: of much a checksum (a fifth of the time)
    and the length do.
    """
    parted = [_without_content(one) for one in effects.sends]
    sends = [
        (one, len(content), zlib.crc32(content)) if content else one for one, content in parted
    ]
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

    `seen`: the communicate that the behaviour saw. `sizes`: bytes of each communicate that was
    sent. `without_log`: receivers that keep no log.
    """
    content, took = NOTHING, "" if seen is None else f"{seen.sender} {seen.id}"
    if isinstance(event, events.Arrived):
        bare, content = _without_content(event.communicate)
        event = msgspec.structs.replace(event, communicate=bare)
    kind, data = type(event).__name__, _encoder.encode(event)
    hashed = fingerprint(effects)
    sizes = [len(encode(one)) for one in effects.sends] if sizes is None else sizes
    said = []
    for one, size in zip(effects.sends, sizes, strict=True):
        bare, check = checked(one)
        said.append(SentMessage(one if one.receiver in without_log else bare, size, check))
    return (
        Step(
            incarnation,
            step,
            at,
            kind,
            data,
            hashed,
            effects.deed,
            len(content),
            took,
            effects.parents,
            tuple(said),
        ),
        content,
    )


def checked(one: Communicate) -> tuple[Communicate, int]:
    """A communicate without its content, and the CRC-32 of that; 0 without one."""
    if one.content is msgspec.UNSET:
        return one, 0
    return msgspec.structs.replace(one, content=msgspec.UNSET), zlib.crc32(one.content)


def _without_content(communicate: Communicate) -> tuple[Communicate, msgspec.Raw]:
    """Without its content, and that, where it is much: who asks next waits for each copy. Else
    itself, and nothing.
    """
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

    While the disk takes nothing, lines wait up to BUFFER_BYTES; those beyond are `lost`, and
    `trouble` says why.
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
        """A life begins from this record; that of a first one has incarnation 0, and the name of
        its journal.
        """
        self.write([(Step(incarnation, 0, now, BOOT, record), NOTHING)])
        self.flush()

    def write(self, steps: Iterable[tuple[Step, msgspec.Raw]]) -> None:
        """Steps of the core, into the file at the next flush, or before it where they are too many
        to wait.

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
    """Reads a log from `at` [bytes] on, also while it is written: `new` goes on where the last call
    ended.
    """

    def __init__(self, path: Path, at: int = 0) -> None:
        self.path, self.at = path, at

    def new(self) -> Iterator[Step]:
        """The whole lines since the last call; a line is read once it is yielded. Raise
        StepLogError for one that is none, OSError.
        """
        if self.path.stat().st_size <= self.at:
            return
        with self.path.open("rb") as file:
            file.seek(self.at)
            while (found := self._line(file)) is not None:
                step, self.at = found
                yield step

    def _line(self, file: IO[bytes]) -> tuple[Step, int] | None:
        """The next step and the offset behind it; None where there is no whole one."""
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
            end = self.at + HEAD.size + length + step.apart
            return (_joined(step, content) if step.apart else step), end
        except UNREADABLE as error:
            raise StepLogError(self.path, self.at, str(error)) from error


def read(path: Path) -> Iterator[Step]:
    """All whole lines of a log. Raise StepLogError for one that is none; a torn last line is left
    out.
    """
    return Reader(path).new()


def deeds(folder: Path) -> list[tuple[str, Deed]]:
    """(agent, deed) of all agents whose logs AGENT.steps lie in a folder, in an order in which it
    can have been.

    An agent's steps stay in their order, and what is taken was said before; the rest is put in
    order by time. Time alone does not do: clocks of two hosts differ, and one may be set back.
    """
    logs = {path.stem: list(read(path)) for path in sorted(folder.glob("*.steps"))}
    return [(agent, step.deed) for agent, step in _in_order(logs) if step.deed is not None]


def _in_order(logs: dict[str, list[Step]]) -> Iterator[tuple[str, Step]]:
    said_at = {
        (agent, step.at): place for agent, steps in logs.items() for place, step in enumerate(steps)
    }
    causes = {agent: _causes(steps, said_at) for agent, steps in logs.items()}
    begun = dict.fromkeys(logs, 0)
    while left := [agent for agent, steps in logs.items() if begun[agent] < len(steps)]:
        heads = {agent: (logs[agent][begun[agent]], causes[agent][begun[agent]]) for agent in left}
        free = [
            agent
            for agent, (_, cause) in heads.items()
            if cause is None or cause[1] < begun[cause[0]]
        ]
        agent = min(free or left, key=lambda one: heads[one][0].at)
        yield agent, heads[agent][0]
        begun[agent] += 1


def _causes(
    steps: list[Step], said_at: dict[tuple[str, float], int]
) -> list[tuple[str, int] | None]:
    """For each step the agent and place of the one that said what it took; None where no log shows
    it.
    """
    came: dict[str, tuple[str, float]] = {}
    causes: list[tuple[str, int] | None] = []
    for step in steps:
        if step.kind == events.Arrived.__name__ and step.input:
            # a recorded history may have been cut to its deeds
            with suppress(msgspec.MsgspecError):
                one = msgspec.msgpack.decode(step.input, type=events.Arrived).communicate
                came.setdefault(f"{one.sender} {one.id}", (str(one.sender), one.sent))
        source = came.get(step.took)
        causes.append((source[0], said_at[source]) if source in said_at else None)
    return causes


def replay(core: Core[Any], steps: Iterator[Step]) -> Iterator[tuple[Step, Effects]]:
    """Run a core through a log: each step with its effects now; compare `fingerprint(effects)` with
    `step.output`.
    """
    state = core.boot(None)
    for step in steps:
        if step.kind == BOOT:
            state = booted(core, step.input)
            continue
        state, effects = core.step(state, event_of(core, step), step.at)
        yield step, effects


def event_of(core: Core[Any], step: Step) -> events.AnyEvent:
    """The event that a step took."""
    kind = getattr(events, step.kind)
    if kind is not events.Local:
        event: events.AnyEvent = msgspec.msgpack.decode(step.input, type=kind)
        return event
    content = msgspec.msgpack.decode(step.input, type=_RawLocal).content
    return events.Local(msgspec.msgpack.decode(content, type=core.agent.local))


def booted(core: Core[Any], record: bytes) -> CoreState:
    """The state in which a life of the log begins; a first one with the memory that the code gives
    it now.
    """
    if not record:
        return core.boot(None)
    begun = msgspec.msgpack.decode(record, type=_Begun)
    return core.boot(record if begun.incarnation else core.first(begun.journal))


def journal_of(record: bytes) -> str:
    """The name of the journal that a life of the log begins with. Raise msgspec.MsgspecError for no
    record.
    """
    return msgspec.msgpack.decode(record, type=_Begun).journal if record else ""


class _Begun(msgspec.Struct):
    incarnation: int
    journal: str = ""


class _RawLocal(msgspec.Struct, tag="Local"):
    content: msgspec.Raw


# --- Sender of a step log to a recorder on another host, for as long as that asks for it ----------
# The recorder says how much of the log it has, again and again; from there on the sender puts what
# is in the file, in parts, and what is added to it. So whatever was lost on the way, or was written
# while no recorder was there, is sent once more. A thread of its own: nothing waits for it. It
# rests, without a thread, while nobody asks.


LOG_PART, LOG_WANTED = "steps", "want"
"""Kinds of signals: a part of a log, and that one is wanted."""
OFFSET = struct.Struct("<Q")
"""A place in a log [bytes]: before a part of it; alone, where the recorder has the log up to
there.
"""
PART_BYTES = 256 * 1024
"""Of a part (estimate: 2 ms of a network of 1 Gbit/s)."""
PAUSE_S = 0.1
"""Between two looks at the file (estimate: people see no delay)."""
SENDER_LEASE_S = 5.0
"""So long is sent after it was asked for; five times the recorder's pause between two askings."""


class LogSender:
    """`put` gets each part; it may block."""

    def __init__(self, path: Path, put: Callable[[bytes], None]) -> None:
        self._path, self._put = path, put
        self._lock = threading.Lock()
        self._at = self._asked = -1
        self._until = 0.0
        self._thread: threading.Thread | None = None
        self._over = threading.Event()

    def wanted(self, data: bytes) -> None:
        """A recorder has so much of it. From Zenoh's threads; never blocks. What is no offset is
        ignored.
        """
        if len(data) != OFFSET.size:
            return
        (there,) = OFFSET.unpack(data)
        with self._lock:
            self._until = time.monotonic() + SENDER_LEASE_S
            # it has more, or got nothing since it asked before
            if there > self._at or there == self._asked:
                self._at = there
            self._asked = there
            if self._thread is None and not self._over.is_set():
                self._at = there
                self._thread = threading.Thread(target=self._send, name="log sender", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Send no more."""
        self._over.set()
        with self._lock:
            thread = self._thread
        if thread is not None:
            # a put may hang where its cable is cut; the process ends all the same
            thread.join(PAUSE_S)

    def _send(self) -> None:
        while not self._over.is_set():
            with self._lock:
                if time.monotonic() > self._until:
                    self._thread = None
                    return
                at = self._at
            with self._path.open("rb") as file:
                file.seek(at)
                part = file.read(PART_BYTES)
            if not part:
                self._over.wait(PAUSE_S)
                continue
            self._put(OFFSET.pack(at) + part)
            with self._lock:
                if self._at == at:
                    self._at = at + len(part)


# --- An agent run again from its step log, offline: whether each step puts out the bytes that it
# put out then
# A process of the agent does this instead of serving (`--replay LOG`): it runs the code that the
# fleet runs, without a router, devices or a clock. What devices said is in the log.


DIGEST_BYTES = 16


class Put(msgspec.Struct, frozen=True):
    """Output of a step run now. `sends`: as on the wire; `tells`: the words to the devices, as they
    are hashed.
    """

    record: bytes | None
    receipts: tuple[Receipt, ...]
    sends: tuple[bytes, ...]
    tells: bytes
    deed: Deed | None


class Parted(msgspec.Struct, frozen=True):
    """The first step that puts out something else than what the log says.

    `output`: the hash in the log; `deed`: what was done then. `before`: the journal record that was
    written last before it. `now` None: the step could not be run, and `error` says why.
    """

    incarnation: int
    step: int
    at: float
    kind: str
    output: bytes
    deed: Deed | None
    before: bytes
    now: Put | None
    error: str = ""


class SentAgain(msgspec.Struct, frozen=True):
    """A communicate that a step put out: which step, to whom, its id, and what tells its bytes from
    any other.
    """

    incarnation: int
    step: int
    at: float
    kind: str
    receiver: str
    id: str
    digest: bytes


class Again(msgspec.Struct, frozen=True):
    """An agent's lives, run again up to the first difference (`parted`; None: there is none).
    `said`: copies too.
    """

    agent: str
    lives: int
    steps: int
    said: tuple[SentAgain, ...]
    parted: Parted | None


def digest(wire: bytes) -> bytes:
    """What tells a communicate on the wire from any other."""
    return hashlib.blake2b(wire, digest_size=DIGEST_BYTES).digest()


def again(core: Core[Any], path: Path) -> Again:
    """Run all lives in a log up to the first step that differs."""
    at, lives, count, before = Step(0, 0, 0.0, BOOT, b""), 0, 0, b""
    said: list[SentAgain] = []

    def whole() -> Iterator[Step]:
        nonlocal at, lives, before
        for step in read(path):
            was, at = at, step
            if step.kind == BOOT:
                lives += 1
                before = core.record(booted(core, step.input))
            elif (step.incarnation, step.step) != (was.incarnation, was.step + 1):
                raise ValueError(
                    f"the log goes on with step {step.step} of life {step.incarnation}; steps are"
                    " missing"
                )
            yield step

    def parted(now: Put | None, error: str = "") -> Again:
        difference = Parted(
            at.incarnation, at.step, at.at, at.kind, at.output, at.deed, before, now, error
        )
        return Again(core.agent.name, lives, count, tuple(said), difference)

    try:
        for step, effects in replay(core, whole()):
            sends = tuple(encode(one) for one in effects.sends)
            if fingerprint(effects) != step.output:
                tells = _encoder.encode(effects.tells)
                return parted(Put(effects.record, effects.receipts, sends, tells, effects.deed))
            count += 1
            said += [
                SentAgain(
                    step.incarnation,
                    step.step,
                    step.at,
                    step.kind,
                    one.receiver,
                    one.id,
                    digest(wire),
                )
                for one, wire in zip(effects.sends, sends, strict=True)
            ]
            before = before if effects.record is None else effects.record
    # any mistake of the agent's own code is the difference that is looked for
    except Exception as error:
        return parted(None, str(error) or type(error).__name__)
    return Again(core.agent.name, lives, count, tuple(said), None)


def tell(agent: Agent[Any], wiring: Wiring, path: Path) -> int:
    """Print an `Again` in MessagePack; return the exit status."""
    sys.stdout.buffer.write(msgspec.msgpack.encode(again(Core(agent, wiring), path)))
    sys.stdout.flush()
    return 0


# --- Step logs of agents that do not run: of a recording that is said again, and of tests ---------


class StepLogs:
    """The logs of a run folder, AGENT.steps in its folder steps; each line is in its file at
    once.
    """

    def __init__(self, run: Path) -> None:
        self._folder = run / "steps"

    def passed(self, one: Communicate, at: float) -> None:
        """Its sender said it at `sent`, and its receiver took it at `at` [unix s]."""
        self.said(one, one.sent or at)
        self.took(one, at)

    def said(self, one: Communicate, at: float) -> None:
        """Its sender said it."""
        bare, check = checked(one)
        with suppress(FipaError):
            self._note(one.sender, at, events.Next(), (SentMessage(bare, len(encode(one)), check),))

    def took(self, one: Communicate, at: float) -> None:
        """Its receiver took it."""
        self._note(one.receiver, at, events.Arrived(one))

    def garbled(self, key: str, why: str, at: float) -> None:
        """Bytes came on a key that were no communicate."""
        self._note(key.split("/")[4], at, events.Garbled(key, why))

    def boots(self, agent: str, incarnation: int, at: float) -> None:
        """A life of an agent begins."""
        self._write(agent, Step(incarnation, 0, at, BOOT, b""))

    def _note(
        self, agent: str, at: float, event: events.AnyEvent, said: tuple[SentMessage, ...] = ()
    ) -> None:
        kind, data = type(event).__name__, msgspec.msgpack.encode(event)
        self._write(agent, Step(1, 0, at, kind, data, said=said))

    def _write(self, agent: str, step: Step) -> None:
        log = StepLog(self._folder / f"{agent}.steps")
        log.write([(step, NOTHING)])
        log.close()


# --- The record of an agent's steps, written in the next pause ------------------------------------
# Log lines for people, and the step log.
# Nobody waits for it, so nothing of it stands between a message and its answer. A kill -9 takes
# what was not written.


MOST_UNWRITTEN = 64
"""Steps after which logs are written though there is no pause; 6 to 11 us each, warm, for which who
asks next waits.
"""
MOST_HEARD = 512 * 1024
"""Bytes of content in such steps; with more they are copied into the step log's buffer at once.
Else the next message has to take other memory, which is in no cache: 852 kB took 1.50 instead of
1.43 of a get (benchmarks/as_shipped.py).
"""
MOST_SAID = 8 * 1024 * 1024
"""Bytes of communicates in such steps, after which logs are written, too: they wait longer, since
to hash them takes time of those who hear them. Estimate: ten of the largest answers (852 kB).
"""


_Done = tuple[int, int, float, events.AnyEvent, Effects, Communicate | None, list[int]]


class StepRecorder:
    """The steps of one agent that are not written down yet, and where they go."""

    def __init__(self, log: Log, steps: StepLog, wiring: Wiring) -> None:
        self._log, self._steps, self._wiring = log, steps, wiring
        self._unwritten: list[_Done] = []
        """Arguments of `noted`. No decoded content is held: that may be as large as the message and
        is free for the next one at once.
        """
        self._noted = self._heard = self._said = 0

    @property
    def pending(self) -> bool:
        """Whether something is to be written."""
        return bool(self._unwritten) or self._steps.waiting > 0

    @property
    def trouble(self) -> str:
        """The reason why steps are not written down, in words; "" if they are."""
        steps = self._steps
        return f"{steps.trouble}; steps that its log lacks: {steps.lost}" if steps.trouble else ""

    @property
    def full(self) -> bool:
        """Whether it must be written without waiting for a pause."""
        return self._noted >= MOST_UNWRITTEN or self._said >= MOST_SAID

    def note(
        self, event: AnyEvent, at: float, after: CoreState, effects: Effects, sizes: list[int]
    ) -> None:
        """Keep a step in mind; `sizes`: bytes of each communicate sent."""
        received = effects.handled.communicate if isinstance(effects.handled, Received) else None
        rest = msgspec.structs.replace(effects, handled=None)
        self._unwritten.append(
            (after.incarnation, after.soft.step, at, event, rest, received, sizes)
        )
        heard = event.communicate if isinstance(event, Arrived) else received
        content = b"" if heard is None or heard.content is msgspec.UNSET else heard.content
        self._noted += 1
        self._heard += len(content)
        self._said += sum(sizes)
        if self._heard >= MOST_HEARD:
            self._put_down()

    def write(self) -> None:
        self._put_down()
        self._steps.flush()
        self._noted = 0

    def _put_down(self) -> None:
        done, self._unwritten, self._heard, self._said = self._unwritten, [], 0, 0
        lines = [line for one in done for line in self._lines(one)]
        if lines:
            self._log.write_all(lines)
        self._steps.write(noted(*one, self._wiring.groups) for one in done)

    def _lines(self, one: _Done) -> Iterator[tuple[float, str, str, dict[str, Any]]]:
        _, _, at, _, effects, received, sizes = one
        if received is not None:
            yield at, *self._spoken("received", received, 0)
        for line in effects.logs:
            yield at, line.event, line.level, line.fields
        for sent, size in zip(effects.sends, sizes, strict=True):
            yield at, *self._spoken("sent", sent, size)

    def _spoken(
        self, event: str, communicate: Communicate, size: int
    ) -> tuple[str, str, dict[str, Any]]:
        peer = communicate.receiver if event == "sent" else communicate.sender
        link = self._wiring.link(peer, communicate.protocol)
        durable = link is not None and link.delivery is Delivery.DURABLE
        fields = {
            "performative": str(communicate.performative),
            "peer": peer,
            "protocol": communicate.protocol,
            "language": communicate.language,
            "id": communicate.id,
            "bytes": size or None,
            "conversation": communicate.conversation,
        }
        return event, "info" if durable else "debug", fields

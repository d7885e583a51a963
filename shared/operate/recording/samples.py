"""A recording as the samples it was made of, to look at or to replay (`roco`)."""

import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec

from agent_runtime.core.wiring import life, service_key
from agent_runtime.io.tap import Sample
from operate.judging.judged import SYSTEM, key_of
from operate.recording import filled
from operate.recording.records import Garbage, House, Record, Resumed, Spoken, Token
from operate.system import System
from topdown.model.design import Design


def records(file: Path, system: System) -> tuple[Record, ...]:
    """All records of a recording, or of a run folder: there also what only the step logs have.

    Raises NoRecordingError.
    """
    return filled.of(file, system).known


def samples(found: tuple[Record, ...], design: Design, *, everything: bool = False) -> Iterator[Sample]:
    """Samples of a tap, in order; without `everything` communicates, tokens and what was no communicate.

    With it also the recorder's own first word, its setting, as if it had been heard.
    """
    for record in found:
        if everything or not isinstance(record, House):
            yield sampled(record, design)


def sampled(record: Record, design: Design) -> Sample:
    """Return the samples that the tap heard when this was recorded."""
    at = record.received
    match record:
        case Spoken():
            return Sample(key_of(record, design.file.system.key), record.wire, at, log=record.log)
        case Garbage():
            return Sample(record.key, record.data, at, log=record.log)
        case Token():
            key = service_key(SYSTEM, "alive", record.agent, life(record.incarnation, record.journal))
            return Sample(key, b"", at, token=True, gone=not record.alive)
        case House():
            peer = (record.peer,) if record.peer else ()
            return Sample(service_key(SYSTEM, record.kind, record.owner, *peer), record.data, at)
        case Resumed():
            missed = service_key(SYSTEM, "missed", record.sender) if record.sender else ""
            return Sample("", b"", at, deaf_since=record.since, missed=missed)


def main(file: Path, system: System, *, everything: bool) -> None:
    """Print the samples of a recording, one JSON object a line. Raises NoRecordingError."""
    for sample in samples(records(file, system), system.design, everything=everything):
        sys.stdout.buffer.write(msgspec.json.encode(sample) + b"\n")

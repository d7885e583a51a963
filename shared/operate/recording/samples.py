"""A recording as the samples it was made of, to look at or to replay (`roco`)."""

import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec

from agent_runtime.core.wiring import life, service_key
from agent_runtime.io.tap import Sample
from operate.judging.judged import SYSTEM, key_of
from operate.recording import reading
from operate.recording.records import Garbage, House, Record, Spoken, Token, Unpaired
from operate.system import System
from topdown.model.design import Design


def samples(found: tuple[Record, ...], design: Design, *, everything: bool = False) -> Iterator[Sample]:
    """Records as samples, in order; without `everything` communicates, tokens and what was no communicate.

    With it also the recorder's own first word, its setting, as if it had been heard.
    """
    for record in found:
        if everything or not isinstance(record, House):
            sample = sampled(record, design)
            if sample is not None:
                yield sample


def sampled(record: Record, design: Design, system: str = SYSTEM) -> Sample | None:
    """Return a record as a sample, on keys of this system; None for what nobody said (Unpaired)."""
    at = record.received
    match record:
        case Spoken():
            return Sample(
                key_of(record, design.file.system.key, system), record.wire, at, size=record.size if record.lost else 0
            )
        case Garbage(data=b"", reason=reason):
            return Sample(record.key, b"", at, broken=reason)
        case Garbage():
            return Sample(record.key, record.data, at)
        case Token():
            key = service_key(system, "alive", record.agent, life(record.incarnation, record.journal))
            return Sample(key, b"", at, token=True, gone=not record.alive)
        case House():
            peer = (record.peer,) if record.peer else ()
            return Sample(service_key(system, record.kind, record.owner, *peer), record.data, at)
        case Unpaired():
            return None


def main(file: Path, system: System, *, everything: bool) -> None:
    """Print the samples of a recording, one JSON object a line. Raises NoRecordingError."""
    for sample in samples(reading.of(file, system).records, system.design, everything=everything):
        sys.stdout.buffer.write(msgspec.json.encode(sample) + b"\n")

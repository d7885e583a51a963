"""A recorded run as samples of a tap, as if it went by now: for pictures and for load."""

from collections.abc import Iterator
from pathlib import Path

from agent_runtime.core.wiring import life, service_key
from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Garbage, House, Record, Spoken, Token

SYSTEM = "roco"


def samples(run: Path, until_s: float, now: float) -> Iterator[tuple[float, Sample]]:
    """(Seconds after the first record, sample heard as long after `now`) of a run folder's
    recording.
    """
    records = mcap_file.read(run / TRAFFIC_FILE).records
    for record in records:
        at = record.received - records[0].received
        if at > until_s:
            return
        sample = sampled(record, now + at)
        if sample is not None:
            yield at, sample


def sampled(record: Record, at: float) -> Sample | None:
    """Return the sample that the tap would hear; None if it would not hear it."""
    match record:
        case Spoken():
            return Sample(DESIGN.key(SYSTEM, record.communicate), record.wire, at)
        case House(kind=kind, owner=owner, peer=peer) if kind != "setting":
            return Sample(
                service_key(SYSTEM, kind, owner, *([peer] if peer else [])), record.data, at
            )
        case Token():
            key = service_key(
                SYSTEM, "alive", record.agent, life(record.incarnation, record.journal)
            )
            return Sample(key, b"", at, token=True, gone=not record.alive)
        case Garbage():
            return Sample(record.key, record.data, at)
    return None

"""The record of a run: what its agents' step logs have, and what its recording has besides (heartbeats, telemetry).

A communicate is taken from the logs; from the recording only where a run folder has no logs, or where a recording
stands alone. So it does not matter when the recorder began, or whether it lived. Must not know: what a reader wants.
"""

from pathlib import Path

from operate.recording import mcap_file
from operate.recording.ends import RECEIPT, Ends
from operate.recording.mcap_file import Read
from operate.recording.records import Garbage, House, Record, Spoken, Unpaired
from operate.recording.stored import NoRecordingError
from operate.run_folder import STEPS
from operate.system import System

HEARTBEAT = "state"
"""Kind of what an agent tells each second."""


def of(place: Path, system: System) -> Read:
    """The record of a run folder, or a recording (.mcap) alone. Raise NoRecordingError: it has none."""
    path = place / mcap_file.FILE if place.is_dir() else place
    found = of_run(place, system) if place.is_dir() else _alone(path, system)
    if not found.records:
        raise NoRecordingError(path, "holds no record that can be read" if path.is_file() else "is not there")
    return found


def of_run(run: Path, system: System) -> Read:
    """The record of a run folder of this system. What cannot be read is left out; raise NoRecordingError for a
    recording of another version.
    """
    recorded = _alone(run / mcap_file.FILE, system)
    if not any((run / STEPS).glob(f"*.{STEPS}")):
        return recorded
    ends = Ends(run, system)
    for one in recorded.records:
        if isinstance(one, House) and one.kind == HEARTBEAT:
            ends.lived(one.owner, one.received)
    records = (*(one for one in recorded.records if not _is_logged(one)), *ends.rest())
    return Read(_in_order(records), recorded.whole)


def _alone(path: Path, system: System) -> Read:
    found = mcap_file.read(path, system)
    return Read(_in_order(found.records), found.whole)


def _in_order(records: tuple[Record, ...]) -> tuple[Record, ...]:
    return tuple(sorted(records, key=lambda one: one.received))


def _is_logged(record: Record) -> bool:
    """Whether agents' logs have it."""
    match record:
        case Spoken() | Unpaired():
            return True
        case Garbage(log=log):
            return bool(log)
        case House(kind=kind):
            return kind == RECEIPT
    return False

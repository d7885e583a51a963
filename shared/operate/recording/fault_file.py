"""faults.jsonl as the recorder reads it: what is new since the last look, so that the recording has each fault, too."""

from contextlib import suppress
from pathlib import Path

import msgspec

from fipa_codec.communicate import UNREADABLE
from operate.fault_lines import read
from operate.recording.records import House, Record
from operate.run_folder import FAULTS_FILE, Fault

KIND, OPERATOR = "fault", "operator"
"""Of the house records in which a recording has them; nobody says them on a key."""


def fault_in(record: Record) -> Fault | None:
    """Return the fault that a record tells of; None for any other record."""
    if isinstance(record, House) and record.kind == KIND:
        with suppress(*UNREADABLE):
            return msgspec.json.decode(record.data, type=Fault)
    return None


class FaultFile:
    """The file of a run. Lines up to `known` [unix s] were recorded by a recorder before this one."""

    def __init__(self, run: Path, known: float = 0.0) -> None:
        self._path, self._known, self._offset = run / FAULTS_FILE, known, 0

    def new(self) -> list[Fault]:
        """Return the faults whose lines were written since the last look; a line not whole yet comes later."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
        except OSError:
            return []
        self._offset += data.rfind(b"\n") + 1
        return [one for one in read(data) if one.t > self._known]

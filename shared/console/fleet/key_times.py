"""From when until when the keys of a fleet hold."""

import datetime as dt
from pathlib import Path

import msgspec

from agent_runtime.io.fleet_processes import variables
from agent_runtime.io.run_files import KEYS_FOLDER, KEYS_VARIABLE
from console.fleet.local import Local
from console.fleet.process_status import Look
from console.fleet.targets import Target


class KeyTimes(msgspec.Struct, frozen=True):
    """The time (UTC) in which all certificates of a folder hold.

    `late`: the file of the one that begins last, at `begin`; `early`: of the one that ends first,
    at `end`.
    """

    folder: Path
    begin: dt.datetime
    late: str
    end: dt.datetime
    early: str

    def trouble(self, now: dt.datetime) -> str:
        """Return why a certificate does not hold now, "" if all do."""
        if now >= self.end:
            return (
                f"the certificate {self.folder / self.early} ended at {self.end:%Y-%m-%d %H:%M} UTC"
            )
        if now < self.begin:
            return (
                f"the certificate {self.folder / self.late} holds only from"
                f" {self.begin:%Y-%m-%d %H:%M} UTC"
            )
        return ""


def key_folder(fleet: Target, now: Look) -> Path | None:
    """Return the folder of keys that a fleet on this machine uses, by a look at it; None without
    one.
    """
    if not isinstance(fleet, Local):
        return None
    pid = next((one.status.pid for one in now.seen if one.status.pid), 0)
    folder = Path(variables(pid).get(KEYS_VARIABLE) or fleet.run / KEYS_FOLDER)
    return folder if folder.is_dir() else None


def key_times(folder: Path) -> KeyTimes | None:
    """Return when the certificates of a folder hold; None where it has none. Raise OSError,
    ValueError.
    """
    from agent_runtime.io import issuing  # most verbs look at no certificate

    found = [(issuing.lifetime(file), file.name) for file in folder.glob("*.pem")]
    if not found:
        return None
    begin, late = max((begin, name) for (begin, _), name in found)
    end, early = min((end, name) for (_, end), name in found)
    return KeyTimes(folder, begin, late, end, early)

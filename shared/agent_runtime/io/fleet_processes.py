"""Processes of a fleet that live, found by the variables they were started with, whatever became of
their run folder.

A supervisor gives each process the id of its fleet (FLEET_VARIABLE) besides the run folder. A
person's shell may name a run folder, too, but no fleet.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from agent_runtime.io.run_files import (
    FLEET_VARIABLE,
    RUN_FOLDER_VARIABLE,
    STOP_FILE,
    STOP_HELD,
    STOP_RELEASED,
    opened,
)

PROC = Path("/proc")


def variables(pid: int) -> dict[str, str]:
    """The variables that a process was started with; none where it is gone or another user's."""
    try:
        words = (
            (PROC / str(pid) / "environ").read_bytes().decode(errors="surrogateescape").split("\0")
        )
    except OSError:
        return {}
    return dict(word.split("=", 1) for word in words if "=" in word)


def started_in(run: Path) -> tuple[int, ...]:
    """The pids of this user's processes that a supervisor started for a run folder, oldest
    first.
    """
    return tuple(sorted(pid for pid, folder in _started() if folder == run))


def run_folders() -> tuple[Path, ...]:
    """The run folders of all fleets of this user that live, also folders that were deleted."""
    return tuple(sorted({folder for _, folder in _started()}))


def started_with(variable: str, value: str) -> Path | None:
    """The run folder of a fleet of this user that lives and has this value of a variable; None:
    none has.
    """
    return next(
        (folder for pid, folder in _started() if variables(pid).get(variable) == value), None
    )


def _started() -> Iterator[tuple[int, Path]]:
    """Yield this user's processes that a supervisor started, each with its run folder."""
    for place in PROC.glob("[0-9]*"):
        with suppress(OSError):
            if place.stat().st_uid != os.geteuid():
                continue
            had = variables(int(place.name))
            if had.get(FLEET_VARIABLE) and had.get(RUN_FOLDER_VARIABLE):
                yield int(place.name), Path(had[RUN_FOLDER_VARIABLE])


def set_stop(run: Path, held: bool) -> None:
    """Have the robot held, as by a person's stop, or released. The byte is written in place. Raise
    OSError.

    Where the run folder was deleted, a control loop still has the old file open: that one is
    written, too.
    """
    byte, failed = STOP_HELD if held else STOP_RELEASED, None
    try:
        _write(opened(run / STOP_FILE, os.O_WRONLY | os.O_CREAT, 0o600), byte)
    except OSError as error:
        failed = error
    deleted = deleted_files(run, STOP_FILE)
    for file in deleted:
        with suppress(OSError):
            _write(os.open(file, os.O_WRONLY | os.O_CLOEXEC), byte)
    if failed is not None and not deleted:
        raise failed


def deleted_files(run: Path, name: str) -> list[Path]:
    """Files in /proc: a file that was deleted from a run folder, where processes of the fleet have
    it open.
    """
    return [file for file, target in _opened_by(run) if target == f"{run / name} (deleted)"]


def listens(run: Path, port: int) -> bool:
    """Whether a process that a supervisor started for a run folder listens at this TCP port."""
    sockets = {f"socket:[{number}]" for number in _listening(port)}
    return bool(sockets) and any(target in sockets for _, target in _opened_by(run))


def _opened_by(run: Path) -> Iterator[tuple[Path, str]]:
    """Yield what the processes of a run folder have open: the file in /proc, and what it stands
    for.
    """
    for pid in started_in(run):
        with suppress(OSError):
            for file in (PROC / str(pid) / "fd").iterdir():
                with suppress(OSError):
                    yield file, os.readlink(file)


def _listening(port: int) -> Iterator[str]:
    """Yield the inodes of the sockets that listen at a TCP port (man 5 proc: /proc/net/tcp)."""
    for table in ("tcp", "tcp6"):
        with suppress(OSError):
            for line in (PROC / "net" / table).read_text().splitlines()[1:]:
                fields = line.split()
                if fields[3] == "0A" and int(fields[1].rpartition(":")[2], 16) == port:
                    yield fields[9]


def _write(flag: int, byte: bytes) -> None:
    try:
        os.pwrite(flag, byte, 0)
    finally:
        os.close(flag)

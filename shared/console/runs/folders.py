"""Finding a run and reading its files (docs/run-folder.md)."""

import fcntl
import os
from pathlib import Path
from typing import TypeVar

import msgspec

from agent_runtime.io.fleet_processes import started_in
from agent_runtime.io.options import AGENTS_VARIABLE, Options
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE, STOP_FILE, STOP_HELD
from console.errors import NoRunError
from operate import proc
from operate.file_names import FLEET_FILE, LATEST, LOCK_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus

RUNS = Path("runs")
NAME = "%Y-%m-%d_%H-%M-%S"
"""Name of a run's folder: when it began, in local time."""
SUPERVISORS = ("operate.supervisor", "services.supervisor")
"""Modules that keep a fleet: that of any system, and the one that containers of the Robot Companion
run.
"""
T = TypeVar("T")


def near(path: Path) -> Path:
    """A path as one would type it here."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def find(run: Path | None) -> Path:
    """The folder named, else the one of the environment, else the latest. NoRunError where it is
    not there.
    """
    folder = run or Path(os.environ.get(RUN_FOLDER_VARIABLE) or RUNS / LATEST)
    if not folder.is_dir() and not started_in(folder.resolve()):
        raise NoRunError(str(folder))
    return folder.resolve()


def read(path: Path, kind: type[T]) -> T | None:
    """The content of a file of the run, or None where it is not there yet or from another
    version.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except (OSError, msgspec.DecodeError):
        return None


def fleet(run: Path) -> Fleet | None:
    """Return the fleet as the supervisor last reported it."""
    return read(run / FLEET_FILE, Fleet)


def keeper(run: Path) -> int:
    """Return the pid of the supervisor that keeps a run folder now; 0: nobody does."""
    try:
        with (run / LOCK_FILE).open() as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        text = (run / LOCK_FILE).read_text().strip()
        return int(text) if text.isdigit() else 0
    except OSError:
        pass
    told = fleet(run)
    if told is not None and is_service(told.supervisor, *SUPERVISORS):
        return told.supervisor
    if (run / LOCK_FILE).exists():
        return 0
    # its folder was deleted
    return next((pid for pid in started_in(run) if is_service(pid, *SUPERVISORS)), 0)


def living(run: Path) -> Fleet | None:
    """The fleet as the supervisor told it; where the supervisor is gone, each process is looked for
    by its pid.
    """
    told = fleet(run)
    if told is None or told.supervisor == keeper(run) != 0:
        return told
    every = told.processes
    processes = tuple(one if is_service(one.pid, one.module) else _ended(one) for one in every)
    return msgspec.structs.replace(told, supervisor=0, processes=processes)


def around() -> Fleet | None:
    """The fleet that the environment tells of: in a container no supervisor does. None: nor does
    the environment.
    """
    connect = os.environ.get("ROCO_CONNECT")
    if not connect:
        return None
    from agent_runtime.io.cli import endpoints  # most verbs need it not

    agents = endpoints(os.environ.get(AGENTS_VARIABLE, ""))
    system = os.environ.get("ROCO_SYSTEM", Options().system)
    return Fleet(system, connect, 0, 0.0, (), agents=agents)


def _ended(status: ProcessStatus) -> ProcessStatus:
    """A process that is not there any more; what was given up stays so."""
    state = status.state if status.state is ProcessState.GIVEN_UP else ProcessState.STOPPED
    note = status.note or ("gone, and no supervisor to restart it" if status.pid else "")
    return msgspec.structs.replace(status, state=state, pid=0, note=note)


def is_service(pid: int, *modules: str) -> bool:
    """Tell whether this pid is a living process that runs one of these modules; a number used again
    by somebody else is not.
    """
    words = proc.command_line(pid)
    return any(module in words for module in modules if module)


def stop_held(run: Path) -> bool:
    """Tell whether the stop flag is set."""
    try:
        return (run / STOP_FILE).read_bytes()[:1] == STOP_HELD
    except OSError:
        return False

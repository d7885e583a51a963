"""Finding a run and reading its files (docs/run-folder.md): its fleet, its verdicts; and
which runs live here.

Two fleets share the processors, and a verb without a name means one of them.
"""

import fcntl
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from agent_runtime.io.fleet_processes import started_in
from agent_runtime.io.options import AGENTS_VARIABLE, Options
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE, STOP_FILE, STOP_HELD
from console.errors import FleetError, NoRunError, UsageError
from operate import proc
from operate.file_names import FLEET_FILE, LATEST, LOCK_FILE, VERDICTS_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.system import System, of_run
from operate.verdict_lines import Judged

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


# --- The verdicts about a run: as its monitor wrote them, or made now -----------------------------


_decoder = msgspec.json.Decoder(Judged)


def judged(file: Path, system: System | None = None) -> list[Judged]:
    """The verdicts about a recording, made now, by the design of its own system or of another
    one.
    """
    from operate.recording.run import verdicts

    return list(verdicts(file, of_run(file) if system is None else system))


def verdicts_of(run: Path) -> list[Judged]:
    """The verdicts the monitor wrote while it listened; of a run without them the recording is
    judged now.
    """
    file = run / VERDICTS_FILE
    return verdicts_in(file.read_bytes().splitlines()) if file.exists() else judged(run)


def verdicts_in(lines: Iterable[bytes]) -> list[Judged]:
    """Lines as verdicts, in the order of time; one that is not whole yet, or of another version, is
    left out.
    """
    found: list[Judged] = []
    for line in lines:
        with suppress(msgspec.DecodeError):
            found.append(_decoder.decode(line))
    return sorted(found, key=lambda one: one.t)


# --- Fleets that run here already: a second one is started only where it is named -----------------


EXPERIMENTS = Path("experiments")
"""Folder of the experiments, each with the runs that it repeats."""


class Living(NamedTuple):
    """A run folder of which something runs. `names`: its processes; `fleet.supervisor` 0: nobody
    keeps them.
    """

    run: Path
    fleet: Fleet
    names: tuple[str, ...]


class Place(NamedTuple):
    """Folder in which a new fleet writes. `latest`: whether runs/latest is to point there."""

    run: Path
    latest: bool


def living_among(*runs: Path) -> Iterator[Living]:
    """Yield the fleets of these run folders of which something still runs; links are skipped, being
    other names of the same folders.
    """
    for folder in sorted(runs):
        told = living(folder) if folder.is_dir() and not folder.is_symlink() else None
        names = tuple(status.name for status in told.processes if status.pid) if told else ()
        if told is not None and (told.supervisor or names):
            yield Living(folder, told, names)


def living_here() -> list[Living]:
    """Return the fleets in runs/ here of which something still runs."""
    return list(living_among(*RUNS.glob("*")))


def place(out: Path | None, another: str, now: datetime) -> Place:
    """The folder of a fleet that starts now. FleetError: one runs already, and none beside it was
    asked for.

    A second fleet never takes runs/latest from one that runs.
    """
    if another:
        return Place(_named(another, out), latest=False)
    if out is not None:
        return Place(out.resolve(), latest=not list(living_among(*out.resolve().parent.glob("*"))))
    refuse_beside(
        "`--another NAME` starts a second one on purpose, in runs/NAME; both then share the"
        " processors"
    )
    return Place((RUNS / now.strftime(NAME)).resolve(), latest=True)


def refuse_beside(way_out: str) -> None:
    """Raise FleetError where a fleet or an experiment runs here; `way_out`: what may be done
    besides ending it.
    """
    found = [*living_here(), *living_among(*EXPERIMENTS.glob("*/runs/*"))]
    if found:
        raise FleetError("a fleet runs here already:", (*map(_fleet_line, found), way_out))


def _fleet_line(one: Living) -> str:
    """Return a line with the fleet, its living processes, and the command that ends it."""
    latest = one.run.parent / LATEST
    is_latest = latest.is_symlink() and latest.resolve() == one.run.resolve()
    meant = "" if is_latest else f" --run-dir {one.run}"
    many = f"{len(one.names)} process{'es' * (len(one.names) != 1)}"
    since = f"since {datetime.fromtimestamp(one.fleet.started):%H:%M}"
    kept = since if one.fleet.supervisor else "left"
    return f"{one.run}, {many} {kept}; `roco down{meant}` ends it"


def _named(another: str, out: Path | None) -> Path:
    """The folder of a second fleet. UsageError where its name cannot be one, or was one already."""
    if out is not None:
        raise UsageError("--another names a folder in runs/, --out any folder; give one of the two")
    if another in (LATEST, ".", "..") or "/" in another:
        raise UsageError(
            f"{another!r} is no name of a folder in runs/; give one such as `--another second`"
        )
    run = RUNS / another
    if run.exists():
        raise UsageError(f"{run} is there already; give another name, or remove it")
    return run.resolve()

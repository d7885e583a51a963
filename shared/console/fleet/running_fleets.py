"""Fleets that run here already, found by their run folders: a second one is started only where it
is named.

Two fleets share the processors, and a verb without a name means one of them.
"""

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from console.errors import FleetError, UsageError
from console.runs import folders
from operate.file_names import LATEST
from operate.fleet_file import Fleet

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


def living(*runs: Path) -> Iterator[Living]:
    """Yield the fleets of these run folders of which something still runs; links are skipped, being
    other names of the same folders.
    """
    for folder in sorted(runs):
        told = folders.living(folder) if folder.is_dir() and not folder.is_symlink() else None
        names = tuple(status.name for status in told.processes if status.pid) if told else ()
        if told is not None and (told.supervisor or names):
            yield Living(folder, told, names)


def here() -> list[Living]:
    """Return the fleets in runs/ here of which something still runs."""
    return list(living(*folders.RUNS.glob("*")))


def place(out: Path | None, another: str, now: datetime) -> Place:
    """The folder of a fleet that starts now. FleetError: one runs already, and none beside it was
    asked for.

    A second fleet never takes runs/latest from one that runs.
    """
    if another:
        return Place(_named(another, out), latest=False)
    if out is not None:
        return Place(out.resolve(), latest=not list(living(*out.resolve().parent.glob("*"))))
    refuse(
        "`--another NAME` starts a second one on purpose, in runs/NAME; both then share the"
        " processors"
    )
    return Place((folders.RUNS / now.strftime(folders.NAME)).resolve(), latest=True)


def refuse(way_out: str) -> None:
    """Raise FleetError where a fleet or an experiment runs here; `way_out`: what may be done
    besides ending it.
    """
    found = [*here(), *living(*EXPERIMENTS.glob("*/runs/*"))]
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
    run = folders.RUNS / another
    if run.exists():
        raise UsageError(f"{run} is there already; give another name, or remove it")
    return run.resolve()

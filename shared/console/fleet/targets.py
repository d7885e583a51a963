"""Choice of a fleet: one on this machine, or one in containers.

Without a word from the user it is what runs: the run of --run-dir or ROCO_RUN_DIR, else runs/latest
where something of it lives, else the only other one of runs/ that lives, else the containers of a
compose project, else runs/latest as it was left.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from agent_runtime.io.fleet_processes import run_folders, started_in
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE
from console import completion
from console.errors import ConsoleError, NoRunError, UsageError
from console.fleet import process_status
from console.fleet.local import Local
from console.fleet.process_status import Put as Put
from console.fleet.process_status import Seen
from console.fleet.process_status import Target as Target
from console.output import option
from console.runs import folders
from operate.file_names import LATEST
from operate.system import System, here

LOCAL, COMPOSE = "local", "compose"
LOG_LINES = 5
"""Last lines of a process that are shown with what is wrong with it."""
Name = Annotated[
    str,
    option(
        "local, compose, a run's folder or its name in runs/, a compose project, or"
        " PROJECT/ROBOT of several robots; else what runs.",
        "--target",
        complete=completion.targets,
    ),
]


def find(name: str = "", run_dir: Path | None = None) -> Target:
    """The fleet that is meant. Raises NoRunError, or UsageError where it cannot be told which."""
    if run_dir is not None or name == LOCAL:
        return Local(folders.find(run_dir))
    if name:
        return _named(name)
    if os.environ.get(RUN_FOLDER_VARIABLE) or _lives(folders.RUNS / LATEST):
        return Local(folders.find(None))
    return _other() or _compose("") or Local(_left())


def to_hold(name: str = "", run_dir: Path | None = None) -> Iterator[Target]:
    """The fleets that a stop means: the one that is named, else all that live in runs/ here, else
    all of this user's that live anywhere. Where nothing lives, the run that was left here: a loop
    may run there that no supervisor started.

    Nothing is asked: a robot that was stopped needlessly is released by a command, one that goes on
    meanwhile is not stopped in time. Those on this machine come before docker is asked, which may
    hang. Raises as `find` does.
    """
    if name or run_dir is not None:
        yield find(name, run_dir)
        return
    named = os.environ.get(RUN_FOLDER_VARIABLE)
    local = [folders.find(None)] if named and started_in(Path(named).resolve()) else _living_here()
    local = local or list(run_folders())
    yield from map(Local, local)
    if not _living_here():
        projects = _projects()
        yield from projects
        if not local and not projects:
            with suppress(NoRunError):
                yield find()


def not_held(held: list[Target]) -> list[Target]:
    """This user's fleets that live on this machine, but for those that were held."""
    known = {one.where for one in held}
    return [one for one in (*map(Local, run_folders()), *_projects()) if one.where not in known]


def lives(fleet: Target) -> bool:
    """Whether anything of a fleet runs: of one on this machine, also where its folder is gone."""
    return not isinstance(fleet, Local) or _lives(fleet.run) or bool(started_in(fleet.run))


def _living_here() -> list[Path]:
    """The folders in runs/ here of fleets of which something lives, also of one that was
    deleted.
    """
    found = {one.run.resolve() for one in folders.living_here()}
    found |= {one for one in run_folders() if one.parent == folders.RUNS.resolve()}
    latest = (folders.RUNS / LATEST).resolve()
    return sorted(found | ({latest} if _lives(latest) else set()))


def _projects() -> list[Target]:
    from console.fleet.compose import Compose, projects

    return [Compose(one) for one in projects()]


def _left() -> Path:
    """The run that was left here. NoRunError, which names the fleets that live elsewhere."""
    try:
        return folders.find(None)
    except NoRunError as error:
        if elsewhere := " or ".join(map(str, run_folders())):
            words = f"no fleet runs here; yours run elsewhere: --target {elsewhere}"
            raise NoRunError(error.where, words) from error
        raise


def named(fleet: Target, name: str) -> Seen:
    """A process of a fleet. UsageError where it has none of that name."""
    found = fleet.look().seen
    for one in found:
        if one.name == name:
            return one
    there_are = ", ".join(one.name for one in found) or "none"
    raise UsageError(f"no process of {fleet.where} is called {name!r}; there are: {there_are}")


def about(name: str = "", run_dir: Path | None = None) -> System:
    """The system of the fleet that is meant; where none is named and none is there, that of this
    folder.
    """
    if name or run_dir is not None:
        return find(name, run_dir).system
    try:
        fleet = find()
    except ConsoleError:
        return here()
    return fleet.system


def _named(name: str) -> Target:
    for folder in (Path(name), folders.RUNS / name):
        if name != COMPOSE and folder.is_dir() and folders.fleet(folder) is not None:
            return Local(folder.resolve())
    found = _compose(name)
    # a run whose fleet.json is gone, or not there yet
    if found is None and name != COMPOSE and Path(name).is_dir():
        return Local(Path(name).resolve())
    if found is None:
        what = f"{name!r} is no folder and no compose project"
        what = "no compose project of ours runs" if name == COMPOSE else what
        begin = "`docker compose -f deploy/compose.yaml up -d` starts one, `roco up` a local one"
        raise NoRunError(name, f"{what}; {begin}")
    return found


def _lives(run: Path) -> bool:
    """Whether anything of a run is there."""
    return any(folders.living_among(run.resolve()))


def _other() -> Target | None:
    """The fleet that runs here while runs/latest, of another one, does not. UsageError where there
    are several.
    """
    found = folders.living_here()
    if len(found) > 1:
        names = " or ".join(one.run.name for one in found)
        raise UsageError(f"several fleets run; name one: --target {names}")
    return Local(found[0].run.resolve()) if found else None


def _compose(project: str) -> Target | None:
    """The project of this name, or the only one. UsageError where there are several."""
    from console.fleet.compose import Compose, projects

    project, _, robot = project.partition("/")
    if project != COMPOSE and project:
        return Compose(project, robot) if project in projects(ended=True) else None
    running = projects()
    if len(running) > 1:
        raise UsageError(f"several compose projects run; name one: --target {' or '.join(running)}")
    return Compose(running[0], robot) if running else None


# --- Names for the shell to complete that only a fleet knows --------------------------------------


def processes(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the processes of the fleet that is meant; where none runs, the agents of the
    design.
    """
    fleet = meant(ctx)
    if fleet is None:
        return completion.agents(ctx, incomplete)
    return completion.among([one.name for one in fleet.look().seen], incomplete)


def open_tasks(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the tasks of the fleet that is meant that have not ended."""
    fleet = meant(ctx)
    found = process_status.tasks_of(fleet)[0] if fleet is not None else ()
    return completion.among(
        [one.task for one in found if one.state not in process_status.ENDED], incomplete
    )


def meant(ctx: typer.Context) -> Target | None:
    """Return the fleet that the options before the word name, else the one that is meant without;
    None: none is.
    """
    try:
        return find(ctx.params.get("target") or "", completion.path_given(ctx, "run_dir"))
    except ConsoleError:
        return None

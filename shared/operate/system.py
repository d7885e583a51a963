"""A system as the tools see it: one object that a project names `module:NAME`, and how the tools find it.

Nothing in this package knows a certain system. A tool gets a `System` as argument; the command line and the services
find it once, by `of_run` or `here`. A project names its own in pyproject.toml:

    [tool.roco]
    system = "depot.system:SYSTEM"

An installed one is named by an entry point of the group `roco.system`. docs/design-your-own-robot.md shows both.
"""

import os
import sys
import tomllib
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import msgspec

from fipa_codec.languages import Languages
from operate.run_folder import FLEET_FILE, Fleet
from operate.supervisor.processes import Process
from operate.wording import words
from topdown.model import design as designs
from topdown.model.errors import TopdownError

ENTRY_VARIABLE, PROJECT_VARIABLE = "ROCO_ENTRY", "ROCO_PROJECT"
"""The processes of a fleet find their system by these: `module:NAME`, and the folder that Python imports it from."""
GROUP = "roco.system"
"""Entry points of installed systems."""


class NoSystemError(Exception):
    """A system cannot be told or read; the message says what to do."""


class Job(msgspec.Struct, frozen=True, kw_only=True):
    """The usual task of a system, which `roco chaos` disturbs.

    `command`: words of `roco` that do it in a fleet of its own; they take --seed, --speed, --out and --faults.
    `phases`: name -> when it begins, as --at of a fault has it; {}: the states of the agents. `rests`: agent ->
    the state in which it is when it is done. `timeout_s`: a run that takes longer is stuck.
    """

    command: tuple[str, ...] = ("up", "--for", "20")
    phases: dict[str, str] = {}
    rests: dict[str, str] = {}
    timeout_s: float = 300.0


class Additions(msgspec.Struct, frozen=True, kw_only=True):
    """Additions of a system to the tools, each as "module:NAME", imported when it is used; "": nothing.

    `verbs`: rows for the table of `roco` (operate.cli.verbs.VERBS has the form). `options`: a function of names of
    processes, scene file and seed, called before anything is started; it raises ValueError. `findings`: a function of a
    Design that gives further findings of `roco design check`. `live`: a class without arguments with `lines(record)`,
    which gives further lines of live.jsonl. `events`: a function of a History that gives what happened, each with a
    `name`. `report`: a function of a History that gives the figures of report.json, `page`: one of History, figures and
    the run's name that gives report.html. `drawers`: a function of a Sheet that gives further
    operate.pictures.stage.Drawer, `blueprint`: one of the length of the run that gives the layout of the viewer.
    `telemetry`: kind of a house key -> decoder, a mapping. `tasks`: a function of a Target that gives what people asked
    for, as lines of operate.cli.fleet.tasks.Task; it raises ConsoleError. `checks`: an operate.cli.fleet.checkup.Checks
    for `roco doctor`. `untouchable`: a function of a Target that gives why `roco fault` must leave it alone (a real
    robot moves there), "" where it need not. `promises`: a function of a History that gives, in sentences, those that
    are broken (operate.judging.invariants). `measures`: an operate.experiments.measures.Measures for experiments and
    comparisons. `why`: a function of an operate.recording.traced.Run and a task of it (a Span) that gives further
    Passages of `roco why`; `believed`: one of a file, a Run, a name and a time [s, None: the end] that gives what is
    believed of a thing of that name, as a Why, or None where there is none.
    """

    verbs: str = ""
    options: str = ""
    findings: str = ""
    live: str = ""
    events: str = ""
    report: str = ""
    page: str = ""
    drawers: str = ""
    blueprint: str = ""
    telemetry: str = ""
    tasks: str = ""
    checks: str = ""
    untouchable: str = ""
    promises: str = ""
    measures: str = ""
    why: str = ""
    believed: str = ""


class System(msgspec.Struct, frozen=True, kw_only=True):
    """A system: its design, its languages, the processes that make it up, and what it adds to the tools.

    `name`: prefix of its keys where none is given. `words`: a content of one of its languages in a few words. `plain`:
    a text with its ids as people say them. `says`: process that is not an agent -> state -> what it does, in words; of
    an agent the design has them. `unreplaced`: agent -> why `roco replay --replace` cannot run it alone. `variables`:
    what its processes get in their environment, `{run}` standing for the run folder. `job`: its usual task.
    `entry`: where this object is, `project`: the folder that Python imports it from, "" where it is installed.
    """

    name: str
    design: designs.Design
    languages: Languages | None
    processes: tuple[Process, ...] = ()
    words: Callable[[object], str] = words
    plain: Callable[[str], str] = str
    says: dict[str, dict[str, str]] = {}
    unreplaced: dict[str, str] = {}
    additions: Additions = Additions()
    variables: dict[str, str] = {}
    job: Job = Job()
    entry: str = ""
    project: str = ""

    def addition(self, kind: str) -> Any:
        """Return the object named at this place of `additions`, imported; None where the system adds nothing there."""
        place = getattr(self.additions, kind)
        return resolved(place) if place else None

    def environment(self, run: Path) -> dict[str, str]:
        """Return what a process of a run needs: its own variables, and those by which `here` finds this system."""
        path = os.pathsep.join(filter(None, (self.project, os.environ.get("PYTHONPATH", ""))))
        found = {ENTRY_VARIABLE: self.entry, PROJECT_VARIABLE: self.project, "PYTHONPATH": path}
        own = {name: value.format(run=run) for name, value in self.variables.items()}
        return own | {name: value for name, value in found.items() if value}


def resolved(place: str) -> Any:
    """The object at "module:NAME". Raise NoSystemError where there is none."""
    module, _, name = place.partition(":")
    try:
        return getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise NoSystemError(f"nothing is at {place!r} ({error}); write package.module:NAME") from error


def load(entry: str, project: str = "") -> System:
    """The system named `module:NAME`, imported from the folder `project` where one is given."""
    if project and project not in sys.path:
        sys.path.insert(0, project)
    found = resolved(entry)
    if not isinstance(found, System):
        raise NoSystemError(f"{entry} is {type(found).__name__}; it must be an operate.system.System")
    return msgspec.structs.replace(found, entry=entry, project=project)


def here(folder: Path | None = None) -> System:
    """The system that is meant where no run tells: of the environment, else of the project that `folder` (the current
    one) is in, else the installed one. Raise NoSystemError where there is none, or several are installed.
    """
    if entry := os.environ.get(ENTRY_VARIABLE, ""):
        return load(entry, os.environ.get(PROJECT_VARIABLE, ""))
    start = (folder or Path.cwd()).resolve()
    for above in (start, *start.parents):
        if entry := _of_project(above / "pyproject.toml"):
            return load(entry, str(above))
    return _installed()


def of_run(run: Path) -> System:
    """The system of a run folder, or of a file in it, as its fleet.json names it; `here` where none does."""
    folder = run if run.is_dir() else run.parent
    try:
        told = msgspec.json.decode((folder / FLEET_FILE).read_bytes(), type=Fleet)
    except (OSError, msgspec.DecodeError):
        return here()
    return load(told.entry, told.project) if told.entry else here()


def of_design(file: Path) -> System:
    """The system of a design file alone: contents are not read. Raise NoSystemError where it cannot be read."""
    try:
        design = designs.load(file)
    except (TopdownError, OSError) as error:
        raise NoSystemError(str(error)) from error
    return System(name=design.file.system.name, design=design, languages=None)


def languages_at(place: str) -> Languages:
    """The Languages at "module:NAME". Raise NoSystemError where there are none."""
    found = resolved(place)
    if not isinstance(found, Languages):
        raise NoSystemError(f"{place} is {type(found).__name__}; give a fipa_codec.languages.Languages")
    return found


def _of_project(file: Path) -> str:
    """The system that a pyproject.toml names, "" where it names none."""
    try:
        tool = tomllib.loads(file.read_text(encoding="utf-8")).get("tool", {})
    except (OSError, tomllib.TOMLDecodeError):
        return ""
    return str(tool.get("roco", {}).get("system", ""))


def _installed() -> System:
    found = {point.value for point in entry_points(group=GROUP)}
    if len(found) == 1:
        return load(found.pop())
    what = f"several systems are installed: {', '.join(sorted(found))}" if found else "no system is installed here"
    raise NoSystemError(f'{what}; name one in pyproject.toml: [tool.roco] system = "package.module:NAME"')

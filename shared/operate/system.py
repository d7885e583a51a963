"""A system as the tools see it: one object that a project names `module:NAME`, and how the tools
find it.

Nothing in this package knows a certain system. A tool gets a `System` as argument; the command line
and the services find it once, by `of_run` or `here`. A project names its own in pyproject.toml:

    [tool.roco]
    system = "depot.system:SYSTEM"

An installed one is named by an entry point of the group `roco.system`.
docs/architecture.md has the order. Code of a project is imported only where nobody but the
caller and root can change it (`changeable`).
"""

import grp
import os
import pwd
import stat
import sys
import tomllib
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from fipa_codec.languages import Languages
from operate import wording
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet
from operate.live_lines import Step
from topdown.model import design as designs
from topdown.model.errors import TopdownError

# --- A process of a system ------------------------------------------------------------------------


ORDERLY_STOP_S = 5.0  # estimate: an agent closes its session and its journal in well under a second
SILENT_S = 6.0  # estimate: six heartbeats
# estimate: the monitor works at a low priority, and reads large content amid its heartbeats
RECORDS_S = 20.0
# estimate: when it is stopped the monitor writes report and pictures, perhaps of several robots
REPORT_S = 120.0


class Process(msgspec.Struct, frozen=True):
    """One process: Python runs `-m module arguments`.

    `forked`: whether the fork server makes it, where there is one; one that locks its memory would
    lock a copy of all that the server imported. `workers`: modules that children of it run.

    `after`: processes that are ready before it starts, and stop only once it has ended. `optional`:
    others do not wait for it for more than `patience_s`, and the fleet counts as ready without it.
    `stop_within_s`: then it is killed. `hangs_s`: silence of its heartbeat after which it is killed
    and started again [s].
    """

    name: str
    module: str
    after: tuple[str, ...] = ()
    optional: bool = False
    patience_s: float = 10.0
    stop_within_s: float = ORDERLY_STOP_S
    hangs_s: float = SILENT_S
    arguments: tuple[str, ...] = ()
    workers: tuple[str, ...] = ()
    forked: bool = True


# Agents start side by side: each is ready when a ping was answered on each of its channels: they
# wait for each other. They end before the monitor, which then has their last word. They do not wait
# until it is ready: it reads their logs.
FIRST = ("router", "monitor")


def around(
    router: str = "operate.router", monitor: str = "operate.recording"
) -> tuple[Process, Process]:
    """The router and the monitor of a system, run by these modules."""
    return (
        Process("router", router),
        Process(
            "monitor",
            monitor,
            after=("router",),
            optional=True,
            patience_s=0.0,
            stop_within_s=REPORT_S,
            hangs_s=RECORDS_S,
        ),
    )


def agents(package: str, *names: str) -> tuple[Process, ...]:
    """Agents that are run as `package.name`."""
    return tuple(Process(name, f"{package}.{name}", after=FIRST) for name in names)


# --- Whose code may run ---------------------------------------------------------------------------
# A file or a folder is trusted where only the caller and root can change what it holds. A run's
# fleet.json and a project's pyproject.toml name Python code. Root who looks at a user's run, or
# anybody below a folder that others write to, would run theirs.


TRUST_VARIABLE = "ROCO_TRUST"
"""Folders that the caller trusts whoever owns them, a colon between, with all that is below
them.
"""
ACCESS_LIST = "system.posix_acl_access"


def changeable(place: Path) -> str:
    """Say who besides the caller and root could change this file, or what is in this folder; ""
    where nobody could.

    The folders above count, too: who can rename one of them can put another in its place. In one
    with the sticky bit, as /tmp, only the owner of an entry can.
    """
    place = place.resolve()
    trusted = [
        Path(one).resolve() for one in os.environ.get(TRUST_VARIABLE, "").split(os.pathsep) if one
    ]
    if any(place.is_relative_to(one) for one in trusted):
        return ""
    found = (_changeable(one, sticky=one != place) for one in (place, *place.parents))
    return next(filter(None, found), "")


def _changeable(place: Path, sticky: bool) -> str:
    try:
        found = place.stat()
        listed = ACCESS_LIST in os.listxattr(place)
    except OSError as error:
        return f"{place} cannot be looked at ({error.strerror})"
    if found.st_uid not in _safe():
        return f"{place} belongs to {_user(found.st_uid)}"
    if sticky and found.st_mode & stat.S_ISVTX:
        return ""
    if found.st_mode & stat.S_IWOTH:
        return f"every user can write to {place}"
    if found.st_mode & stat.S_IWGRP and (listed or not _alone(found.st_gid)):
        return f"other users can write to {place} (group {_group(found.st_gid)})"
    return ""


def _safe() -> set[int]:
    return {0, os.geteuid()}


def _alone(gid: int) -> bool:
    """Whether a group has nobody but the caller and root in it, as a user's own group where the
    umask is 002.
    """
    try:
        members = {pwd.getpwnam(name).pw_uid for name in grp.getgrgid(gid).gr_mem}
    except KeyError:  # nobody has written down who is in it
        return False
    return members | {user.pw_uid for user in pwd.getpwall() if user.pw_gid == gid} <= _safe()


def _user(uid: int) -> str:
    try:
        return f"{pwd.getpwuid(uid).pw_name} (uid {uid})"
    except KeyError:
        return f"uid {uid}"


def _group(gid: int) -> str:
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return str(gid)


# --- A system, and how the tools find it ----------------------------------------------------------


ENTRY_VARIABLE, PROJECT_VARIABLE = "ROCO_ENTRY", "ROCO_PROJECT"
"""The processes of a fleet find their system by these: `module:NAME`, and the folder that Python
imports it from.
"""
COMPLETING_VARIABLE = "_ROCO_COMPLETE"
"""The shell sets it where it asks for names to complete."""
GROUP = "roco.system"
"""Entry points of installed systems."""
PROJECT_FILE = "pyproject.toml"


class NoSystemError(Exception):
    """A system cannot be told or read; the message says what to do."""


class UntrustedError(NoSystemError):
    """A file names a system whose code others can change. `by`: the file; `why`: who can change
    what.
    """

    def __init__(self, named: "Named", why: str, trusting: tuple[Path, ...]) -> None:
        self.by, self.why = named.by, why
        where = f" in {named.project}" if named.project else ""
        super().__init__(
            f"{named.by} names the system {named.entry!r}{where}, whose code would run here as"
            f" {_caller()}; but {why}. Read that code; where you trust it, set"
            f" {TRUST_VARIABLE}={os.pathsep.join(map(str, trusting))}"
        )


class Job(msgspec.Struct, frozen=True, kw_only=True):
    """The usual task of a system, which `roco chaos` disturbs.

    `command`: words of `roco` that do it in a fleet of its own; they take --seed, --speed, --out
    and --faults. `phases`: name -> when it begins, as --at of a fault has it; {}: the states of the
    agents. `rests`: agent -> the state in which it is when it is done. `timeout_s`: a run that
    takes longer is stuck.
    """

    command: tuple[str, ...] = ("up", "--for", "20")
    phases: dict[str, str] = {}
    rests: dict[str, str] = {}
    timeout_s: float = 300.0


class Additions(msgspec.Struct, frozen=True, kw_only=True):
    """Additions of a system to the tools, each as "module:NAME", imported when it is used; "":
    nothing.

    `verbs`: rows for the table of `roco` (console.verbs.VERBS has the form). `options`: a
    function of names of processes, scene file and seed, called before anything is started; it
    raises ValueError. `findings`: a function of a Design that gives further findings of `roco
    design check`. `live`: a class without arguments with `lines(record)`, which gives further lines
    of live.jsonl. `events`: a function of a History that gives what happened, each with a `name`.
    `report`: a function of a History that gives the figures of report.json, `page`: one of History,
    figures and the run's name that gives report.html. `drawers`: a function of a Sheet that gives
    further operate.pictures.stage.Drawer, `blueprint`: one of the length of the run that gives the
    layout of the viewer. `telemetry`: kind of a signal -> decoder, a mapping. `tasks`: a function
    of a Target that gives what people asked for, as lines of console.fleet.process_status.Task; it
    raises ConsoleError. `checks`: an console.fleet.checkup.Checks for `roco doctor`.
    `untouchable`: a function of a Target that gives why `roco fault` must leave it alone (a real
    robot moves there), "" where it need not. `promises`: a function of a History that gives, in
    sentences, those that are broken (operate.judging.invariants). `measures`: an
    operate.experiments.measures.Measures for experiments and comparisons. `why`: a function of an
    operate.recording.run.Run and a task of it (a Span) that gives a plain sentence of what became
    of it and why, and further Passages of `roco why`;
    `believed`: one of a Run, a name and a time [s, None: the end] that gives what is believed of a
    thing of that name, as a Why, or None where there is none. `faults`: kind of a fault that its
    own verbs do -> console.faults.kinds.Kind, which heals one whose command is gone. `ros`: a class
    without arguments with `take(happening)`, which gives further messages for ROS
    (operate.ros.telling.More). `guests`: a function of an operate.guests.hosting.Host that gives
    the Extra for programs that are guests.
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
    faults: str = ""
    ros: str = ""
    guests: str = ""


class System(msgspec.Struct, frozen=True, kw_only=True):
    """A system: its design, its languages, the processes that make it up, and what it adds to the
    tools.

    `name`: prefix of its keys where none is given. `about`: a content of one of its languages in a
    few words, `why`: the reason that it gives. `plain`: a text with its ids as people say them.
    `step` and `happened`: a step of a plan, and an event (its name, and of what), in words. `says`:
    process that is not an agent -> state -> what it does, in words; of an agent the design has
    them. `unreplaced`: agent -> why `roco replay --replace` cannot run it alone. `variables`: what
    its processes get in their environment, `{run}` standing for the run folder. `contents`: version
    of what its messages contain; a recording of another version is refused. `job`: its usual task.
    `entry`: where this object is, `project`: the folder that Python imports it from, "" where it is
    installed.
    """

    name: str
    design: designs.Design
    languages: Languages | None
    processes: tuple[Process, ...] = ()
    about: Callable[[object], str] = wording.about
    why: Callable[[object], str] = wording.why
    plain: Callable[[str], str] = str
    step: Callable[[Step], str] = wording.step
    happened: Callable[[str, tuple[str, ...]], str] = wording.happened
    says: dict[str, dict[str, str]] = {}
    unreplaced: dict[str, str] = {}
    additions: Additions = Additions()
    variables: dict[str, str] = {}
    contents: int = 1
    job: Job = Job()
    entry: str = ""
    project: str = ""

    def words(self, content: object) -> str:
        """Return a content in a few words, with the reason that it gives."""
        return wording.short(": ".join(filter(None, (self.about(content), self.why(content)))))

    def addition(self, kind: str) -> Any:
        """Return the object named at this place of `additions`, imported; None where the system
        adds nothing there.
        """
        place = getattr(self.additions, kind)
        return resolved(place) if place else None

    def environment(self, run: Path) -> dict[str, str]:
        """Return what a process of a run needs: its own variables, and those by which `here` finds
        this system.

        Raise NoSystemError where Python could not be told the project's folder.
        """
        if os.pathsep in self.project:
            why = f"a path with {os.pathsep!r} cannot be named in PYTHONPATH; rename the folder"
            raise NoSystemError(f"the system {self.name} is in {self.project}: {why}")
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
        raise NoSystemError(
            f"nothing is at {place!r} ({error}); write package.module:NAME"
        ) from error


class Named(NamedTuple):
    """A system as it is named, with nothing of it imported. `by`: the file that names it; None: the
    caller does, by the environment, or an installed distribution.
    """

    entry: str
    project: str = ""
    by: Path | None = None


def load(entry: str, project: str = "") -> System:
    """The system named `module:NAME`, imported from the folder `project` where one is given."""
    if project and project not in sys.path:
        sys.path.insert(0, project)
    found = resolved(entry)
    if not isinstance(found, System):
        raise NoSystemError(
            f"{entry} is {type(found).__name__}; it must be an operate.system.System"
        )
    return msgspec.structs.replace(found, entry=entry, project=project)


def here(folder: Path | None = None) -> System:
    """The system that is meant where no run tells: of the environment, else of the project that
    `folder` (the current one) is in, else the installed one. Raise NoSystemError where there is
    none, or several are installed, and UntrustedError where others can change the project.
    """
    return _imported(_named_here(folder))


def of_run(run: Path) -> System:
    """The system of a run folder, or of a file in it, as its fleet.json names it; `here` where none
    does.
    """
    return _imported(_named_by(run))


def design_shown(run: Path | None = None) -> designs.Design:
    """The design of `here`, or of a run, for help and completion: nothing of a project is imported.

    A project's is the file that `[tool.roco] design` names. Raise NoSystemError where there is
    none.
    """
    named = _named_here() if run is None else _named_by(run)
    if _is_installed(named):
        return load(named.entry).design
    _refuse_strangers(named)
    own = _table(Path(named.project) / PROJECT_FILE).get("design", "") if named.project else ""
    if not own:
        raise NoSystemError(
            f"help and completion import nothing of a project, and {named.project or named.entry}"
            " names no design file"
            f" that they could read; add to [tool.roco] in its {PROJECT_FILE}: design ="
            ' "package/design.toml"'
        )
    return of_design(Path(named.project) / str(own)).design


def installed_here() -> System | None:
    """The system of `here` where an installed distribution has it; None where a project has, which
    is not imported.
    """
    named = _named_here()
    return load(named.entry) if _is_installed(named) else None


def of_design(file: Path) -> System:
    """The system of a design file alone: contents are not read. Raise NoSystemError where it cannot
    be read.
    """
    try:
        design = designs.load(file)
    except (TopdownError, OSError) as error:
        raise NoSystemError(str(error)) from error
    return System(name=design.file.system.name, design=design, languages=None)


def languages_at(place: str) -> Languages:
    """The Languages at "module:NAME", which the caller named; the folder here is looked in behind
    all others, so that no file of it is taken for a library. Raise NoSystemError where there are
    none.
    """
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))
    found = resolved(place)
    if not isinstance(found, Languages):
        raise NoSystemError(
            f"{place} is {type(found).__name__}; give a fipa_codec.languages.Languages"
        )
    return found


def _named_here(folder: Path | None = None) -> Named:
    if entry := os.environ.get(ENTRY_VARIABLE, ""):
        return Named(entry, os.environ.get(PROJECT_VARIABLE, ""))
    start = (folder or Path.cwd()).resolve()
    for above in (start, *start.parents):
        if entry := str(_table(above / PROJECT_FILE).get("system", "")):
            return Named(entry, str(above), above / PROJECT_FILE)
    return _installed()


def _named_by(run: Path) -> Named:
    file = (run if run.is_dir() else run.parent) / FLEET_FILE
    try:
        told = msgspec.json.decode(_regular(file), type=Fleet)
    except (OSError, msgspec.DecodeError):
        return _named_here()
    project = str(Path(told.project).resolve()) if told.project else ""
    return Named(told.entry, project, file.resolve()) if told.entry else _named_here()


def _imported(named: Named) -> System:
    if not _is_installed(named):
        if os.environ.get(COMPLETING_VARIABLE):
            raise NoSystemError(
                f"completion imports nothing of {named.project or named.entry}; call the verb"
                " itself"
            )
        _refuse_strangers(named)
    return load(named.entry, named.project)


def _refuse_strangers(named: Named) -> None:
    """Raise UntrustedError where others can change the file that names the system, or its
    project.
    """
    if named.by is None:
        return
    places = [named.by, *([Path(named.project)] if named.project else [])]
    found = [(place, why) for place in places if (why := changeable(place))]
    if found:
        trusting = {place if place.is_dir() else place.parent: None for place, _ in found}
        why = "; ".join(dict.fromkeys(why for _, why in found))
        raise UntrustedError(named, why, tuple(trusting))


def _regular(file: Path) -> bytes:
    """Read a file as it should be; one that another user put there may be a pipe, which would never
    end.
    """
    with os.fdopen(os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as opened:
        if not stat.S_ISREG(os.fstat(opened.fileno()).st_mode):
            raise OSError(f"{file} is no regular file")
        return opened.read()


def _table(file: Path) -> dict[str, Any]:
    """[tool.roco] of a pyproject.toml; {} where it has none."""
    try:
        found = tomllib.loads(_regular(file).decode("utf-8-sig")).get("tool", {}).get("roco", {})
    except (OSError, ValueError, AttributeError):  # not there, no text, no TOML; `tool` is no table
        return {}
    return found if isinstance(found, dict) else {}


def _is_installed(named: Named) -> bool:
    return not named.project and named.entry in _points()


def _installed() -> Named:
    found = _points()
    if len(found) == 1:
        return Named(found.pop())
    several = f"several systems are installed: {', '.join(sorted(found))}"
    what = several if found else "no system is installed here"
    raise NoSystemError(
        f'{what}; name one in pyproject.toml: [tool.roco] system = "package.module:NAME"'
    )


def _points() -> set[str]:
    return {point.value for point in entry_points(group=GROUP)}


def _caller() -> str:
    return "root" if os.geteuid() == 0 else "you"

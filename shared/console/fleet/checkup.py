"""`roco doctor`: what is wrong and what to do, check by check; a system adds checks of its own
(Checks).
"""

import ctypes
import datetime as dt
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from enum import StrEnum
from pathlib import Path

import msgspec
import typer
from rich.text import Text

from agent_runtime.io.fleet_processes import started_with
from agent_runtime.io.reaching import LOOPBACK_REMEDY, no_loopback, why_not
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import ROUTER, key_file
from c_library import COMPILER
from console.errors import NO, ConsoleError, DockerError
from console.fleet import identity, targets
from console.fleet.compose import docker
from console.fleet.interfaces import opened
from console.fleet.local import Local
from console.fleet.process_status import Look, Seen, Target, stuck, trouble
from console.fleet.status import GRPC, HOST, WEB, key_folder, key_times, listens, taken
from console.output import Form, Format, RunDir, tell
from console.runs import folders
from console.terminal.console import Console, table
from operate.doing import doing
from operate.fleet_file import Fleet, ProcessState
from operate.system import NoSystemError, UntrustedError, here
from topdown.prove import compiled


class Level(StrEnum):
    """fine; note: worth knowing, nothing fails by it; wrong: something does not work, or soon will
    not.
    """

    FINE = "fine"
    NOTE = "note"
    WRONG = "wrong"


class Check(msgspec.Struct, frozen=True):
    """One check: its subject, the finding, and the remedy."""

    name: str
    level: Level
    what: str
    remedy: str = ""


def fine(name: str, what: str) -> Check:
    return Check(name, Level.FINE, what)


def note(name: str, what: str, remedy: str = "") -> Check:
    return Check(name, Level.NOTE, what, remedy)


def wrong(name: str, what: str, remedy: str) -> Check:
    return Check(name, Level.WRONG, what, remedy)


class Checks(msgspec.Struct, frozen=True):
    """Checks a system adds, or puts in place of those of the same name: of the machine, and of its
    fleet.
    """

    machine: dict[str, Callable[[], Iterator[Check]]] = {}
    fleet: dict[str, Callable[[Target, Look], Iterator[Check]]] = {}


# --- Checks of `roco doctor` without a fleet: Python and its libraries, processor, disk space,
# clock, docker


PROJECT = "robot-companion"
PYTHON = (3, 11)
LEAST_DISK, SMALL_DISK = 1 << 30, 5 << 30
"""Bytes; estimates: a run of an hour with pictures takes some hundred MB."""
FLEET_MEMORY = 1 << 29
"""Bytes that a small fleet uses: 493 MiB resident of router, monitor and five agents (depot,
measured 2026-11-23).
"""
BUSY = 1.5
"""Runnable processes for each processor; above it a start takes several times longer (estimate)."""
IMPORTS = ("zenoh",)
"""Libraries with parts that are not Python: installed is not yet loadable."""
IMPORT_S = 60.0
NEEDED = ("", "monitor")
"""The extras that any fleet on one machine needs; "" is what everybody does."""
CLOCK_S = 5.0


def python() -> Iterator[Check]:
    """Version, and whether it is an environment of its own."""
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info < PYTHON:
        yield wrong(
            "python", f"Python {version}; 3.11 or newer is needed", "make .venv with a newer one"
        )
    elif sys.prefix == sys.base_prefix:
        yield note(
            "python", f"Python {version}, in no environment of its own", "scripts/demo makes .venv"
        )
    else:
        yield fine("python", f"Python {version} in {sys.prefix}")


def libraries(needed: Collection[str] = NEEDED) -> Iterator[Check]:
    """Whether all distributions that the project names for these extras are there."""
    missing = missing_libraries(needed)
    if missing:
        extras = ",".join(sorted({extra for extra, _ in missing if extra}))
        named = ", ".join(sorted(name for _, name in missing))
        install = f"pip install -e '.[{extras}]'" if extras else "pip install -e ."
        yield wrong(
            "libraries", f"not installed: {named}", f"{install}, or scripts/demo, which does it"
        )
    else:
        yield fine("libraries", "all that the fleet needs are installed")


def missing_libraries(needed: Collection[str]) -> list[tuple[str, str]]:
    """Extra and name of each distribution that the fleet needs and that is not there."""
    missing = []
    for wanted in importlib.metadata.requires(PROJECT) or []:
        name = re.split(r"[<>=!~; \[]", wanted, maxsplit=1)[0]
        extra = re.search(r"extra == ['\"](\w+)['\"]", wanted)
        kind = extra[1] if extra else ""
        try:
            importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            if kind in needed:
                missing.append((kind, name))
    return missing


def imports(wanted: Collection[str] = IMPORTS) -> Iterator[Check]:
    """Whether libraries with machine code load: they need others of the system."""
    code = (
        "import importlib, sys\nfor name in sys.argv[1:]:\n  try: importlib.import_module(name)\n"
    )
    code += "  except Exception as error: print(name, '-', error)"
    try:
        command = [sys.executable, "-P", "-c", code, *wanted]
        done = subprocess.run(command, capture_output=True, timeout=IMPORT_S, check=False)
    except subprocess.TimeoutExpired:
        yield note("imports", f"not loaded within {IMPORT_S:.0f} s", "try again later")
        return
    told = done.stdout.decode(errors="replace").strip().splitlines()
    if done.returncode:
        told.append(f"ended with {done.returncode}: {', '.join(wanted)}")
    if told:
        remedy = "of the system: apt install libgomp1 libstdc++6; of Python: as for libraries"
        yield wrong("imports", "; ".join(told), remedy)
    else:
        yield fine("imports", f"{', '.join(wanted)} load")


def loopback(variables: Collection[str] = (GRPC, WEB)) -> Iterator[Check]:
    """Whether processes can meet on the loopback interface, over which everything goes, and whether
    set ports are free.

    `variables`: each with a port, or host:port. A fleet that was started with it says who has the
    port.
    """
    for name in variables:
        value = os.environ.get(name, "")
        host, _, port = value.rpartition(":")
        if not (port.isdecimal() and 0 < int(port) < 65536 and listens(int(port), host or HOST)):
            continue
        if fleet := started_with(name, value):
            remedy = f"for another fleet set {name} to another port"
            yield note(
                "ports", f"{name}: the fleet of {fleet} was started with port {port}", remedy
            )
        else:
            remedy = f"end that program, or set {name} to another port"
            yield wrong("ports", f"{name}: another program listens at port {port}", remedy)
    if why := no_loopback():
        yield wrong("ports", why, LOOPBACK_REMEDY)
    else:
        yield fine("ports", "a port of 127.0.0.1 takes a connection")


def disk() -> Iterator[Check]:
    """Room for recordings."""
    free = shutil.disk_usage(Path.cwd()).free
    words = f"{free / 2**30:.1f} GiB free for runs in {Path.cwd()}"
    if free < LEAST_DISK:
        yield wrong("disk", words, "remove old folders of runs/, or take another place with --out")
    else:
        small = note("disk", words, "remove old folders of runs/")
        yield small if free < SMALL_DISK else fine("disk", words)


def memory(needed: int = FLEET_MEMORY) -> Iterator[Check]:
    """Disk space for a fleet that takes that many bytes."""
    told = re.search(r"MemAvailable:\s+(\d+)", Path("/proc/meminfo").read_text())
    available = int(told[1]) * 1024 if told else 0
    words = f"{available / 2**30:.1f} GiB of memory available"
    if available < needed:
        takes = f"{words}; a fleet takes {needed / 2**30:.2g} GiB"
        yield wrong("memory", takes, "end other programs, or other fleets")
    else:
        yield fine("memory", words)


def processors() -> Iterator[Check]:
    """Load, and whether the clock of the processors is held down."""
    count, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    words = f"{count} processors, load {load:.1f}"
    if load > BUSY * count:
        yield note("processor", words, "end other programs: starts, plans and acts take longer")
    else:
        yield fine("processor", words)
    files = Path("/sys/devices/system/cpu").glob("cpu*/cpufreq/scaling_governor")
    governors = {path.read_text().strip() for path in files}
    if governors - {"performance"}:
        what = f"governor {', '.join(sorted(governors))}: the clock rises only under load"
        remedy = "where the loop must be on time: cpupower frequency-set -g performance"
        yield note("governor", what, remedy)


def clock() -> Iterator[Check]:
    """Whether the clock is kept by the network: communicates carry times."""
    if shutil.which("timedatectl") is None:
        return
    try:
        command = ["timedatectl", "show", "--property=NTPSynchronized", "--value"]
        done = subprocess.run(command, capture_output=True, timeout=CLOCK_S, check=False)
    except subprocess.TimeoutExpired:
        return
    said = done.stdout.decode().strip()
    if said == "no":
        remedy = "timedatectl set-ntp true; only needed for agents on several machines"
        yield note("clock", "the clock is not kept by the network", remedy)
    elif said == "yes":
        yield fine("clock", "the clock is kept by the network")


def containers() -> Iterator[Check]:
    """Whether docker answers, and whether Compose is there, as its plugin or as a program of its
    own.
    """
    try:
        version = docker("version", "--format", "{{.Server.Version}}").decode().strip()
    except DockerError as error:
        remedy = "only needed for containers: start its service, and be in the group docker"
        yield note("docker", str(error), remedy)
        return
    try:
        compose = f"Compose {docker('compose', 'version', '--short').decode().strip()}"
    except DockerError:
        compose = "docker-compose" if shutil.which("docker-compose") else ""
    if compose:
        yield fine("docker", f"engine {version}, {compose}")
    else:
        remedy = (
            "only needed for containers: install its plugin (Debian: apt install docker-compose)"
        )
        yield note("docker", f"engine {version}, but no Compose", remedy)


def in_c(
    name: str, library: ctypes.CDLL | None, package: str, what: str, without: str
) -> Iterator[Check]:
    """Whether a library in C is loaded. `what`: its use; `without`: the cost of its absence."""
    if library is not None:
        yield fine(name, what)
    else:
        remedy = f"`python -m {package}` builds it, with {COMPILER}"
        yield note(name, f"no library of {package}: {without}", remedy)


def explorer() -> Iterator[Check]:
    """Whether `roco design verify` explores in C here."""
    slow = "large designs are verified about five times more slowly"
    what = "`roco design verify` explores in C"
    yield from in_c("explorer", compiled.library(), "topdown.prove.compiled", what, slow)


MACHINE: dict[str, Callable[[], Iterator[Check]]] = {
    "python": python,
    "libraries": libraries,
    "imports": imports,
    "ports": loopback,
    "disk": disk,
    "memory": memory,
    "processor": processors,
    "clock": clock,
    "docker": containers,
    "explorer": explorer,
}


# --- Checks of `roco doctor` between a fleet's processes and its router: processes that are
# refused, and the reason


LINES = 1000
"""Lines of the router's log that are looked at, the last ones: one of Zenoh's for each refusal
(estimate).
"""
_REFUSED = re.compile(r"(?P<at>[\d-]+T[\d:]+)\S* +WARN .*zenoh_link_tls\S* (?P<why>.*?)\. Hint: ")
_COLOUR = re.compile(r"\x1b\[\d+m")
REASONS = {
    "certificate expired": "its certificate has ended",
    "not valid yet": "its certificate does not hold yet: is a clock behind?",
    "BadSignature": "its certificate is of another authority",
    "UnknownIssuer": "its certificate is of another authority",
    "extended key usage": "its certificate is not for a client",
    "sent no certificates": "it has no certificate",
    "corrupt message": "it speaks no TLS",
    "SupportedVersionsExtensionRequired": "its TLS is older than 1.3",
    "fatal alert": "it does not take the router's certificate",
    "handshake eof": "it went away amid the handshake",
}
"""Words of the router's log (rustls), in the words of who reads them."""


def router(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the router lets this command line in, and each process that has no router; else
    why.
    """
    told = now.fleet
    if not isinstance(fleet, Local) or told is None:
        return
    if not any(status.pid for status in told.processes):
        return
    if why := _why(fleet, told, identity.CONSOLE, told.connect):
        yield wrong(
            ROUTER, why, f"`roco agent restart {ROUTER}`; new keys: `roco down`, then `roco up`"
        )
    else:
        yield fine(ROUTER, f"listens at {told.connect}")
    for one in now.seen:
        keys = key_file(fleet.run / KEYS_FOLDER, one.name).is_file()
        # or had none yet
        lacks = one.status.pid and one.name != ROUTER and (one.beat is None or not one.beat.up)
        if keys and lacks and (own := _why(fleet, told, one.name, told.connect)):
            yield wrong(one.name, f"no router: {own}", f"see {one.name}.log of the run")


def _why(fleet: Local, told: Fleet, name: str, address: str) -> str:
    try:
        return why_not(address, identity.tls(fleet.run, told, name))
    except ConsoleError as error:  # keys are missing
        return str(error)


def refusals(fleet: Target, now: Look) -> Iterator[Check]:
    """Sessions that the router did not let in, by reason, as its log has them."""
    lines: list[str] = []
    with suppress(ConsoleError):  # unknown, or no container of it runs; told elsewhere
        lines += fleet.log(ROUTER, LINES)
    found = [match for line in lines if (match := _REFUSED.match(_COLOUR.sub("", line)))]
    if found:
        counted = Counter(reason(match["why"]) for match in found)
        words = "; ".join(f"{count} × {why}" for why, count in counted.most_common())
        last = max(match["at"] for match in found).replace("T", " ")
        what = f"{len(found)} sessions were refused, the last at {last} UTC: {words}"
        yield note(
            "refusals", what, "router.log has a line for each; who is refused: docs/security.md"
        )


def interfaces(fleet: Target, now: Look) -> Iterator[Check]:
    """Who may come in from outside, and where."""
    if now.fleet is not None:
        for name, what in opened(fleet):
            yield fine(name, what)


def reason(logged: str) -> str:
    """The router's word for a refusal in the words of who reads it; as it is, where it is none of
    those known.
    """
    return next((words for word, words in REASONS.items() if word in logged), logged)


# --- Checks of `roco doctor` on a fleet: its processes, keys, and leftovers of earlier runs -------


SOON = dt.timedelta(hours=12)
"""A certificate that ends before is told: a run may go on over night (estimate)."""
AHEAD_S = 1.0
"""A file from the future by more than this: the clock was set back."""


def processes(fleet: Target, now: Look) -> Iterator[Check]:
    """Each process that is not as it should be; all in one row where none is."""
    seen = now.seen
    running = [one for one in seen if one.status.pid]
    if not running:
        yield note("fleet", f"nothing of {fleet.where} runs", "`roco up` starts a fleet")
        return
    found = [check for one in seen if (check := _process(one))]
    yield from found
    if not found:
        yield fine("fleet", f"{len(running)} processes of {fleet.where}, all ready")


def _process(one: Seen) -> Check | None:
    """Return the check of a process with a problem and its remedy; None if it has none."""
    name, status = one.name, one.status
    log = f"see {name}.log of the run"
    remedies = {
        ProcessState.STOPPED: f"`roco agent start {name}`",
        ProcessState.GIVEN_UP: f"{log}, then `roco agent start {name}`",
        ProcessState.BACKING_OFF: f"it is started again; {log} if it goes on",
        ProcessState.STARTING: f"wait; {log} if it goes on",
        ProcessState.WAITING: "it waits for others; see those",
    }
    words = stuck(one)
    if words and one.used is not None and one.used.frozen:
        return wrong(name, words, f"kill -CONT {status.pid}, or `roco agent restart {name}`")
    if words:
        return wrong(name, words, f"`roco agent restart {name}`; {log}")
    if status.state in remedies:
        level = Level.NOTE if status.optional else Level.WRONG
        words = f"{status.state}{': ' + status.note if status.note else ''}"
        return Check(name, level, words, remedies[status.state])
    words = trouble(one)
    if words and one.beat is not None and words == one.beat.trouble:
        return wrong(name, words, "make room (`df -h`, `roco runs --remove`); it goes on by itself")
    return wrong(name, words, f"`roco agent restart {name}`; {log}") if words else None


def supervisor(fleet: Target, now: Look) -> Iterator[Check]:
    """Processes that nobody keeps."""
    told = now.fleet
    if not isinstance(fleet, Local) or told is None:
        return
    if now.unkept:
        yield wrong("supervisor", now.unkept, f"`roco down --run-dir {fleet.run}`, then `roco up`")
    elif any(status.pid for status in told.processes):
        yield fine("supervisor", f"lives, pid {told.supervisor}")


def held(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the robot may move."""
    if now.stop_held:
        yield note("stop", "the robot is held", "`roco release` lets it move")


def certificates(fleet: Target, now: Look) -> Iterator[Check]:
    """Yield a check of how long the keys are still valid."""
    folder = key_folder(fleet, now)
    if folder is None:
        return
    times, at = key_times(folder), dt.datetime.now(dt.UTC)
    anew = "`roco down`, then `roco up` makes them anew; keys of `--keys`: `roco keys make`"
    if times is None:
        yield wrong("keys", f"no certificate in {folder}", anew)
    elif why := times.trouble(at):
        yield wrong("keys", why, anew)
    else:
        words = f"hold until {times.end:%Y-%m-%d %H:%M} UTC"
        soon = note("keys", words, "restart the fleet before then")
        yield soon if times.end - at < SOON else fine("keys", words)


def clock_jump(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether a heartbeat comes from the future."""
    if not isinstance(fleet, Local):
        return
    beats = [file.stat().st_mtime for file in fleet.run.glob("*.heartbeat.json")]
    ahead = max(beats, default=0.0) - time.time()
    if ahead > AHEAD_S:
        what = f"heartbeats are {ahead:.0f} s ahead of the clock: it was set back"
        yield wrong("clock", what, "`roco down`, then `roco up`")


def stale(fleet: Target, now: Look) -> Iterator[Check]:
    """Processes of other runs that were left behind."""
    here = fleet.run if isinstance(fleet, Local) else None
    for one in folders.living_here():
        if one.run.resolve() == here:
            continue
        alone = "" if one.fleet.supervisor else ", without a supervisor"
        what = f"{len(one.names)} processes of {one.run} live too{alone}"
        level = Level.NOTE if one.fleet.supervisor else Level.WRONG
        yield Check("other runs", level, what, f"`roco down --run-dir {one.run}`")


def pictures(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the ports that are set for the pictures are the monitor's own."""
    for port in taken(fleet, now):
        yield wrong("pictures", f"none: {port.words}", port.remedy)


FLEET: dict[str, Callable[[Target, Look], Iterator[Check]]] = {
    "processes": processes,
    "supervisor": supervisor,
    "router": router,
    "refusals": refusals,
    "interfaces": interfaces,
    "stop": held,
    "keys": certificates,
    "pictures": pictures,
    "clock": clock_jump,
    "other runs": stale,
}


# --- `roco doctor` --------------------------------------------------------------------------------


MARKS = {Level.FINE: ("✓", "green"), Level.NOTE: ("i", "yellow"), Level.WRONG: ("✗", "bold red")}


class Diagnosis(msgspec.Struct, frozen=True):
    """`roco doctor --format json`."""

    where: str
    wrong: int
    checks: tuple[Check, ...]


def doctor(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Check machine, installation and fleet: what is wrong, why, and what to do. Exits with 1 where
    something is.

    Examples:
      roco doctor
      roco doctor --format json
      roco doctor --target compose
    """
    fleet, reason = found(target, run_dir)
    with doing("checking") as say:
        checks = tuple(examined(fleet, reason, say))
    count = sum(check.level is Level.WRONG for check in checks)
    tell(
        Diagnosis(fleet.where if fleet else "", count, checks),
        form,
        lambda: show(checks, Console()),
    )
    if count:
        raise typer.Exit(NO)


def found(target: str, run_dir: Path | None) -> tuple[Target | None, str]:
    """The fleet that is meant; without one only machine and installation are checked, unless it was
    named.
    """
    try:
        return targets.find(target, run_dir), ""
    except ConsoleError as error:
        if target or run_dir is not None:
            raise
        return None, str(error)


def examined(fleet: Target | None, reason: str, say: Callable[[str], None]) -> Iterator[Check]:
    """The checks one after the other."""
    own = _own(fleet)
    for name, check in (MACHINE | own.machine).items():
        say(f"checking {name}")
        yield from check()
    if fleet is None:
        yield note("fleet", reason)
        return
    now = fleet.look()
    for name, of_fleet in (FLEET | own.fleet).items():
        say(f"checking {name}")
        yield from of_fleet(fleet, now)


def _own(fleet: Target | None) -> Checks:
    """Return the checks added by the system of a fleet, or else of this folder; none if there is no
    system. Raise UntrustedError where the system is there, and others can change its code.
    """
    try:
        found: Checks | None = (fleet.system if fleet is not None else here()).addition("checks")
    except UntrustedError:
        raise
    except NoSystemError:
        return Checks()
    return found or Checks()


def show(checks: tuple[Check, ...], console: Console) -> None:
    """A row for each: what is, and below it what to do."""
    rows = []
    for check in checks:
        mark, style = MARKS[check.level]
        what = Text(check.what, style if check.level is Level.WRONG else "")
        if check.remedy:
            what.append(f"\n→ {check.remedy}", "not bold cyan")
        rows.append((Text(mark, style), Text(check.name, "bold"), what))
    console.print(table(("mark", "name", "what"), rows, fold=("what",), show_header=False))
    count = sum(check.level is Level.WRONG for check in checks)
    console.print(
        f"{count} of {len(checks)} checks found something wrong" if count else "nothing is wrong"
    )

"""Checks of `roco doctor` without a fleet: Python and its libraries, processor, disk space, clock, docker."""

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from agent_runtime.io.fleet_processes import started_with
from agent_runtime.io.reaching import LOOPBACK_REMEDY, no_loopback
from operate.cli.errors import DockerError
from operate.cli.fleet.checkup import Check, Level
from operate.cli.fleet.docker import docker
from operate.cli.fleet.picture_ports import GRPC, WEB, listens

PROJECT = "robot-companion"
PYTHON = (3, 11)
LEAST_DISK, SMALL_DISK = 1 << 30, 5 << 30
"""Bytes; estimates: a run of an hour with pictures takes some hundred MB."""
FLEET_MEMORY = 1 << 29
"""Bytes that a small fleet uses: 493 MiB resident of router, monitor and five agents (depot, measured 2026-11-23)."""
BUSY = 1.5
"""Runnable processes for each processor; above it a start takes several times longer (estimate)."""
IMPORTS = ("zenoh",)
"""Libraries with parts that are not Python: installed is not yet loadable."""
IMPORT_S = 60.0
NEEDED = ("", "monitor")
"""The extras that any fleet on one machine needs; "" is what everybody does."""
CLOCK_S = 5.0
PROCESSORS = Path("/sys/devices/system/cpu")


def python() -> Iterator[Check]:
    """Version, and whether it is an environment of its own."""
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info < PYTHON:
        yield Check("python", Level.WRONG, f"Python {version}; 3.11 or newer is needed", "make .venv with a newer one")
    elif sys.prefix == sys.base_prefix:
        yield Check("python", Level.NOTE, f"Python {version}, in no environment of its own", "scripts/demo makes .venv")
    else:
        yield Check("python", Level.FINE, f"Python {version} in {sys.prefix}")


def libraries(needed: Collection[str] = NEEDED) -> Iterator[Check]:
    """Whether all distributions that the project names for these extras are there."""
    missing = missing_libraries(needed)
    if missing:
        extras = ",".join(sorted({extra for extra, _ in missing if extra}))
        named = ", ".join(sorted(name for _, name in missing))
        install = f"pip install -e '.[{extras}]'" if extras else "pip install -e ."
        yield Check("libraries", Level.WRONG, f"not installed: {named}", f"{install}, or scripts/demo, which does it")
    else:
        yield Check("libraries", Level.FINE, "all that the fleet needs are installed")


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
    code = "import importlib, sys\nfor name in sys.argv[1:]:\n  try: importlib.import_module(name)\n"
    code += "  except Exception as error: print(name, '-', error)"
    try:
        command = [sys.executable, "-P", "-c", code, *wanted]
        done = subprocess.run(command, capture_output=True, timeout=IMPORT_S, check=False)
    except subprocess.TimeoutExpired:
        yield Check("imports", Level.NOTE, f"not loaded within {IMPORT_S:.0f} s", "try again later")
        return
    told = done.stdout.decode(errors="replace").strip().splitlines()
    if done.returncode:
        told.append(f"ended with {done.returncode}: {', '.join(wanted)}")
    if told:
        remedy = "of the system: apt install libgomp1 libstdc++6; of Python: as for libraries"
        yield Check("imports", Level.WRONG, "; ".join(told), remedy)
    else:
        yield Check("imports", Level.FINE, f"{', '.join(wanted)} load")


def loopback(variables: Collection[str] = (GRPC, WEB)) -> Iterator[Check]:
    """Whether processes can meet on the loopback interface, over which everything goes, and whether set ports are free.

    `variables`: each with a port, or host:port. A fleet that was started with it says who has the port.
    """
    for name in variables:
        value = os.environ.get(name, "")
        port = value.rpartition(":")[2]
        if not (port.isdecimal() and 0 < int(port) < 65536 and listens(int(port))):
            continue
        if fleet := started_with(name, value):
            remedy = f"for another fleet set {name} to another port"
            yield Check("ports", Level.NOTE, f"{name}: the fleet of {fleet} was started with port {port}", remedy)
        else:
            remedy = f"end that program, or set {name} to another port"
            yield Check("ports", Level.WRONG, f"{name}: another program listens at port {port}", remedy)
    if why := no_loopback():
        yield Check("ports", Level.WRONG, why, LOOPBACK_REMEDY)
    else:
        yield Check("ports", Level.FINE, "a port of 127.0.0.1 takes a connection")


def disk() -> Iterator[Check]:
    """Room for recordings."""
    free = shutil.disk_usage(Path.cwd()).free
    words = f"{free / 2**30:.1f} GiB free for runs in {Path.cwd()}"
    if free < LEAST_DISK:
        yield Check("disk", Level.WRONG, words, "remove old folders of runs/, or take another place with --out")
    else:
        level = Level.NOTE if free < SMALL_DISK else Level.FINE
        yield Check("disk", level, words, "remove old folders of runs/" if level is Level.NOTE else "")


def memory(needed: int = FLEET_MEMORY) -> Iterator[Check]:
    """Disk space for a fleet that takes that many bytes."""
    told = re.search(r"MemAvailable:\s+(\d+)", Path("/proc/meminfo").read_text())
    available = int(told[1]) * 1024 if told else 0
    words = f"{available / 2**30:.1f} GiB of memory available"
    if available < needed:
        yield Check(
            "memory",
            Level.WRONG,
            f"{words}; a fleet takes {needed / 2**30:.2g} GiB",
            "end other programs, or other fleets",
        )
    else:
        yield Check("memory", Level.FINE, words)


def processors() -> Iterator[Check]:
    """Load, and whether the clock of the processors is held down."""
    count, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    words = f"{count} processors, load {load:.1f}"
    if load > BUSY * count:
        yield Check("processor", Level.NOTE, words, "end other programs: starts, plans and acts take longer")
    else:
        yield Check("processor", Level.FINE, words)
    governors = {
        path.read_text().strip() for path in Path("/sys/devices/system/cpu").glob("cpu*/cpufreq/scaling_governor")
    }
    if governors - {"performance"}:
        what = f"governor {', '.join(sorted(governors))}: the clock rises only under load"
        yield Check(
            "governor", Level.NOTE, what, "where the loop must be on time: cpupower frequency-set -g performance"
        )


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
        yield Check("clock", Level.NOTE, "the clock is not kept by the network", remedy)
    elif said == "yes":
        yield Check("clock", Level.FINE, "the clock is kept by the network")


def containers() -> Iterator[Check]:
    """Whether docker answers, and whether Compose is there, as its plugin or as a program of its own."""
    try:
        version = docker("version", "--format", "{{.Server.Version}}").decode().strip()
    except DockerError as error:
        remedy = "only needed for containers: start its service, and be in the group docker"
        yield Check("docker", Level.NOTE, str(error), remedy)
        return
    try:
        compose = f"Compose {docker('compose', 'version', '--short').decode().strip()}"
    except DockerError:
        compose = "docker-compose" if shutil.which("docker-compose") else ""
    if compose:
        yield Check("docker", Level.FINE, f"engine {version}, {compose}")
    else:
        remedy = "only needed for containers: install its plugin (Debian: apt install docker-compose)"
        yield Check("docker", Level.NOTE, f"engine {version}, but no Compose", remedy)


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
}

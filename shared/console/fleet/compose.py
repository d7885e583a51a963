"""A fleet in containers (deploy/compose.yaml): seen through docker, with one shell in each
container for a look.

Each service has its own run folder, in its own volume. A container with several processes has a
supervisor in it and its fleet.json; of the others docker knows whether they run.
"""

import shutil
import string
import subprocess
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import cached_property
from typing import Any

import msgspec

from agent_runtime.io.run_files import KEYS_VARIABLE, RUN_FOLDER_VARIABLE, STOP_FILE
from agent_runtime.io.secured import ROUTER
from console.errors import DockerError, FleetError, NoRunError, UsageError, last_line
from console.fleet import process_status
from console.fleet.identity import OPERATOR
from console.fleet.process_status import Look, Put, Seen, Target
from console.runs import folders
from operate import proc
from operate.fault_proxy import files
from operate.file_names import FAULTS_FILE, FLEET_FILE, OFF_SUFFIX, VERDICTS_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.system import System, here
from operate.verdict_lines import Judged

ANSWER_S = 20.0
"""An answer takes 0.1 s; a loaded machine some seconds (estimate)."""
IMAGES, SYSTEM = "robot-companion/", "robot-companion.system"
"""Beginning of the names of our images; label of a container with any image: the system of its
fleet.
"""
PROJECT, SERVICE = "com.docker.compose.project", "com.docker.compose.service"


class State(msgspec.Struct, rename="pascal"):
    """Of `docker inspect`: whether it runs; `health`: what its health check says."""

    status: str
    health: dict[str, Any] | None = None
    exit_code: int = 0


class Config(msgspec.Struct, rename="pascal"):
    """Of `docker inspect`: what it was made with."""

    image: str = ""
    labels: dict[str, str] = {}
    env: list[str] = []


class Container(msgspec.Struct, rename="pascal"):
    """A container, as far as it is wanted."""

    id: str
    state: State
    config: Config
    restart_count: int = 0
    network_settings: dict[str, Any] = {}

    @property
    def service(self) -> str:
        return self.config.labels.get(SERVICE, "")

    @property
    def project(self) -> str:
        return self.config.labels.get(PROJECT, "")

    @property
    def ours(self) -> bool:
        return SYSTEM in self.config.labels or self.config.image.startswith(IMAGES)

    @property
    def runs(self) -> bool:
        return self.state.status == "running"

    @property
    def healthy(self) -> bool:
        return (self.state.health or {}).get("Status") == "healthy"

    def variable(self, name: str) -> str:
        """The value of a variable of its environment, "" where it is not set."""
        return dict(one.split("=", 1) for one in self.config.env if "=" in one).get(name, "")


def command(*words: str) -> list[str]:
    """Return the command that calls docker. Raises DockerError if docker is missing."""
    program = shutil.which("docker")
    if program is None:
        raise DockerError("docker is not installed")
    return [program, *words]


def docker(*words: str, timeout_s: float = ANSWER_S, data: bytes = b"") -> bytes:
    """Return docker's output. Raises DockerError if docker is missing, refuses, or does not
    answer.
    """
    try:
        done = subprocess.run(command(*words), input=data, capture_output=True, timeout=timeout_s)
    except subprocess.TimeoutExpired:
        raise DockerError(
            f"docker did not answer within {timeout_s:.0f} s (docker {words[0]})"
        ) from None
    if done.returncode:
        why = last_line(done.stderr) or f"exit code {done.returncode}"
        raise DockerError(f"docker {words[0]}: {why}")
    return done.stdout


def ours() -> list[Container]:
    """Return the containers of compose projects that are fleets, also those that have ended."""
    listed = docker("ps", "--all", "--quiet", "--no-trunc", "--filter", f"label={PROJECT}")
    return [one for one in inspected(listed.decode().split()) if one.ours]


def inspected(ids: list[str]) -> list[Container]:
    """Containers by id."""
    return msgspec.json.decode(docker("inspect", *ids), type=list[Container]) if ids else []


def executed(ids: list[str], script: str) -> list[bytes]:
    """Return the output of a shell script in each container, run in parallel; b"" where it cannot
    run.
    """

    def one(id: str) -> bytes:
        try:
            return docker("exec", id, "sh", "-c", script)
        except DockerError:
            return b""

    if not ids:
        return []
    with ThreadPoolExecutor(len(ids)) as together:
        return list(together.map(one, ids))


# --- Contents of one look into a container: its run folder and /proc on one sheet, written by a few
# lines of shell
# A Python started in each container would cost more than all that it looks at.


MARK = "@@"
SHEET = f"""cd "${RUN_FOLDER_VARIABLE}" || exit
echo "{MARK} now $(date +%s.%N)"
echo "{MARK} began $(stat -c %.Y /dev)"
for file in *.heartbeat.json *.ready {FLEET_FILE} {STOP_FILE}; do
  when=$(stat -c %.Y "$file" 2>/dev/null) && echo "{MARK} $file $when" && cat "$file" && echo
done
echo "{MARK} stat 0"
cat /proc/[0-9]*/stat 2>/dev/null
true"""


class Sheet(msgspec.Struct, frozen=True):
    """`files`: by name, with the time of their last change; `now`, `began`: the container's clock,
    and its start.
    """

    now: float = 0.0
    began: float = 0.0
    files: dict[str, tuple[float, bytes]] = {}
    stats: dict[int, proc.Stat] = {}

    @property
    def fleet(self) -> Fleet | None:
        """The fleet as reported by a supervisor in the container."""
        try:
            return msgspec.json.decode(self.files[FLEET_FILE][1], type=Fleet)
        except (KeyError, msgspec.DecodeError):
            return None

    @property
    def stop_held(self) -> bool:
        return self.files.get(STOP_FILE, (0.0, b""))[1][:1] == b"\x01"

    def ready(self, name: str) -> bool:
        """Whether a process said that it can serve since the container started."""
        return self.files.get(f"{name}.ready", (0.0, b""))[0] >= self.began > 0

    def beat(self, name: str) -> tuple[process_status.Beat | None, float | None]:
        """A heartbeat and its age [s]."""
        changed, data = self.files.get(f"{name}.heartbeat.json", (0.0, b""))
        return (process_status.beat(data), max(0.0, self.now - changed)) if data else (None, None)

    def pid(self, name: str) -> int:
        """The process of a container that has one: as its heartbeat says, else the child of the
        first process.
        """
        beat, _ = self.beat(name)
        if beat is not None and beat.pid in self.stats:
            return beat.pid
        return min((stat.pid for stat in self.stats.values() if stat.parent == 1), default=0)


def sheet(data: bytes) -> Sheet:
    """Read what the script wrote."""
    times: dict[str, float] = {}
    texts: dict[str, list[bytes]] = {}
    name = ""
    for line in data.split(b"\n"):
        if line.startswith(MARK.encode() + b" "):
            _, name, when = line.decode().split(" ")
            times[name], texts[name] = float(when), []
        elif name:
            texts[name].append(line)
    stats = proc.stats(line.decode(errors="replace") for line in texts.pop("stat", []))
    now, began = times.get("now", 0.0), times.get("began", 0.0)
    kept = texts.keys() - {"now", "began"}
    files = {name: (times[name], b"\n".join(texts[name])) for name in kept}
    return Sheet(now, began, files, stats)


# --- A fleet in containers (deploy/compose.yaml) --------------------------------------------------


MONITOR, WIRES = "monitor", "wires"
WITH_WIRES = "start it with its compose.faults.yaml as a second file (docs/faults.md)"
END_S = 90.0
"""Docker waits up to a minute for the monitor's report (compose.yaml: stop_grace_period), and for
the rest seconds.
"""
MONITOR_S, PERIOD_S = 60.0, 0.2
"""Longest wait for a monitor that is started again, and time between two tries; Docker waits for up
to a minute when a container ends again and again.
"""
GUARDED = (
    "--read-only",
    "--tmpfs=/tmp",
    "--cap-drop=ALL",
    "--security-opt=no-new-privileges:true",
    "--pids-limit=64",
)
"""As the services themselves are (compose.yaml)."""
ORDER = (ROUTER, "monitor", "wires")
"""Started first and ended last."""
CONTAINER = {"created": ProcessState.WAITING, "restarting": ProcessState.BACKING_OFF}
"""States of containers without a process, by docker's word; any other was stopped."""


def projects(*, ended: bool = False) -> tuple[str, ...]:
    """The compose projects of ours of which something runs, or is there at all; none where docker
    is not there.
    """
    try:
        return tuple(sorted({one.project for one in ours() if one.runs or ended}))
    except DockerError:
        return ()


class Compose(Target):
    """The fleet of a compose project; of several robots in it, with `robot`, that one alone and
    what all share.

    Every call raises DockerError where docker does not do it.
    """

    def __init__(self, project: str, robot: str = "") -> None:
        self.project, self._robot = project, robot
        self.name = f"{project}/{robot}".rstrip("/")
        self.where = f"compose project {project}" + (f", robot {robot}" if robot else "")
        self._ids: list[str] = []

    @cached_property
    def system(self) -> System:
        return here()

    def look(self) -> Look:
        containers = self._containers()
        running = [one.id for one in containers if one.runs]
        at = time.monotonic()
        outputs = dict(zip(running, executed(running, SHEET), strict=True))
        sheets = [(one, sheet(outputs.get(one.id, b""))) for one in containers]
        found = tuple(seen for container, read in sheets for seen in _of(container, read))
        router = next((one for one in containers if one.service == "router"), containers[0])
        statuses = tuple(one.status for one in found)
        told = Fleet(router.variable("ROCO_SYSTEM"), self.where, 0, 0.0, statuses)
        return Look(told, found, any(read.stop_held for _, read in sheets), at)

    def verdicts(self) -> list[Judged]:
        return folders.verdicts_in(self.recorded(VERDICTS_FILE).splitlines())

    def hearing(self) -> list[str]:
        """The command that prints what goes by as samples, a JSON object a line, until its standard
        input ends.
        """
        module = next(one.module for one in self.system.processes if one.name == MONITOR)
        hear = ("python", "-P", "-m", module, "hear", "--systems", self._name())
        return command("exec", "--interactive", self._running(MONITOR).id, *hear)

    def beside(self, service: str, words: list[str]) -> list[str]:
        """The command that runs a module of ours beside a service: with its volumes, keys and
        network, as guarded.
        """
        found = self._find(service)
        if found is None:
            raise DockerError(f"{self.where} has no service {service}")
        volumes = f"--volumes-from={found.id}"
        return command("run", "--rm", *_options(found), volumes, found.config.image, *words)

    def read(self, name: str, file: str, offset: int = 0) -> bytes:
        return self._shell(name, _reading((f"${RUN_FOLDER_VARIABLE}/{file}",), offset))

    def logged(self, name: str, offset: int) -> bytes:
        with suppress(DockerError):
            return super().logged(name, offset)
        return b""

    def recorded(self, file: str, offset: int = 0) -> bytes:
        """With several robots each has a folder of the monitor's."""
        run = f"${RUN_FOLDER_VARIABLE}"
        return self._shell(
            MONITOR, _reading((f"{run}/{self._name()}/{file}", f"{run}/{file}"), offset)
        )

    def put(self, file: str, data: bytes) -> None:
        raise FleetError(
            f"the processes of {self.where} share no run folder for {file}; a local fleet does:"
            " `roco up`"
        )

    def hold(self, name: str, held: bool) -> None:
        """Set the stop flag of a process, or clear it: one byte, written in place, since the file
        may be mapped.

        Where none of several robots is named all are held. UsageError: one must be named to be
        released.
        """
        script = f"printf '\\{int(held):03o}' 1<> \"${RUN_FOLDER_VARIABLE}/{STOP_FILE}\""
        running = (one for one in self._containers() if one.runs)
        robots = [one for one in running if one.service.rstrip(string.digits) == name]
        if len(robots) < 2:
            self._shell(name, script)
        elif held:
            for robot in robots:
                docker("exec", robot.id, "sh", "-c", script)
        else:
            names = " or ".join(f"{self.project}/{one.variable('ROCO_SYSTEM')}" for one in robots)
            raise UsageError(
                f"{self.where} has several robots; name the one to release: --target {names}"
            )

    def switch(self, name: str, on: bool) -> None:
        """Start a process, or end it and keep it down; where it shares its container, its
        supervisor does it.
        """
        container = self._home(name)
        # by a supervisor in it
        kept = sheet(executed([container.id], SHEET)[0]).fleet if container.runs else None
        shared = kept is not None and name in (status.name for status in kept.processes)
        if container.service != name or shared:
            file = f'"${RUN_FOLDER_VARIABLE}/{name}{OFF_SUFFIX}"'
            self._shell(container.service, f"rm -f {file}" if on else f"touch {file}")
        else:
            begin = "unpause" if container.state.status == "paused" else "start"
            docker(begin if on else "stop", container.id, timeout_s=END_S)

    def signal(self, name: str, number: int) -> None:
        one = self._living(name)
        pid = one.status.pid
        # or it ended since the look
        self._shell(one.home, f"kill -{number} {pid} || [ ! -e /proc/{pid} ]")

    def writing(self, name: str, possible: bool) -> None:
        one, limit = self._living(name), "unlimited" if possible else 0
        self._shell(one.home, f"prlimit --pid {one.status.pid} --fsize={limit}:")

    def clock(self, name: str, seconds: float) -> None:
        if seconds:
            raise FleetError(
                f"{name} of {self.where} has no clock of its own; a local fleet has: `roco up"
                " --faults`"
            )

    def variable(self, name: str, variable: str) -> str:
        return self._home(name).variable(variable)

    def wire(self, name: str, kind: str, amount: float | None) -> None:
        told = self.read(WIRES, files.WIRES_FILE) if self._find(WIRES) is not None else b""
        if not told:
            if amount is not None:
                raise FleetError(f"the agents of {self.where} have no wires; {WITH_WIRES}")
            return
        wires = msgspec.json.decode(told, type=files.Wires)
        if amount is not None and (missing := wires.missing(name)):
            raise FleetError(missing)
        file = f'"${RUN_FOLDER_VARIABLE}/{name}.{kind}{files.SUFFIX}"'
        put = f"printf %s {amount} > {file}.new && mv {file}.new {file}"
        self._shell(WIRES, f"rm -f {file}" if amount is None else put)

    def add_fault(self, line: bytes) -> None:
        """Append a line to faults.jsonl, beside the monitor's recording; waits while the monitor is
        started again.
        """
        until, run = time.monotonic() + MONITOR_S, f"${RUN_FOLDER_VARIABLE}"
        while True:
            try:
                script = f'd="{run}/{self._name()}"; [ -d "$d" ] || d="{run}"'
                script += f'; cat >> "$d/{FAULTS_FILE}"'
                monitor = self._running(MONITOR).id
                docker("exec", "--interactive", monitor, "sh", "-c", script, data=line)
                return
            except DockerError:
                if time.monotonic() > until:
                    raise
                time.sleep(PERIOD_S)

    def down(self) -> tuple[str, ...]:
        """End the containers in order; volumes, networks and containers stay."""
        running = {one.service: one.id for one in self._containers() if one.runs}
        first = [name for name in running if name not in ORDER]
        for names in (first, *([name] for name in reversed(ORDER) if name in running)):
            if names:
                docker("stop", *(running[name] for name in names), timeout_s=END_S)
        return tuple(running)

    def log(self, name: str, lines: int) -> tuple[str, ...]:
        said = docker("logs", "--tail", str(lines), self._home(name).id)
        return tuple(said.decode(errors="replace").splitlines())

    def operating(self) -> AbstractContextManager[Put]:
        """A session of the operator: each put is a container of its own, with the operator's keys
        and no others.
        """
        return nullcontext(self._put)

    def speaking(self, identity: str, to: str) -> AbstractContextManager[Put]:
        raise FleetError(
            f"the keys of {self.where} stay in its containers; flood a local fleet: `roco up`"
        )

    def _living(self, name: str) -> Seen:
        one = next((one for one in self.look().seen if one.name == name and one.status.pid), None)
        if one is None:
            raise FleetError(
                f"{name} of {self.where} does not run; `roco agent start {name}` starts it"
            )
        return one

    def _put(self, key: str, data: bytes) -> None:
        agent = next(self._living_agents(), None)
        if agent is None:
            raise DockerError(f"no agent of {self.where} runs; `roco agent start` starts one")
        options = [*_options(agent), "--entrypoint=python"]
        if keys := agent.variable(KEYS_VARIABLE):
            options.append(f"--volume={self.project}_keys-{OPERATOR}:{keys}:ro")
        words = (agent.config.image, "-m", "console.fleet.identity", key, data.hex())
        docker("run", "--rm", *options, *words, timeout_s=END_S)

    def logging(self) -> tuple[str, ...]:
        names = (*self.system.design.agents, MONITOR)
        return tuple(name for name in names if (found := self._find(name)) and found.runs)

    def _living_agents(self) -> Iterator[Container]:
        found = map(self._find, self.system.design.agents)
        return (one for one in found if one is not None and one.runs)

    def _containers(self) -> list[Container]:
        """The services, in the order of a start."""
        try:
            found = inspected(self._ids)
        except DockerError:  # recreated meanwhile, under other ids
            found = []
        found = found or [one for one in ours() if one.project == self.project and self._meant(one)]
        self._ids = [one.id for one in found]
        if not found:
            raise NoRunError(self.project, f"no container of {self.where} is there any more")
        places = {service: place for place, service in enumerate(ORDER)}
        return sorted(found, key=lambda one: (places.get(one.service, 9), one.service))

    def _meant(self, container: Container) -> bool:
        """Whether it is this robot's, or all robots'."""
        systems = container.variable("ROCO_SYSTEMS") or container.variable("ROCO_SYSTEM")
        return not self._robot or self._robot in systems.split(",")

    def _find(self, service: str) -> Container | None:
        """The container of a service; of one of several robots its own, whose name may end with a
        number.
        """
        digits = string.digits if self._robot else ""
        return next(
            (one for one in self._containers() if one.service.rstrip(digits) == service), None
        )

    def _home(self, name: str) -> Container:
        """The container in which a process runs. UsageError where there is none of that name."""
        homes = {one.name: one.home for one in self.look().seen}
        if name not in homes:
            raise UsageError(f"no process is called {name!r}; there are {', '.join(homes)}")
        return next(one for one in self._containers() if one.service == homes[name])

    def _shell(self, service: str, script: str) -> bytes:
        """Return the output of a script run in a service's container. Raises DockerError if it does
        not run.
        """
        return docker("exec", self._running(service).id, "sh", "-c", script)

    def _name(self) -> str:
        """The system's name in all keys: that of its agents. DockerError: none of them runs."""
        if self._robot:
            return self._robot
        names = (one.variable("ROCO_SYSTEM") for one in self._living_agents())
        return next(names, "") or self.system.name

    def _running(self, service: str) -> Container:
        """The running container of a service. DockerError: none runs."""
        found = self._find(service)
        if found is None or not found.runs:
            raise DockerError(
                f"service {service} of {self.where} does not run; `roco agent start {service}`"
                " starts it"
            )
        return found


def _options(container: Container) -> list[str]:
    """Options of a container that runs beside this one for a moment: with its variables and
    network, as guarded.
    """
    variables = [f"--env={one}" for one in container.config.env if one.startswith("ROCO_")]
    networks = [f"--network={name}" for name in container.network_settings.get("Networks", ())]
    return [*variables, *networks[:1], *GUARDED]


def _reading(files: tuple[str, ...], offset: int) -> str:
    """A script that writes the first of these files that is there, from byte `offset` on."""
    names = " ".join(f'"{file}"' for file in files)
    return f'for f in {names}; do [ -e "$f" ] && exec tail -c +{offset + 1} "$f"; done; :'


def _of(container: Container, read: Sheet) -> list[Seen]:
    """The processes in a container, as its supervisor says, or its only one."""
    name, told = container.service, container.state
    if read.fleet is not None and container.runs:
        statuses = read.fleet.processes
    else:
        pid, state = 0, CONTAINER.get(told.status, ProcessState.STOPPED)
        if container.runs:
            serves = read.ready(name) or container.healthy
            pid, state = read.pid(name), ProcessState.READY if serves else ProcessState.STARTING
        exited = f"stopped; exit code {told.exit_code}"
        note = {"paused": "paused", "exited": exited}.get(told.status, "")
        statuses = (ProcessStatus(name, state, pid, container.restart_count, note),)
    return [
        Seen(one, *read.beat(one.name), proc.used(one.pid, read.stats) if one.pid else None, name)
        for one in statuses
    ]

"""The supervisor's hands: starts and ends processes as the core says, and tells the core what
happened.

One thread, one loop: look at the children and their ready files, take that in, decide, act, write
fleet.json. Children get sessions of their own, so that Ctrl-C in a terminal reaches the supervisor
alone and the order of the end is kept. A supervisor that is killed leaves them running: the robot
does not drop the jar because of it. `roco down` finds them by their pid files, and so does the next
supervisor of the folder, which ends them before it starts its own.
"""

import importlib.util
import os
import select
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO

import msgspec

from agent_runtime.io import fork_server
from agent_runtime.io.fleet_processes import set_stop
from agent_runtime.io.fork_server import Forked, Handed, fork
from agent_runtime.io.options import AGENTS_VARIABLE, USAGE_ERROR
from agent_runtime.io.reaching import free_port
from agent_runtime.io.run_files import FLEET_VARIABLE, ProcessHeartbeat
from agent_runtime.io.secured import ROUTER
from operate.fault_proxy import clocks, files
from operate.fleet_file import Fleet as FleetFile
from operate.fleet_file import ProcessState
from operate.supervisor import core, folder
from operate.supervisor.folder import Left, end_others, left
from operate.system import RECORDS_S, Process, System
from topdown.model.design import Design

NAME = "supervisor"

# --- Processes forked from one that has imported what they share (agent_runtime.io.fork_server) ---
# It is one more process of the fleet, ready before the others: it is watched, restarted and given
# up like them. Where it is not ready they are started without it, each by an interpreter of its
# own.

PATIENCE_S = 30.0  # estimate: its imports take 2 s, and 12 s on a slow machine at a load of 3
FORKS = Process(
    fork_server.FORKS,
    "agent_runtime.io.fork_server",
    optional=True,
    patience_s=PATIENCE_S,
    hangs_s=RECORDS_S,
)
FORKS_FILE = "forks.sock"


def forking(processes: tuple[Process, ...]) -> tuple[Process, ...]:
    """Return the processes with the fork server before those that it makes.

    The router, which others wait for, starts beside it.
    """
    made = [one for one in processes if one.forked and one.name != ROUTER]
    if len(made) < 2:
        return processes
    modules = (name for one in made for name in (program(one), *one.workers))
    server = msgspec.structs.replace(FORKS, arguments=tuple(dict.fromkeys(modules)))
    behind = (
        msgspec.structs.replace(one, after=(*one.after, FORKS.name)) if one in made else one
        for one in processes
    )
    return (server, *behind)


def program(process: Process) -> str:
    """Return the module that Python runs for a process."""
    return f"{process.module}.__main__"


# --- A fleet with wires, for `roco up --faults` ---------------------------------------------------
# Agents reach the router and each other by them, and have own clocks.


WIRES = Process("wires", "operate.fault_proxy")
CONNECT = "ROCO_CONNECT"


def wired(
    processes: tuple[Process, ...], design: Design, connect: str, agents: dict[str, str], run: Path
) -> tuple[tuple[Process, ...], dict[str, dict[str, str]]]:
    """Return the processes with the wires' own among them, and the variables that agents get apart;
    wires.json is told.

    `connect`: the router's address; `agents`: those of the agents. They start after the wires, and
    end before them.
    """
    link = connect.partition("/")[0]
    places = {name: files.place(address) for name, address in agents.items()}
    own = [one.name for one in processes if one.name in design.agents]
    ends = {name: (ROUTER, *(set(design.peers(name)) & set(places))) for name in own}
    listening = {name: {end: free_port() for end in near} for name, near in ends.items()}
    wires = files.Wires({ROUTER: files.place(connect)} | places, listening)
    files.tell(run, wires)
    first = next((n for n, one in enumerate(processes) if one.name in wires.ports), len(processes))
    before = tuple(one.name for one in processes[:first] if one.name == ROUTER)
    behind = (
        msgspec.structs.replace(one, after=(*one.after, WIRES.name))
        if one.name in wires.ports
        else one
        for one in processes[first:]
    )
    clocked, apart = clocks.made(run, tuple(wires.ports)), {}
    for name, ports in wires.ports.items():
        reached = {end: f"{link}/127.0.0.1:{port}" for end, port in ports.items()}
        seen = agents | {end: at for end, at in reached.items() if end in agents}
        apart[name] = {
            CONNECT: reached[ROUTER],
            AGENTS_VARIABLE: ",".join(f"{end}={at}" for end, at in seen.items()),
            **clocked.get(name, {}),
        }
    return (*processes[:first], msgspec.structs.replace(WIRES, after=before), *behind), apart


# --- The fleet ------------------------------------------------------------------------------------


class Shell:
    """Runs one fleet in one run folder. `command` makes the argument list of a process (tests put
    their own there).

    `tend`: what else is to be looked after at each look. `bound`: the system, for fleet.json.
    `apart`: variables of single processes.
    """

    def __init__(
        self,
        run: Path,
        processes: tuple[Process, ...],
        system: str,
        connect: str,
        environment: Mapping[str, str],
        command: Callable[[Process], list[str]] | None = None,
        tend: Callable[[], None] | None = None,
        bound: System | None = None,
        apart: Mapping[str, Mapping[str, str]] | None = None,
        agents: dict[str, str] | None = None,
    ) -> None:
        self.run = run
        self.system = system
        self.connect = connect
        self.environment = {FLEET_VARIABLE: uuid.uuid4().hex, **environment}
        self.apart, self.agents = apart or {}, agents or {}
        self.command = command or python_module
        self.tend = tend or (lambda: None)
        self.entry, self.project = (bound.entry, bound.project) if bound is not None else ("", "")
        self.fleet = core.begin(processes, time.monotonic())
        self.started = time.time()
        self.children: dict[str, subprocess.Popen[bytes] | Forked | Left] = {}
        self.beats: dict[str, int] = {}
        self.files = folder.Files(run)
        self.held = False
        self.end_asked = threading.Event()
        self.ends: dict[str, int] = {}
        """Child -> a handle that can be read when it has ended."""
        self.periods = 1

    def serve(self) -> None:
        """Run the fleet until SIGTERM or SIGINT, and to the end of the last process."""
        # a handler that sets the event could wait for ever: inbox.py
        caught_signals: list[int] = []
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda caught, _: caught_signals.append(caught))
        pid, ready = folder.pid_file(self.run, NAME), folder.ready_file(self.run, NAME)
        self.files.put(pid, f"{os.getpid()}\n".encode())
        self.files.put(ready, b"")
        pulse = ProcessHeartbeat(self.run, NAME)
        while not self.fleet.ended:
            pulse.beat()
            if caught_signals:
                self.end_asked.set()
            self.step(time.monotonic())
            self._wait()
        for file in (ready, pulse.file, pid):
            self.files.put(file, None)

    def end(self, left: Mapping[str, Left]) -> None:
        """End in order what a supervisor that died left running; each has its time, then it is
        killed.
        """
        self.children |= left
        for name, one in left.items():
            self.fleet = core.take(self.fleet, core.Found(name, one.pid), time.monotonic())
        self.end_asked.set()
        while not self.fleet.ended:
            self.step(time.monotonic())
            time.sleep(core.PERIOD_S)

    def step(self, now: float) -> None:
        """Look, decide, act, tell; hold the robot where a process that was ready cannot be kept
        alive.
        """
        before = self.fleet.status
        self.tend()
        self.files.settle()
        if self.end_asked.is_set():
            self.fleet = core.stop(self.fleet)
        self.fleet = core.switch(self.fleet, self.files.off(), now)
        for event in self._look():
            self.fleet = core.take(self.fleet, event, now)
        self.fleet = core.look(self.fleet, self._beats(), self.periods)
        if self.fleet.failing and not self.held:
            with suppress(OSError):  # tried again at the next look
                set_stop(self.run, held=True)
                self.held = True
        self.fleet, actions = core.decide(self.fleet, now)
        for action in actions:
            outcome = self._act(action)
            if outcome is not None:
                self.fleet = core.take(self.fleet, outcome, now)
        if self.fleet.status != before or actions or not (self.run / "fleet.json").exists():
            told = (self.system, self.connect, os.getpid(), self.started, self.fleet.status)
            self.files.tell(
                FleetFile(*told, entry=self.entry, project=self.project, agents=self.agents)
            )

    def _wait(self) -> None:
        """Wait until the next look: longer while all is well, unless a child ends."""
        self.periods = core.REST_PERIODS if self.fleet.resting else 1
        if select.select(list(self.ends.values()), [], [], self.periods * core.PERIOD_S)[0]:
            self.periods = 1

    def _look(self) -> list[core.Event]:
        """See which children ended, and which became ready."""
        seen: list[core.Event] = []
        for name, child in list(self.children.items()):
            code = child.poll()
            if code is not None:
                del self.children[name]
                if name in self.ends:
                    os.close(self.ends.pop(name))
                self.files.put(folder.pid_file(self.run, name), None)
                seen.append(self._exited(name, code))
            elif (
                self.fleet.known[name].state is ProcessState.STARTING
                and folder.ready_file(self.run, name).exists()
            ):
                seen.append(core.Ready(name))
        return seen

    def _exited(self, name: str, code: int) -> core.Event:
        """The event of an end. One that began on a full disk was not started: it is tried until
        there is room.
        """
        wanted = not self.fleet.stopping and name not in self.fleet.off and code != USAGE_ERROR
        starting = wanted and self.fleet.known[name].state is ProcessState.STARTING
        if starting and (why := self.files.no_room()):
            return core.NotStarted(name, f"ended with code {code}, and {why}")
        return core.Exited(name, code, folder.last_words(folder.log_file(self.run, name)))

    def _beats(self) -> frozenset[str]:
        """Return whose heartbeat changed since the last look."""
        found = {name: folder.beat(self.run, name) for name in self.children}
        changed = frozenset(name for name, at in found.items() if at and at != self.beats.get(name))
        self.beats |= found
        for name in changed:
            folder.keep_small(folder.log_file(self.run, name))
        return changed

    def _act(self, action: core.Action) -> core.Event | None:
        """Do one action; a start gives what came of it."""
        match action:
            case core.Start(name=name):
                return self._start(self.fleet.known[name].process)
            case core.Terminate(name=name) if name in self.children:
                self.children[name].terminate()
            case core.Kill(name=name) if name in self.children:
                self.children[name].kill()
            case _:
                pass
        return None

    def _start(self, process: Process) -> core.Event:
        """Start a process; where that cannot work, say why."""
        self.files.put(folder.ready_file(self.run, process.name), None)
        # of the one before: no beat of this one
        self.beats[process.name] = folder.beat(self.run, process.name)
        environment = {**self.environment, **self.apart.get(process.name, {})}
        try:
            command = self.command(process)
            with self.files.log(process.name) as log:
                child = self._forked(process, environment, log) or subprocess.Popen(
                    command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                    start_new_session=True,
                )  # fmt: skip
        except NotBuiltError as error:
            return core.Refused(process.name, str(error))
        except OSError as error:
            return core.NotStarted(process.name, str(error))
        self.children[process.name] = child
        with suppress(ProcessLookupError):
            self.ends[process.name] = os.pidfd_open(child.pid)
        self.files.put(folder.pid_file(self.run, process.name), f"{child.pid}\n".encode())
        return core.Started(process.name, child.pid)

    def _forked(
        self, process: Process, environment: Mapping[str, str], log: IO[bytes]
    ) -> Forked | None:
        """Return the process made by the fork server; None where there is none that is ready."""
        server = self.fleet.known.get(FORKS.name)
        if server is None or server.state is not ProcessState.READY:
            return None
        if FORKS.name not in process.after:
            return None
        hand = [Handed(log.fileno(), 1), Handed(log.fileno(), 2)]
        return fork(
            process.module, *process.arguments, environment=environment, hand=hand, session=True
        )


def end_left(run: Path, processes: tuple[Process, ...], system: str) -> None:
    """End what a supervisor of this folder that died left running, in order, and say so."""
    found = left(run, processes)
    if found:
        print(f"ending what a supervisor that died left: {', '.join(found)}", flush=True)
        Shell(run, processes, system, "", {}).end(found)
    end_others(run)  # such as its fork server, and workers


class NotBuiltError(Exception):
    """A process of the table has no program yet."""

    def __init__(self, module: str) -> None:
        self.module = module
        super().__init__(
            f"{module} has no program: {module.replace('.', '/')}/__main__.py is missing"
        )


def python_module(process: Process) -> list[str]:
    """The command of a process: this Python, its module. Raises NotBuiltError if the program does
    not exist.
    """
    try:
        found = importlib.util.find_spec(process.module)
        if found is not None and found.submodule_search_locations is not None:
            found = importlib.util.find_spec(program(process))
    except ModuleNotFoundError:
        found = None
    if found is None:
        raise NotBuiltError(process.module)
    return [sys.executable, "-P", "-m", process.module, *process.arguments]

"""A fleet of processes on this machine, kept by a supervisor: seen through its run folder and /proc."""

import os
import resource
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from functools import cached_property
from pathlib import Path

from agent_runtime.io.fleet_processes import set_stop, variables
from agent_runtime.io.run_files import heartbeat_file, opened, write_whole
from operate.cli.errors import FleetError, UsageError
from operate.cli.fleet import process_status, starting
from operate.cli.fleet.identity import OPERATOR
from operate.cli.fleet.process_status import Look, Seen
from operate.cli.runs import folders
from operate.cli.terminal.run_state import of_file
from operate.cli.traffic import verdicts
from operate.run_folder import FAULTS_FILE, LIVE_FILE, OFF_SUFFIX, Fleet, Judged, ProcessState, ProcessStatus
from operate.system import System, of_run
from operate.wires import clocks, files

PROC = Path("/proc")


class Local:
    """The fleet of a run folder. `where`: for people."""

    def __init__(self, run: Path) -> None:
        self.run = run
        self.where = self.name = str(run)

    @cached_property
    def system(self) -> System:
        """The system that runs there. Raises NoSystemError if it cannot be told."""
        return of_run(self.run)

    def look(self) -> Look:
        """The fleet now."""
        told, stats = folders.living(self.run), process_status.stats(_stat_lines())
        found = tuple(self._seen(status, stats) for status in told.processes) if told else ()
        unkept = process_status.unkept(told, self._seen(_supervisor(told), stats)) if told else ""
        return Look(told, found, folders.stop_held(self.run), time.monotonic(), unkept)

    def live(self, offset: int) -> bytes:
        """Return the monitor's live.jsonl from byte `offset` on."""
        return of_file(self.run / LIVE_FILE)(offset)

    def verdicts(self) -> list[Judged]:
        """Return the monitor's verdicts so far, in order of time; without a monitor, those of its recording now."""
        return verdicts.told(self.run)

    def read(self, name: str, file: str) -> bytes:
        """Return the contents of a file in the run folder of a process; b"" if it does not exist."""
        try:
            return (self.run / file).read_bytes()
        except OSError:
            return b""

    def put(self, file: str, data: bytes) -> None:
        """Replace a file in the run folder at once."""
        write_whole(self.run / file, data)

    def hold(self, name: str, held: bool) -> None:
        """Set the stop flag in the run folder of a process, or clear it."""
        set_stop(self.run, held)

    def switch(self, name: str, on: bool) -> None:
        """Have the supervisor start a process, or end it and keep it down. FleetError: there is none to do so."""
        self._supervised(name)
        off = self.run / f"{name}{OFF_SUFFIX}"
        if on:
            off.unlink(missing_ok=True)
        else:
            os.close(opened(off, os.O_WRONLY | os.O_CREAT))

    def signal(self, name: str, number: int) -> None:
        """Send a signal to a process. FleetError: it does not run."""
        with suppress(ProcessLookupError):  # ended since the look
            os.kill(self._pid(name), number)

    def writing(self, name: str, possible: bool) -> None:
        """Let what a process writes to files fail, by its limit of a file's size, or not any more. FleetError: it does
        not run.
        """
        pid = self._pid(name)
        with suppress(ProcessLookupError):
            _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (hard if possible else 0, hard))

    def clock(self, name: str, seconds: float) -> None:
        """Set the wall clock of a process so far forward [s]. FleetError: it has none of its own."""
        if seconds and not clocks.file(self.run, name).exists():
            with_clocks = "`roco up --faults` gives each agent one, where a C compiler (cc) is installed"
            raise FleetError(f"{name} of {self.where} has no clock of its own; {with_clocks}")
        clocks.step(self.run, name, seconds)

    def variable(self, name: str, variable: str) -> str:
        """Return a variable of the environment that a process has, or would be started with; "" where it is not set."""
        told = folders.living(self.run)
        pids = [one.pid for one in told.processes if one.name == name] + [told.supervisor] if told else []
        had = next(filter(None, map(variables, filter(None, pids))), {})
        return had.get(variable, "")

    def wire(self, name: str, kind: str, amount: float | None) -> None:
        """Set a condition of the wires of an agent, or of all to a router, or end it (None). FleetError: none."""
        wires = files.told(self.run)
        if amount is not None and wires is None:
            raise FleetError(f"the agents of {self.where} have no wires; start the fleet with `roco up --faults`")
        if amount is not None and wires is not None and (missing := wires.missing(name)):
            raise FleetError(missing)
        files.put(self.run, name, kind, amount)

    def faults(self) -> bytes:
        """Return what faults.jsonl has; b"" where it is not there."""
        return self.read("", FAULTS_FILE)

    def add_fault(self, line: bytes) -> None:
        """Append a line to faults.jsonl."""
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
        with os.fdopen(opened(self.run / FAULTS_FILE, flags), "ab", buffering=0) as file:
            file.write(line)

    def down(self) -> tuple[str, ...]:
        """End the fleet in order; who was ended. NotWaitedError: Ctrl-C meanwhile."""
        with starting.patient(self.run):
            return starting.down(self.run)

    def log(self, name: str, lines: int) -> tuple[str, ...]:
        """The last lines that a process wrote."""
        try:
            return tuple((self.run / f"{name}.log").read_text(errors="replace").splitlines()[-lines:])
        except OSError:
            return ()

    def operating(self) -> AbstractContextManager[Callable[[str, bytes], None]]:
        """A session of the operator, whom the design lets give orders. ConsoleError: it cannot be had."""
        return self.speaking(OPERATOR, "")

    def speaking(self, identity: str, to: str) -> AbstractContextManager[Callable[[str, bytes], None]]:
        """A session with the keys of an identity, in which an agent hears. ConsoleError: it cannot be had."""
        from operate.cli.fleet import operating  # most verbs need no session

        return operating.session(self.run, identity, to)

    def logging(self) -> tuple[str, ...]:
        """The processes that have a log of JSON lines."""
        return tuple(sorted(file.stem for file in (self.run / "logs").glob("*.jsonl")))

    def logged(self, name: str, offset: int) -> bytes:
        """Return the log of a process from byte `offset` on, as JSON lines."""
        return of_file(self.run / "logs" / f"{name}.jsonl")(offset)

    def _pid(self, name: str) -> int:
        told = folders.living(self.run)
        found = next((one for one in told.processes if one.name == name), None) if told else None
        if found is None or not folders.is_service(found.pid, found.module):
            raise FleetError(f"{name} does not run in {self.where}; `roco agent start {name}` starts it")
        return found.pid

    def _supervised(self, name: str) -> Fleet:
        told = folders.living(self.run)
        names = [status.name for status in told.processes] if told else []
        if told is not None and name not in names:
            raise UsageError(f"no process is called {name!r}; there are {', '.join(names)}")
        if told is None or not told.supervisor:
            raise FleetError(f"no supervisor runs in {self.run}, which could do it: `roco down`, then `roco up`")
        return told

    def _seen(self, status: ProcessStatus, stats: dict[int, process_status.Stat]) -> Seen:
        file = heartbeat_file(self.run, status.name)
        try:
            beat, age = process_status.beat(file.read_bytes()), max(0.0, time.time() - file.stat().st_mtime)
        except OSError:
            beat, age = None, None
        return Seen(status, beat, age, process_status.used(status.pid, stats) if status.pid else None)


def _supervisor(told: Fleet) -> ProcessStatus:
    """The supervisor as one of the processes; it has a heartbeat, too."""
    return ProcessStatus("supervisor", ProcessState.READY, told.supervisor)


def _stat_lines() -> list[str]:
    """Return /proc's stat lines of all processes; one that ends meanwhile is left out."""
    lines = []
    for path in PROC.glob("[0-9]*/stat"):
        try:
            lines.append(path.read_text(errors="replace"))
        except OSError:
            continue
    return lines

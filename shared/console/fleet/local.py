"""A fleet of processes on this machine, kept by a supervisor: seen through its run folder and
operate.proc.
"""

import os
import resource
import time
from contextlib import AbstractContextManager, suppress
from functools import cached_property
from pathlib import Path

from agent_runtime.io.fleet_processes import set_stop, variables
from agent_runtime.io.run_files import heartbeat_file, opened, write_whole
from console.errors import FleetError, UsageError
from console.fleet import process_status, starting
from console.fleet.identity import OPERATOR, session
from console.fleet.process_status import Look, Put, Seen, Target
from console.runs import folders
from console.terminal.run_state import of_file
from operate import proc
from operate.fault_proxy import clocks, files
from operate.file_names import FAULTS_FILE, OFF_SUFFIX
from operate.fleet_file import ProcessState, ProcessStatus
from operate.system import System, of_run
from operate.verdict_lines import Judged


class Local(Target):
    """The fleet of a run folder. `where`: for people."""

    def __init__(self, run: Path) -> None:
        self.run = run
        self.where = self.name = str(run)

    @cached_property
    def system(self) -> System:
        return of_run(self.run)

    def look(self) -> Look:
        told, stats = folders.living(self.run), proc.stats_here()
        found = tuple(self._seen(status, stats) for status in told.processes) if told else ()
        unkept = ""
        if told:  # the supervisor has a heartbeat, too
            supervisor = ProcessStatus("supervisor", ProcessState.READY, told.supervisor)
            unkept = process_status.unkept(told, self._seen(supervisor, stats))
        return Look(told, found, folders.stop_held(self.run), time.monotonic(), unkept)

    def verdicts(self) -> list[Judged]:
        return folders.verdicts_of(self.run)

    def read(self, name: str, file: str, offset: int = 0) -> bytes:
        return self.recorded(file, offset)

    def recorded(self, file: str, offset: int = 0) -> bytes:
        try:
            return of_file(self.run / file)(offset)
        except OSError:
            return b""

    def put(self, file: str, data: bytes) -> None:
        write_whole(self.run / file, data)

    def hold(self, name: str, held: bool) -> None:
        set_stop(self.run, held)

    def switch(self, name: str, on: bool) -> None:
        """Have the supervisor start a process, or end it and keep it down. FleetError: there is
        none to do so.
        """
        told = folders.living(self.run)
        names = [status.name for status in told.processes] if told else []
        if told is not None and name not in names:
            raise UsageError(f"no process is called {name!r}; there are {', '.join(names)}")
        if told is None or not told.supervisor:
            raise FleetError(
                f"no supervisor runs in {self.run}, which could do it: `roco down`, then `roco up`"
            )
        off = self.run / f"{name}{OFF_SUFFIX}"
        if on:
            off.unlink(missing_ok=True)
        else:
            os.close(opened(off, os.O_WRONLY | os.O_CREAT))

    def signal(self, name: str, number: int) -> None:
        with suppress(ProcessLookupError):  # ended since the look
            os.kill(self._pid(name), number)

    def writing(self, name: str, possible: bool) -> None:
        pid = self._pid(name)
        with suppress(ProcessLookupError):
            # a longer file cannot be written (EFBIG)
            _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (hard if possible else 0, hard))

    def clock(self, name: str, seconds: float) -> None:
        if seconds and not clocks.file(self.run, name).exists():
            remedy = "`roco up --faults` gives each agent one, where a C compiler (cc) is installed"
            raise FleetError(f"{name} of {self.where} has no clock of its own; {remedy}")
        clocks.step(self.run, name, seconds)

    def variable(self, name: str, variable: str) -> str:
        told = folders.living(self.run)
        pids = [one.pid for one in told.processes if one.name == name] if told else []
        pids += [told.supervisor] if told else []
        had = next(filter(None, map(variables, filter(None, pids))), {})
        return had.get(variable, "")

    def wire(self, name: str, kind: str, amount: float | None) -> None:
        if amount is not None:
            wires = files.wires_of(self.run)
            none = f"the agents of {self.where} have no wires"
            none += "; start the fleet with `roco up --faults`"
            if missing := none if wires is None else wires.missing(name):
                raise FleetError(missing)
        files.put(self.run, name, kind, amount)

    def add_fault(self, line: bytes) -> None:
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
        with os.fdopen(opened(self.run / FAULTS_FILE, flags), "ab", buffering=0) as file:
            file.write(line)

    def down(self) -> tuple[str, ...]:
        with starting.patient(self.run):
            return starting.down(self.run)

    def log(self, name: str, lines: int) -> tuple[str, ...]:
        return tuple(self.recorded(f"{name}.log").decode(errors="replace").splitlines()[-lines:])

    def operating(self) -> AbstractContextManager[Put]:
        return self.speaking(OPERATOR, "")

    def speaking(self, identity: str, to: str) -> AbstractContextManager[Put]:
        return session(self.run, identity, to)

    def logging(self) -> tuple[str, ...]:
        return tuple(sorted(file.stem for file in (self.run / "logs").glob("*.jsonl")))

    def _pid(self, name: str) -> int:
        told = folders.living(self.run)
        for one in told.processes if told else ():
            if one.name == name and folders.is_service(one.pid, one.module):
                return one.pid
        raise FleetError(
            f"{name} does not run in {self.where}; `roco agent start {name}` starts it"
        )

    def _seen(self, status: ProcessStatus, stats: dict[int, proc.Stat]) -> Seen:
        file, beat, age = heartbeat_file(self.run, status.name), None, None
        with suppress(OSError):
            beat = process_status.beat(file.read_bytes())
            age = max(0.0, time.time() - file.stat().st_mtime)
        return Seen(status, beat, age, proc.used(status.pid, stats) if status.pid else None)

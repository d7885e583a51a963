"""A fleet of processes on this machine, kept by a supervisor: seen through its run folder and /proc."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cached_property
from pathlib import Path

from operate.cli.errors import FleetError, UsageError
from operate.cli.fleet import process_status, starting
from operate.cli.fleet.process_status import Look, Seen
from operate.cli.runs import folders
from operate.cli.terminal.run_state import of_file
from operate.cli.traffic import verdicts
from operate.run_folder import LIVE_FILE, OFF_SUFFIX, Fleet, Judged, ProcessStatus
from operate.system import System, of_run

PROC = Path("/proc")


class Local:
    """The fleet of a run folder. `where`: for people."""

    def __init__(self, run: Path) -> None:
        self.run = run
        self.where = str(run)

    @cached_property
    def system(self) -> System:
        """What runs there. NoSystemError where it cannot be told."""
        return of_run(self.run)

    def look(self) -> Look:
        """The fleet now."""
        told, stats = folders.living(self.run), process_status.stats(_stat_lines())
        found = tuple(self._seen(status, stats) for status in told.processes) if told else ()
        return Look(told, found, folders.stop_held(self.run), time.monotonic())

    def live(self, offset: int) -> bytes:
        """What stands in the monitor's live.jsonl from a byte on."""
        return of_file(self.run / LIVE_FILE)(offset)

    def verdicts(self) -> list[Judged]:
        """What the monitor judged so far, in the order of time; of a run without a monitor its recording, now."""
        return verdicts.told(self.run)

    def read(self, name: str, file: str) -> bytes:
        """What a file in the run folder of a process has; b"" where it is not there."""
        try:
            return (self.run / file).read_bytes()
        except OSError:
            return b""

    def hold(self, name: str, held: bool) -> None:
        """Set the stop flag in the run folder of a process, or clear it."""
        folders.set_stop(self.run, held)

    def switch(self, name: str, on: bool) -> None:
        """Have the supervisor start a process, or end it and keep it down. FleetError: there is none to do so."""
        self._supervised(name)
        off = self.run / f"{name}{OFF_SUFFIX}"
        if on:
            off.unlink(missing_ok=True)
        else:
            off.touch()

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
        from operate.cli.fleet import operating  # most verbs need no session

        return operating.session(self.run)

    def logging(self) -> tuple[str, ...]:
        """The processes that have a log of JSON lines."""
        return tuple(sorted(file.stem for file in (self.run / "logs").glob("*.jsonl")))

    def logged(self, name: str, offset: int) -> bytes:
        """What stands in the log of a process from a byte on, JSON lines."""
        return of_file(self.run / "logs" / f"{name}.jsonl")(offset)

    def _supervised(self, name: str) -> Fleet:
        told = folders.living(self.run)
        names = [status.name for status in told.processes] if told else []
        if told is not None and name not in names:
            raise UsageError(f"no process is called {name!r}; there are {', '.join(names)}")
        if told is None or not told.supervisor:
            raise FleetError(f"no supervisor runs in {self.run}, which could do it: `roco down`, then `roco up`")
        return told

    def _seen(self, status: ProcessStatus, stats: dict[int, process_status.Stat]) -> Seen:
        file = self.run / f"{status.name}.heartbeat.json"
        try:
            beat, age = process_status.beat(file.read_bytes()), max(0.0, time.time() - file.stat().st_mtime)
        except OSError:
            beat, age = None, None
        return Seen(status, beat, age, process_status.used(status.pid, stats) if status.pid else None)


def _stat_lines() -> list[str]:
    """What /proc says of all processes; one that ends meanwhile is left out."""
    lines = []
    for path in PROC.glob("[0-9]*/stat"):
        try:
            lines.append(path.read_text(errors="replace"))
        except OSError:
            continue
    return lines

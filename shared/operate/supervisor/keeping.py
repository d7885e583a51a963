"""Ownership of a run folder: one supervisor at a time, by a lock that ends with it; and the processes a dead one left
running.

Children of a supervisor that is killed go on, as the robot must not drop the jar for it. The next one of the same
folder ends them first, in order: a second router or control loop beside them would be two masters of one robot.
"""

import contextlib
import fcntl
import os
import time
from collections.abc import Iterator
from pathlib import Path

from agent_runtime.io.fleet_processes import started_in, variables
from agent_runtime.io.forked import Other
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE, make_run
from operate import proc
from operate.run_folder import LOCK_FILE
from operate.supervisor import folder
from operate.supervisor.processes import ORDERLY_STOP_S, Process

TAKE_S = 1.0  # estimate: who only looks whether the lock is held has it for some microseconds


class KeptError(Exception):
    """Another supervisor keeps this run folder."""

    def __init__(self, run: Path, pid: str) -> None:
        super().__init__(f"the fleet of {run} runs already (supervisor {pid or 'unknown'}); `roco down` ends it")


@contextlib.contextmanager
def kept(run: Path) -> Iterator[None]:
    """Keep this folder alone as long as the block lasts; it is made where missing. Raise KeptError, OSError."""
    make_run(run)
    with (run / LOCK_FILE).open("a+") as lock:  # not inherited by children: it ends with this process
        _take(run, lock.fileno())
        lock.truncate(0)
        lock.write(f"{os.getpid()}\n")
        lock.flush()
        yield
        lock.truncate(0)


def _take(run: Path, lock: int) -> None:
    until = time.monotonic() + TAKE_S
    while True:
        try:
            return fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > until:
                raise KeptError(run, (run / LOCK_FILE).read_text().strip()) from None
        time.sleep(0.01)


class Left(Other):
    """A process that a dead supervisor left; as much of subprocess.Popen as the shell needs."""

    def poll(self) -> int | None:
        """Return 0 once it has ended; its exit code is its parent's to know."""
        return 0 if self.ended() else None


def left(run: Path, processes: tuple[Process, ...]) -> dict[str, Left]:
    """Return what lives of these processes, by the pid files of a run of which nobody keeps anything."""
    found = {}
    for process in processes:
        try:
            one = Left(int(folder.pid_file(run, process.name).read_text()))
            # A number that somebody else uses again is not of a process that runs this module in this folder.
            if process.module in proc.words(one.pid) and variables(one.pid).get(RUN_FOLDER_VARIABLE) == str(run):
                found[process.name] = one
        except (OSError, ValueError):
            continue
    return found


def end_others(run: Path) -> None:
    """End what else fleets of this folder left: all that was started for one, but this process."""
    others = []
    for pid in started_in(run):
        with contextlib.suppress(ProcessLookupError):  # it has ended since
            others += [Left(pid)] if pid != os.getpid() else []
    for one in others:
        one.terminate()
    until = time.monotonic() + ORDERLY_STOP_S
    for one in others:
        if not one.ended(max(0.0, until - time.monotonic())):
            one.kill()

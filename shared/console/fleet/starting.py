"""Bringing the fleet up and down: starts the supervisor as a process of its own, waits for it, ends
it by signal.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

from agent_runtime.io.fleet_processes import started_in
from agent_runtime.io.fork_server import FORKS
from agent_runtime.io.run_files import FLEET_VARIABLE, RUN_FOLDER_VARIABLE, make_run
from agent_runtime.io.secured import ROUTER
from console.errors import WRONG_USE, FleetError, NotWaitedError, UsageError
from console.runs import folders
from operate import proc
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.system import here

SUPERVISOR = "operate.supervisor"
PERIOD_S = 0.1  # estimate: how often a waiting person's picture is renewed
# estimate: the slowest start seen on a loaded 2-core machine, doubled; to be measured
READY_S = 90.0
CHECK_S = 60.0  # estimate: it takes half a second
LEAST_ROOM = 32 << 20  # bytes for a start; estimate: a fleet that is ready has written 12 MB
STOP_S = 150.0  # the monitor may take two minutes for its reports, the others seconds
# until a process without a supervisor, and not the monitor, is killed (estimate: twice an orderly
# end)
LEFT_S = 10.0
MONITOR = "monitor"
LAST = (MONITOR, "wires", FORKS, ROUTER)
"""Ended after all others, the monitor first: it records their end, and writes its report."""


def check(arguments: list[str]) -> None:
    """Have a supervisor look at its options before it starts anything. UsageError says what is
    wrong with them.

    Only where they name a scene or processes: all others were checked when they were read.
    """
    if not {"--scene", "--only"} & set(arguments):
        return
    command = [sys.executable, "-P", "-m", SUPERVISOR, "--run-dir", ".", *arguments, "--check"]
    shared, quiet = os.environ | here().environment(Path()), subprocess.DEVNULL
    done = subprocess.run(command, env=shared, stdin=quiet, capture_output=True, timeout=CHECK_S)
    if done.returncode == WRONG_USE:
        raise UsageError(done.stderr.decode(errors="replace").strip().removeprefix("supervisor: "))


def start(run: Path, arguments: list[str]) -> subprocess.Popen[bytes]:
    """Start the supervisor of a run of the system here in the background; its words go to
    <run>/supervisor.log.
    """
    _refuse_second(run, 0)
    own = {RUN_FOLDER_VARIABLE: str(run), FLEET_VARIABLE: uuid.uuid4().hex}
    shared = os.environ | here().environment(run) | own
    make_run(run)
    free = shutil.disk_usage(run).free
    if free < LEAST_ROOM:
        least = f"{free / 1e6:.1f} MB free, and a fleet needs {LEAST_ROOM / 1e6:.0f} MB to start"
        remedy = "make room, or name a folder on another disk with --out"
        raise FleetError(f"the disk of {run} has {least}: {remedy}")
    words = [SUPERVISOR, "--run-dir", str(run), *arguments]
    return in_background(words, run / "supervisor.log", shared)


def in_background(
    words: list[str], log: Path, environment: dict[str, str] | None = None
) -> subprocess.Popen[bytes]:
    """Start a module with its words, as a process that hears no signal of this terminal."""
    with log.open("ab") as file:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", *words],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def _refuse_second(run: Path, own: int) -> None:
    """Raise FleetError where a supervisor other than this one keeps the folder."""
    other = folders.keeper(run)
    if other not in (0, own):
        raise FleetError(
            f"the fleet of {run} runs already (supervisor {other}); `roco down` ends it"
        )


def wait_kept(run: Path, supervisor: subprocess.Popen[bytes]) -> None:
    """Wait until the supervisor keeps its folder. Raise FleetError where another does, or it
    ended.
    """
    deadline = time.monotonic() + READY_S
    while folders.keeper(run) != supervisor.pid:
        _refuse_second(run, supervisor.pid)
        _refuse_ended(run, supervisor)
        if time.monotonic() > deadline:
            raise FleetError(f"the supervisor did not begin within {READY_S:.0f} s (logs in {run})")
        time.sleep(PERIOD_S)


def _refuse_ended(run: Path, supervisor: subprocess.Popen[bytes]) -> None:
    """Raise FleetError with its last words where the supervisor has ended."""
    if supervisor.poll() is None:
        return
    lines: list[str] = []
    with contextlib.suppress(OSError):
        lines = (run / "supervisor.log").read_text(errors="replace").strip().splitlines()
    raise FleetError(f"the supervisor ended with code {supervisor.returncode}", tuple(lines[-3:]))


def wait_ready(
    run: Path,
    supervisor: subprocess.Popen[bytes],
    tick: Callable[[Fleet | None], None],
) -> Fleet:
    """Wait until all processes but the optional ones are ready; `tick` sees the fleet at each look.

    FleetError names who cannot be started, or who is not ready in time.
    """
    wait_kept(run, supervisor)
    deadline = time.monotonic() + READY_S
    while True:
        told = folders.fleet(run)
        # not that of an earlier one
        fleet = told if told is not None and told.supervisor == supervisor.pid else None
        tick(fleet)
        _refuse_ended(run, supervisor)
        needed = [status for status in fleet.processes if not status.optional] if fleet else []
        missing = [status for status in needed if status.state is not ProcessState.READY]
        hopeless = [status for status in missing if status.state is ProcessState.GIVEN_UP]
        if hopeless:
            raise FleetError("the fleet cannot come up:", tuple(map(describe, hopeless)))
        if fleet is not None and not missing:
            return fleet
        if time.monotonic() > deadline:
            late = f"not ready after {READY_S:.0f} s (logs in {run}):"
            raise FleetError(late, tuple(map(describe, missing)))
        time.sleep(PERIOD_S)


def down(run: Path) -> tuple[str, ...]:
    """End the fleet of a run in order; the names of what was ended. Works with the supervisor dead,
    too.
    """
    fleet = folders.fleet(run)
    modules = {status.name: status.module for status in fleet.processes} if fleet else {}
    pids = {status.name: status.pid for status in fleet.processes} if fleet else {}
    living = tuple(name for name, pid in pids.items() if folders.is_service(pid, modules[name]))
    if supervisor := folders.keeper(run):
        _ask([supervisor])
        _wait_gone([supervisor], STOP_S)
    _end([pid for name, pid in _named(run, modules).items() if name not in LAST], LEFT_S)
    _end([pid for name, pid in _named(run, modules).items() if name == MONITOR], STOP_S)
    others = [pid for pid in started_in(run) if pid != os.getpid()]
    _end([*_named(run, modules).values(), *others], LEFT_S)
    return living


def bring_down(run: Path, supervisor: subprocess.Popen[bytes]) -> None:
    """End the fleet that this command started, whatever it has told of itself. NotWaitedError:
    Ctrl-C meanwhile.

    That of another supervisor, which was there first, goes on.
    """
    with patient(run):
        end(supervisor)
        if not folders.keeper(run):
            down(run)


@contextlib.contextmanager
def patient(run: Path) -> Iterator[None]:
    """The end of a fleet is waited for. NotWaitedError says what goes on where Ctrl-C ends the
    waiting.
    """
    try:
        yield
    except KeyboardInterrupt as error:
        told = folders.living(run)
        names = tuple(status.name for status in told.processes if status.pid) if told else ()
        raise NotWaitedError(str(folders.near(run)), names) from error


def end(supervisor: subprocess.Popen[bytes]) -> None:
    """End a supervisor that this command started, with all that it keeps."""
    if supervisor.poll() is None:
        supervisor.terminate()
        try:
            supervisor.wait(STOP_S)
        except subprocess.TimeoutExpired:
            supervisor.kill()
            supervisor.wait()


def describe(status: ProcessStatus) -> str:
    """A process in a line."""
    again = f", restarted {status.restarts}x" if status.restarts else ""
    return f"{status.name}: {status.state}{again}{': ' + status.note if status.note else ''}"


def _named(run: Path, modules: dict[str, str]) -> dict[str, int]:
    """The pids of what lives of a run by its pid files: a supervisor, or the process of `modules`
    of that name.
    """
    texts = {path.stem: path.read_text().strip() for path in run.glob("*.pid")}
    pids = {name: int(text) for name, text in texts.items() if text.isdigit()}
    own = {name: (modules[name],) if name in modules else folders.SUPERVISORS for name in pids}
    return {name: pid for name, pid in pids.items() if folders.is_service(pid, *own[name])}


def _end(pids: list[int], patience_s: float) -> None:
    """Ask processes to end, those that are frozen, too; kill what lives after `patience_s`."""
    _ask(pids)
    late = _wait_gone(pids, patience_s)
    _ask(late, signal.SIGKILL)
    _wait_gone(late, LEFT_S)


def _ask(pids: list[int], *numbers: signal.Signals) -> None:
    """Send signals to processes; without any those that end one: what was frozen goes on first."""
    for pid in pids:
        for number in numbers or (signal.SIGTERM, signal.SIGCONT):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)


def _wait_gone(pids: list[int], patience_s: float) -> list[int]:
    """Wait until these processes are gone; those that are not in time."""
    deadline = time.monotonic() + patience_s
    while pids and time.monotonic() < deadline:
        pids = [pid for pid in pids if proc.command_line(pid)]
        time.sleep(0.02 if pids else 0.0)
    return pids

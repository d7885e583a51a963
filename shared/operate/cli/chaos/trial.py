"""One run of chaos: a fresh fleet does the system's job while a fault is done to it; then its whole history is judged.

The fault is a `roco fault` of its own, so it heals itself, is recorded, and is refused where a robot is real.
"""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from agent_runtime.io.fleet_processes import variables
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE
from agent_runtime.io.secured import ROUTER
from operate import proc
from operate.cli.errors import UsageError
from operate.cli.faults.kinds import KINDS, VERBS, Kind
from operate.cli.runs import folders, trials
from operate.fault_lines import latest, read
from operate.run_folder import FAULTS_FILE, Fault, ProcessState
from operate.system import System

if TYPE_CHECKING:
    from operate.judging.invariants import Checked

# --- A cell of chaos: one fault of one process in one phase of the system's job; which one, a seed says. Pure --------


PAUSE_S = 3.0
"""Estimate: longer than the lease of a session, shorter than a hang is suffered."""
MESSAGE, MESSAGES = "a message", (1, 10)
"""A phase of any job: the Nth message to or from an agent; estimate: each job has at least N."""


class Cell(msgspec.Struct, frozen=True):
    """`at`: the moment as --at has it; `for_s`, `amount`: None where the fault is done without."""

    seed: int
    kind: str
    target: str
    phase: str
    at: str
    for_s: float | None = None
    amount: float | None = None

    @property
    def words(self) -> str:
        """The action in words: "pause mule by 3 at mule:fetching"."""
        by = f" by {self.amount:g}" if self.amount is not None else ""
        return f"{self.kind} {self.target}{by} at {self.at if self.phase == MESSAGE else self.phase}"

    @property
    def command(self) -> list[str]:
        """The words of `roco fault`."""
        row = KINDS[self.kind].amount
        amount = [] if self.amount is None or row is None else [*([row.option] if row.option else []), str(self.amount)]
        return [self.kind, self.target, *amount, "--at", self.at, *(["--for", str(self.for_s)] if self.for_s else [])]


def phases(system: System) -> dict[str, str]:
    """Return the phases of a system's job: its own, else the states of its agents but the first ones."""
    agents = system.design.agents
    states = (f"{name}:{one.name}" for name in agents for one in agents[name].state if one.name != agents[name].initial)
    return system.job.phases or {state: state for state in states}


def choose(system: System, seed: int, kinds: tuple[str, ...], targets: tuple[str, ...]) -> Cell:
    """Return the cell of a seed, among these kinds and targets; () all. Raise UsageError: none fits."""
    chance = random.Random(seed)
    for _ in range(1000):
        kind = chance.choice(kinds or VERBS)
        fitting = [name for name in targets_of(system, KINDS[kind]) if not targets or name in targets]
        if fitting:
            return cell(system, seed, kind, chance.choice(fitting), *_moment(system, chance), chance)
    raise UsageError(f"{', '.join(kinds)} can be done to none of {', '.join(targets)}; leave --kind or --on out")


def cell(system: System, seed: int, kind: str, target: str, phase: str, at: str, chance: random.Random) -> Cell:
    """Return a cell whose amount is chosen."""
    row = KINDS[kind]
    amount = None if row.amount is None else round(chance.uniform(*row.amount.tried), 3)
    return Cell(seed, kind, target, phase, at, PAUSE_S if kind == "pause" else row.for_s or None, amount)


def targets_of(system: System, kind: Kind) -> tuple[str, ...]:
    """Return the processes that a kind of faults can be done to."""
    names = tuple(one.name for one in system.processes)
    agents = tuple(name for name in names if name in system.design.agents)
    return (*agents, ROUTER) if kind.wire else agents if kind.agents else names


def check(kinds: tuple[str, ...], targets: tuple[str, ...], system: System) -> None:
    """Raise UsageError for an unknown kind or process, with the known ones."""
    for given, there, what in (
        (kinds, VERBS, "kind of fault"),
        (targets, tuple(one.name for one in system.processes), "process"),
    ):
        if unknown := [name for name in given if name not in there]:
            raise UsageError(f"there is no {what} {unknown[0]!r}; there are {', '.join(there)}")


def _moment(system: System, chance: random.Random) -> tuple[str, str]:
    """Return a phase and its moment: one of the job's; where it names none, a state or, as often, a message."""
    if system.job.phases or chance.random() < 0.5:
        return chance.choice(list(phases(system).items()))
    return MESSAGE, f"{chance.randint(*MESSAGES)}-message"


# --- One run of chaos -------------------------------------------------------------------------------------------------


FAULT_LOG = "fault.log"
GRACE_S = 5.0
"""Until the children of a killed process have seen the end of their pipe; estimate."""
LOOK_S = 0.1
HEAL_S = 100.0
"""Time to wait for a fault that did not begin or has no process to come back to [s]; a process may take 90 s."""


class Result(msgspec.Struct, frozen=True):
    """A run: `success` and `why` of its report; `broken`: invariants that do not hold. `text`: what came of the fault.

    `began`: whether it was done at all; `stuck`: the run was ended from outside; `orphans`: processes left over;
    `bytes`: of the run folder; `load`: of the machine.
    """

    cell: Cell
    began: bool
    text: str
    success: bool
    why: str
    broken: tuple[str, ...]
    stuck: bool
    orphans: tuple[str, ...]
    exit: int
    bytes: int
    wall_s: float
    load: float

    @property
    def held(self) -> bool:
        """Whether all held: the job was done, or ended with a reason."""
        return not (self.broken or self.stuck or self.orphans) and (self.success or bool(self.why))


def done(out: Path, setting: trials.Setting, cell: Cell) -> Result:
    """Return what became of a run; its folder stays for who wants to look. It is down afterwards, whatever happens."""
    run = trials.folder(out, cell.seed)
    with contextlib.ExitStack() as fault:
        inflicting = _Inflicting(run, cell, fault)
        line = trials.run(out, setting, cell.seed, lambda since: inflicting.look())
    left = tuple(orphans(run))
    file = run / FAULTS_FILE
    faults = latest(read(file.read_bytes())) if file.exists() else ()
    checked = _checked(run)
    began = next((one for one in faults if one.began), None)
    return Result(
        cell=cell,
        began=began is not None,
        text=_text(run, faults),
        success=line.failure is None,
        why=line.failure or "",
        broken=checked.broken,
        stuck=line.timed_out,
        orphans=left,
        exit=line.exit,
        bytes=checked.bytes,
        wall_s=line.took_s,
        load=line.load[0],
    )


class _Inflicting:
    """Begins the fault once the fleet is ready; at the end of the stack it is over, and healed."""

    def __init__(self, run: Path, cell: Cell, stack: contextlib.ExitStack) -> None:
        self._run, self._cell, self._stack = run, cell, stack
        self._begun = False

    def look(self) -> None:
        """Begin it now, where the fleet is ready."""
        told = folders.fleet(self._run)
        needed = [one for one in told.processes if not one.optional] if told is not None else []
        if self._begun or not needed or any(one.state is not ProcessState.READY for one in needed):
            return
        self._begun = True
        words = ["fault", *self._cell.command, "--run-dir", str(self._run)]
        with (self._run / FAULT_LOG).open("ab") as log:
            child = subprocess.Popen(
                [sys.executable, "-P", "-m", "operate.cli", *words],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self._stack.callback(_over, child)


def _over(child: "subprocess.Popen[bytes]") -> None:
    """Wait for the end of a fault; one that did not begin is broken off."""
    for number in (signal.SIGINT, signal.SIGKILL):
        if child.poll() is None:
            child.send_signal(number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(HEAL_S)


def _text(run: Path, faults: tuple[Fault, ...]) -> str:
    """Return what came of the fault; where none was asked for, the last words of its command."""
    if faults:
        return faults[-1].text
    file = run / FAULT_LOG
    words = file.read_text(errors="replace").strip().splitlines()[-1:] if file.exists() else []
    return words[0] if words else "the fleet was never ready"


def _checked(run: Path) -> "Checked":
    """Judge the history of a run; where that cannot be done, that is what is broken."""
    from operate.judging.invariants import Checked, checked
    from operate.recording.run import Run

    try:
        return checked(Run(run))
    except Exception as error:  # whatever a run that was disturbed does to its reader
        return Checked((f"its history cannot be judged: {error}",), 0)


def orphans(run: Path) -> Iterator[str]:
    """Yield the commands of the processes of a run that go on some seconds after its end."""
    until = time.monotonic() + GRACE_S
    while (found := list(_living(run))) and time.monotonic() < until:
        time.sleep(LOOK_S)
    yield from found


def _living(run: Path) -> Iterator[str]:
    for pid, words in proc.every_words():
        mine = variables(pid).get(RUN_FOLDER_VARIABLE) == str(run) or any(str(run) in word for word in words)
        if mine and words and pid != os.getpid():
            yield " ".join(words)

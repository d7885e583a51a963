"""`roco chaos`: the system's job again and again, each time with a fault that a seed chooses; what
held, what not.
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
from rich.table import Table
from rich.text import Text

from agent_runtime.io.fleet_processes import variables
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE
from agent_runtime.io.secured import ROUTER
from console import completion, interrupts
from console.errors import FleetError, UsageError, last_line
from console.faults.kinds import KINDS, VERBS, Kind
from console.fleet import starting
from console.fleet.up import Rate, Speed
from console.output import FirstSeed, Form, Format, option, tell_json, tell_problem
from console.runs import experiment, folders
from console.runs.experiment import span
from console.terminal.console import Console, table
from operate import proc
from operate.fault_lines import Fault, latest, read
from operate.file_names import FAULTS_FILE
from operate.fleet_file import ProcessState
from operate.system import System, here

if TYPE_CHECKING:
    from operate.judging.invariants import Checked

# --- A cell of chaos: one fault of one process in one phase of the system's job; which one, a seed
# says. Pure


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
        return (
            f"{self.kind} {self.target}{by} at {self.at if self.phase == MESSAGE else self.phase}"
        )

    @property
    def command(self) -> list[str]:
        """The words of `roco fault`."""
        row = KINDS[self.kind].amount
        words = [self.kind, self.target]
        if self.amount is not None and row is not None:
            words += [*filter(None, [row.option]), str(self.amount)]
        return [*words, "--at", self.at, *(["--for", str(self.for_s)] if self.for_s else [])]


def phases(system: System) -> dict[str, str]:
    """Return the phases of a system's job: its own, else the states of its agents but the first
    ones.
    """
    states = [
        f"{name}:{one.name}"
        for name, agent in system.design.agents.items()
        for one in agent.state
        if one.name != agent.initial
    ]
    return system.job.phases or dict(zip(states, states, strict=True))


def choose(system: System, seed: int, kinds: tuple[str, ...], targets: tuple[str, ...]) -> Cell:
    """Return the cell of a seed, among these kinds and targets; () all. Raise UsageError: none
    fits.
    """
    chance = random.Random(seed)
    for _ in range(1000):
        kind = chance.choice(kinds or VERBS)
        row = KINDS[kind]
        fitting = [name for name in targets_of(system, row) if not targets or name in targets]
        if fitting:
            target = chance.choice(fitting)
            phase, at = _moment(system, chance)
            amount = None if row.amount is None else round(chance.uniform(*row.amount.tried), 3)
            for_s = PAUSE_S if kind == "pause" else row.for_s or None
            return Cell(seed, kind, target, phase, at, for_s, amount)
    raise UsageError(
        f"{', '.join(kinds)} can be done to none of {', '.join(targets)}; leave --kind or --on out"
    )


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
    """Return a phase and its moment: one of the job's; where it names none, a state or, as often, a
    message.
    """
    if system.job.phases or chance.random() < 0.5:
        return chance.choice(list(phases(system).items()))
    return MESSAGE, f"{chance.randint(*MESSAGES)}-message"


# --- One run of chaos -----------------------------------------------------------------------------


FAULT_LOG = "fault.log"
GRACE_S = 5.0
"""Until the children of a killed process have seen the end of their pipe; estimate."""
LOOK_S = 0.1
HEAL_S = 100.0
"""Time to wait for a fault that did not begin or has no process to come back to [s]; a process may
take 90 s.
"""


class Result(msgspec.Struct, frozen=True):
    """A run: `success` and `why` of its report; `broken`: invariants that do not hold. `text`: what
    came of the fault.

    `began`: whether it was done at all; `stuck`: the run was ended from outside; `orphans`:
    processes left over; `bytes`: of the run folder; `load`: of the machine.
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


def done(out: Path, setting: experiment.Setting, cell: Cell) -> Result:
    """Return what became of a run; its folder stays for who wants to look. It is down afterwards,
    whatever happens.
    """
    run = experiment.folder(out, cell.seed)
    begun: list[subprocess.Popen[bytes]] = []

    def look(_: float) -> None:
        """Begin the fault once the fleet is ready."""
        told = folders.fleet(run)
        needed = [one for one in told.processes if not one.optional] if told is not None else []
        if needed and not begun and all(one.state is ProcessState.READY for one in needed):
            words = ["console", "fault", *cell.command, "--run-dir", str(run)]
            begun.append(starting.in_background(words, run / FAULT_LOG))

    try:
        line = experiment.one_run(out, setting, cell.seed, look)
    finally:
        for child in begun:
            _over(child)
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
    words = last_line(file.read_bytes()) if file.exists() else ""
    return words or "the fleet was never ready"


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
        mine = variables(pid).get(RUN_FOLDER_VARIABLE) == str(run) or any(
            str(run) in word for word in words
        )
        if mine and words and pid != os.getpid():
            yield " ".join(words)


# --- Findings of chaos as tables: one per kind of fault, a row per process, a column per phase,
# seeds in the cells


DONE, EXPLAINED, BROKEN, NOTHING = "green", "yellow", "bold red", "dim"
LEGEND = (
    (DONE, "done"),
    (EXPLAINED, "not done, the reason said"),
    (BROKEN, "broken, stuck or left over"),
    (NOTHING, "the fault did not begin"),
)


def colour(one: Result) -> str:
    """Return how a run is shown."""
    if not one.held:
        return BROKEN
    return NOTHING if not one.began else DONE if one.success else EXPLAINED


def legend() -> Text:
    """Return what the colours of seeds mean."""
    return Text("  ").join(
        [Text("seed", style="dim"), *(Text(words, style=style) for style, words in LEGEND)]
    )


def tables(results: Sequence[Result]) -> Iterator[Table]:
    """Yield a table for each kind of fault that was done."""
    for kind in dict.fromkeys(one.cell.kind for one in results):
        own = [one for one in results if one.cell.kind == kind]
        columns = dict.fromkeys(one.cell.phase for one in own)
        heads = (kind, *columns)
        drawn = table(heads, fold=heads)
        for target in dict.fromkeys(one.cell.target for one in own):
            drawn.add_row(Text(target), *(_seeds(own, target, phase) for phase in columns))
        yield drawn


def lines(results: Sequence[Result]) -> Iterator[str]:
    """Yield what was not done and what is broken, a line for each."""
    for one in results:
        for why in (*one.broken, *(f"left over: {orphan}" for orphan in one.orphans)):
            yield f"seed {one.cell.seed}, {one.cell.words}: {why}"
        if one.stuck:
            yield f"seed {one.cell.seed}, {one.cell.words}: stuck, ended after {one.wall_s:.0f} s"
        elif not one.success:
            yield (
                f"seed {one.cell.seed}, {one.cell.words}: not done: {one.why or 'without a reason'}"
            )


def summary(results: Sequence[Result]) -> str:
    """Return the counts of all runs in a line."""
    begun = [one for one in results if one.began]
    done, held = sum(one.success for one in begun), sum(one.held for one in results)
    stuck, left = sum(one.stuck for one in results), sum(len(one.orphans) for one in results)
    return (
        f"{len(results)} runs, {len(begun)} with a fault: {done} of {len(begun)} done, {held} of"
        f" {len(results)} held; {stuck} stuck, {left} processes left over"
    )


def _seeds(results: Sequence[Result], target: str, phase: str) -> Text:
    found = [one for one in results if (one.cell.target, one.cell.phase) == (target, phase)]
    return Text(" ").join(Text(str(one.cell.seed), style=colour(one)) for one in found)


# --- `roco chaos` ---------------------------------------------------------------------------------


RESULTS_FILE = "chaos.jsonl"


def _kinds(incomplete: str) -> list[str]:
    """Return kinds of faults, behind the commas so far."""
    return completion.behind_commas(VERBS, incomplete)


def chaos(
    runs: Annotated[int, option("How many runs.", min=1)] = 10,
    seed: FirstSeed = 1,
    budget: Annotated[
        float, option("No run begins after so many minutes; 0: all do.", min=0.0)
    ] = 0.0,
    kind: Annotated[str, option("Kinds of faults, comma between; else all.", complete=_kinds)] = "",
    on: Annotated[
        str, option("Processes to hit, comma between; else all.", complete=completion.started)
    ] = "",
    speed: Rate = Speed.MAX,
    out: Annotated[
        Path | None, option("Where it is written; else experiments/chaos-<time>.")
    ] = None,
    resume: Annotated[bool, option("Go on with what is in --out.", "--resume")] = False,
    keep: Annotated[
        bool, option("Keep the folders of all runs, not only of those to look at.", "--keep")
    ] = False,
    form: Form = Format.TEXT,
) -> None:
    """Do the system's job again and again, each time with a fault that a seed chooses, and judge
    each whole history.

    The seed of a run repeats it: `roco chaos --runs 1 --seed N`. Exits with 1 where an invariant
    did not hold.

    Examples:
      roco chaos --runs 20
      roco chaos --runs 1 --seed 7
      roco chaos --kind kill,pause --on AGENT --budget 30
    """
    with interrupts.heard():
        if resume and out is None:
            raise UsageError("--resume needs what to go on with; name its folder with --out")
        system = here()
        kinds, targets = _names(kind), _names(on)
        check(kinds, targets, system)
        folders.refuse_beside("chaos needs the machine for itself")
        place = (out or folders.EXPERIMENTS / f"chaos-{datetime.now():%Y-%m-%d_%H-%M-%S}").resolve()
        chosen = [
            choose(system, one, kinds or _possible(), targets) for one in range(seed, seed + runs)
        ]
        asked = experiment.Asked(runs, seed, speed.value, None, system.job.timeout_s, 0.0)
        setting, _ = experiment.begun(
            place,
            experiment.setting_here("chaos", (*system.job.command, "--faults"), asked),
            resume,
        )
        results = _all(place, setting, chosen, budget, form, keep=keep)
        _tell(place, results, form)
        if broken := sum(not one.held for one in results):
            raise FleetError(
                f"{broken} of {len(results)} runs did not hold; their folders are in {place}/runs"
            )


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _possible() -> tuple[str, ...]:
    """Return the kinds that can be done here: without a C compiler no clock can be stepped."""
    from operate.fault_proxy.clocks import COMPILER

    return VERBS if shutil.which(COMPILER) else tuple(kind for kind in VERBS if kind != "clock")


def _all(
    place: Path,
    setting: experiment.Setting,
    chosen: list[Cell],
    budget_min: float,
    form: Format,
    *,
    keep: bool,
) -> list[Result]:
    """Do the runs that are not done yet, a line for each; the results of all, in the order of their
    seeds.
    """
    known = {one.cell: one for one in experiment.read_lines(place / RESULTS_FILE, Result)}
    until = time.monotonic() + 60.0 * budget_min if budget_min else float("inf")
    for number, cell in enumerate(chosen, 1):
        if cell in known:
            continue
        if time.monotonic() > until:
            tell_problem(
                f"{budget_min:g} minutes are over; to go on: the same with --out {place} --resume",
                form,
            )
            break
        result = known[cell] = done(place, setting, cell)
        experiment.append_line(place / RESULTS_FILE, result)
        _line(number, len(chosen), result, form)
        if result.held and not keep:
            shutil.rmtree(experiment.folder(place, cell.seed), ignore_errors=True)
    return [known[cell] for cell in chosen if cell in known]


def _line(number: int, of: int, result: Result, form: Format) -> None:
    if form is Format.JSON:
        tell_json(result)
        return
    said = "done" if result.success else f"not done: {result.why or 'without a reason'}"
    cell, words = result.cell, f"run {number} of {of}, seed {result.cell.seed}: "
    words += cell.words if result.began else f"{cell.words} (no fault: {result.text})"
    words += f": {said}"
    words += f"; BROKEN: {'; '.join(result.broken)}" if result.broken else ""
    words += f"; {len(result.orphans)} processes left over" if result.orphans else ""
    Console().print(f"{words}, {span(result.wall_s)}", style=colour(result), highlight=False)


def _tell(place: Path, results: list[Result], form: Format) -> None:
    if form is Format.JSON:
        return
    console = Console()
    for drawn in tables(results):
        console.print(drawn)
    console.print(legend())
    for line in lines(results):
        console.print(line, highlight=False)
    console.print(f"{summary(results)}; {place / RESULTS_FILE}", highlight=False)

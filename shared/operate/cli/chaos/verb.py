"""`roco chaos`: the system's job again and again, each time with a fault that a seed chooses; what held, what not."""

import contextlib
import os
import shutil
import time
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from operate.cli import completion, interrupts
from operate.cli.chaos import cells, table
from operate.cli.chaos.trial import Result, done
from operate.cli.errors import FleetError, UsageError
from operate.cli.faults.kinds import VERBS
from operate.cli.fleet import running_fleets
from operate.cli.fleet.up import Rate, Speed
from operate.cli.output import Form, Format, problems, tell_json, tell_problem
from operate.cli.runs import trials
from operate.cli.runs.experiment import span
from operate.cli.seeds import FirstSeed
from operate.cli.terminal.console import Console
from operate.system import here

RESULTS_FILE = "chaos.jsonl"


def _kinds(incomplete: str) -> list[str]:
    """Return kinds of faults, behind the commas so far."""
    return completion.behind_commas(VERBS, incomplete)


def chaos(
    runs: Annotated[int, typer.Option(min=1, help="How many runs.")] = 10,
    seed: FirstSeed = 1,
    budget: Annotated[float, typer.Option(min=0.0, help="No run begins after so many minutes; 0: all do.")] = 0.0,
    kind: Annotated[str, typer.Option(help="Kinds of faults, comma between; else all.", autocompletion=_kinds)] = "",
    on: Annotated[
        str, typer.Option(help="Processes to hit, comma between; else all.", autocompletion=completion.started)
    ] = "",
    speed: Rate = Speed.MAX,
    out: Annotated[Path | None, typer.Option(help="Where it is written; else experiments/chaos-<time>.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with what is in --out.")] = False,
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep the folders of all runs, not only of those to look at.")
    ] = False,
    form: Form = Format.TEXT,
) -> None:
    """Do the system's job again and again, each time with a fault that a seed chooses, and judge each whole history.

    The seed of a run repeats it: `roco chaos --runs 1 --seed N`. Exits with 1 where an invariant did not hold.

    Examples:
      roco chaos --runs 20
      roco chaos --runs 1 --seed 7
      roco chaos --kind kill,pause --on AGENT --budget 30
    """
    with problems(form), interrupts.heard():
        if resume and out is None:
            raise UsageError("--resume needs what to go on with; name its folder with --out")
        system = here()
        kinds, targets = _names(kind), _names(on)
        cells.check(kinds, targets, system)
        running_fleets.refuse("chaos needs the machine for itself")
        place = (out or running_fleets.EXPERIMENTS / f"chaos-{datetime.now():%Y-%m-%d_%H-%M-%S}").resolve()
        chosen = [cells.choose(system, one, kinds or _possible(), targets) for one in range(seed, seed + runs)]
        asked = trials.Asked(runs, seed, speed.value, None, system.job.timeout_s, 0.0)
        setting, _ = trials.begun(place, trials.here("chaos", (*system.job.command, "--faults"), asked), resume)
        results = _all(place, setting, chosen, budget, form, keep=keep)
        _tell(place, results, form)
        if broken := sum(not one.held for one in results):
            raise FleetError(f"{broken} of {len(results)} runs did not hold; their folders are in {place}/runs")


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _possible() -> tuple[str, ...]:
    """Return the kinds that can be done here: without a C compiler no clock can be stepped."""
    from operate.wires.clocks import COMPILER

    return tuple(kind for kind in VERBS if kind != "clock" or shutil.which(COMPILER))


def _all(
    place: Path, setting: trials.Setting, chosen: list[cells.Cell], budget_min: float, form: Format, *, keep: bool
) -> list[Result]:
    """Do the runs that are not done yet, a line for each; the results of all, in the order of their seeds."""
    known = {one.cell: one for one in results_in(place)}
    until = time.monotonic() + 60.0 * budget_min if budget_min else float("inf")
    for number, cell in enumerate(chosen, 1):
        if cell in known:
            continue
        if time.monotonic() > until:
            tell_problem(f"{budget_min:g} minutes are over; to go on: the same with --out {place} --resume", form)
            break
        result = known[cell] = done(place, setting, cell)
        _append(place, result)
        _line(number, len(chosen), result, form)
        if result.held and not keep:
            shutil.rmtree(trials.folder(place, cell.seed), ignore_errors=True)
    return [known[cell] for cell in chosen if cell in known]


def results_in(place: Path) -> list[Result]:
    """Return the results of a folder; a line that a kill cut off is left out."""
    found = []
    with contextlib.suppress(FileNotFoundError):
        for raw in (place / RESULTS_FILE).read_bytes().splitlines():
            with contextlib.suppress(msgspec.MsgspecError):
                found.append(msgspec.json.decode(raw, type=Result))
    return found


def _append(place: Path, result: Result) -> None:
    with (place / RESULTS_FILE).open("ab") as file:
        file.write(b"\n" * _torn(place / RESULTS_FILE) + msgspec.json.encode(result) + b"\n")
        file.flush()
        os.fsync(file.fileno())


def _torn(file: Path) -> bool:
    data = file.read_bytes()
    return bool(data) and not data.endswith(b"\n")


def _line(number: int, of: int, result: Result, form: Format) -> None:
    if form is Format.JSON:
        tell_json(result)
        return
    said = "done" if result.success else f"not done: {result.why or 'without a reason'}"
    begun = "" if result.began else f" (no fault: {result.text})"
    broken = f"; BROKEN: {'; '.join(result.broken)}" if result.broken else ""
    lost = f"; {len(result.orphans)} processes left over" if result.orphans else ""
    words = f"run {number} of {of}, seed {result.cell.seed}: {result.cell.words}{begun}: {said}{broken}{lost}"
    Console().print(f"{words}, {span(result.wall_s)}", style=table.colour(result), highlight=False)


def _tell(place: Path, results: list[Result], form: Format) -> None:
    if form is Format.JSON:
        return
    console = Console()
    for drawn in table.tables(results):
        console.print(drawn)
    console.print(table.legend())
    for line in table.lines(results):
        console.print(line, highlight=False)
    console.print(f"{table.summary(results)}; {place / RESULTS_FILE}", highlight=False)

"""`roco chaos`: the system's job again and again, each time with a fault that a seed chooses; what held, what not."""

import contextlib
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.table import Table
from rich.text import Text

from operate.cli import completion, interrupts
from operate.cli.chaos import trial
from operate.cli.chaos.trial import Result, done
from operate.cli.errors import FleetError, UsageError
from operate.cli.faults.kinds import VERBS
from operate.cli.fleet import running_fleets
from operate.cli.fleet.up import Rate, Speed
from operate.cli.output import FirstSeed, Form, Format, problems, tell_json, tell_problem
from operate.cli.runs import trials
from operate.cli.runs.experiment import span
from operate.cli.terminal.console import Console
from operate.cli.terminal.table import table
from operate.system import here

# --- Findings of chaos as tables: one per kind of fault, a row per process, a column per phase, seeds in the cells


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
    return Text("  ").join([Text("seed", style="dim"), *(Text(words, style=style) for style, words in LEGEND)])


def tables(results: Sequence[Result]) -> Iterator[Table]:
    """Yield a table for each kind of fault that was done."""
    for kind in dict.fromkeys(one.cell.kind for one in results):
        own = [one for one in results if one.cell.kind == kind]
        columns = list(dict.fromkeys(one.cell.phase for one in own))
        targets = dict.fromkeys(one.cell.target for one in own)
        rows = ((Text(target), *(_seeds(own, target, phase) for phase in columns)) for target in targets)
        yield table((kind, *columns), rows, fold=(kind, *columns))


def lines(results: Sequence[Result]) -> Iterator[str]:
    """Yield what was not done and what is broken, a line for each."""
    for one in results:
        for why in (*one.broken, *(f"left over: {orphan}" for orphan in one.orphans)):
            yield f"seed {one.cell.seed}, {one.cell.words}: {why}"
        if one.stuck:
            yield f"seed {one.cell.seed}, {one.cell.words}: stuck, ended after {one.wall_s:.0f} s"
        elif not one.success:
            yield f"seed {one.cell.seed}, {one.cell.words}: not done: {one.why or 'without a reason'}"


def summary(results: Sequence[Result]) -> str:
    """Return the counts of all runs in a line."""
    begun = [one for one in results if one.began]
    done, held = sum(one.success for one in begun), sum(one.held for one in results)
    stuck, left = sum(one.stuck for one in results), sum(len(one.orphans) for one in results)
    return (
        f"{len(results)} runs, {len(begun)} with a fault: {done} of {len(begun)} done, {held} of {len(results)} held;"
        f" {stuck} stuck, {left} processes left over"
    )


def _seeds(results: Sequence[Result], target: str, phase: str) -> Text:
    found = [one for one in results if (one.cell.target, one.cell.phase) == (target, phase)]
    return Text(" ").join(Text(str(one.cell.seed), style=colour(one)) for one in found)


# --- `roco chaos` -----------------------------------------------------------------------------------------------------


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
        trial.check(kinds, targets, system)
        running_fleets.refuse("chaos needs the machine for itself")
        place = (out or running_fleets.EXPERIMENTS / f"chaos-{datetime.now():%Y-%m-%d_%H-%M-%S}").resolve()
        chosen = [trial.choose(system, one, kinds or _possible(), targets) for one in range(seed, seed + runs)]
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
    place: Path, setting: trials.Setting, chosen: list[trial.Cell], budget_min: float, form: Format, *, keep: bool
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

"""What a recording gives: `roco report` makes the report of its run again and shows it, `roco
export` makes tables.
"""

import shutil
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer
from rich.console import RenderableType

from console import completion
from console.errors import ConsoleError, UsageError
from console.output import Form, Format, argument, option, problems, tell, tell_json
from console.terminal.console import Console
from console.terminal.table import table
from operate.file_names import TRAFFIC_FILE

if TYPE_CHECKING:
    from operate.experiments.measures import Shown

ABSENT = "-"


def report(
    recording: Annotated[
        Path, argument("A run's folder, or a recording.", complete=completion.runs, exists=True)
    ],
    out: Annotated[
        Path | None,
        option("Where its files go; else a run's own folder, of a recording nowhere.", "--out"),
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Make the report of a run again from its recording, and show it. Exits with 1 where the run
    was no success.

    Of a run's folder report.json, report.html and run.rrd are made anew; of a single recording only
    with --out.

    Examples:
      roco report runs/latest
      roco report traffic.mcap --out again
      roco report runs/latest/traffic.mcap --format json
    """
    with problems(form):
        from operate.experiments import measures
        from operate.recording.run import Run, opened
        from operate.reports.report import everything, of

        run, complaints = opened(recording), list[str]()

        def complain(event: str, **fields: object) -> None:
            if fields.get("level") == "error":
                complaints.append(f"{event}: {str(fields.get('why', '')).strip().splitlines()[-1]}")

        folder = _target(recording, out)
        if folder is not None:
            made = run if folder == recording else Run(folder, run.system)
            if not everything(made, complain):
                raise ConsoleError(complaints[-1])
        told = of(run.history, run.system)
        shown = measures.shown(told, measures.of(run.system))
        tell(told, form, lambda: show(msgspec.to_builtins(told), shown, folder, Console()))
        if getattr(told, "success", None) is False:
            raise typer.Exit(1)


def _target(place: Path, out: Path | None) -> Path | None:
    """Return the folder for the files: a run's own, or one that gets the recording, too; None:
    nowhere.
    """
    if out is None:
        return place if place.is_dir() else None
    source = place / TRAFFIC_FILE if place.is_dir() else place
    copy = out / TRAFFIC_FILE
    if source.is_file() and source.resolve() != copy.resolve():
        if copy.exists():
            raise UsageError(f"{out} holds a recording already; give another --out")
        out.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, copy)
    return out


def show(
    told: dict[str, Any], shown: "tuple[Shown, ...]", folder: Path | None, console: Console
) -> None:
    """Print for people: the verdict, the figures, what happened when, who told whom.

    `shown`: the figures that the system has beyond the traffic.
    """
    console.print(headline(told), highlight=False)
    for part in (figures(told, shown), *([events(told)] if "events" in told else []), matrix(told)):
        console.print()
        console.print(part)
    for hole in told["holes"]:
        console.print(f"not recorded: {hole['text']}", style="yellow", highlight=False)
    for name in told.get("missing", ()):
        console.print(f"no {name}", style="dim", highlight=False)
    if folder is not None:
        files = f"{folder}/report.json, report.html, run.rrd"
        console.print(f"\nwritten: {files}", highlight=False, soft_wrap=True)


def headline(told: dict[str, Any]) -> str:
    """Success, or why not."""
    if told.get("success") is None:
        verdict = "a run without a verdict of its own"
    else:
        verdict = "success" if told["success"] else f"no success: {told['failure']}"
    return f"{verdict}; seed {told['seed']}, speed {told['speed']}" if told["speed"] else verdict


_TRUTH = {None: "", True: "; true", False: "; NOT TRUE"}


def figures(told: dict[str, Any], shown: "tuple[Shown, ...]") -> RenderableType:
    """Return the figures of the whole run, and of each plan."""
    said = told["communicates"]
    rows = [(one.name, _number(one.value, one.unit)) for one in shown]
    size = f"{sum(said['bytes'].values()) / 1000:.1f} kB"
    rows.append(("communicates", f"{said['total']}, {size}, {said['copies']} sent again"))
    for plan in told.get("plans", ()):
        words = f"{plan['outcome'] or 'no answer'} in {_number(plan['wall_s'], 's')}"
        words += f", {plan['queries']} queries; {plan['ended'] or 'not carried out to its end'}"
        rows.append((f"plan {plan['number']}", words))
    for number, task in enumerate(told.get("tasks", ()), start=1):
        came = "done" if task["success"] else task["failure"]
        rows.append((f"task {number}", f"{task['asked']}: {came}"))
        rows += [("", f"{one['words']}{_TRUTH[one['true']]}") for one in task.get("claims", ())]
    return table(("", ""), rows, fold=("",))


def events(told: dict[str, Any]) -> RenderableType:
    """Return the table of events with their times."""
    times = ("wall [s]", "simulated [s]")
    rows = ((one["words"], _number(one["t"]), _number(one["sim_s"])) for one in told["events"])
    return table(("event", *times), rows, right=times, fold=("event", *times), header_style="bold")


def matrix(told: dict[str, Any]) -> RenderableType:
    """Return the matrix of message counts: rows receive, columns send."""
    counts: dict[str, dict[str, int]] = told["communicates"]["matrix"]
    heads = ("to \\ from", *counts, "received")
    drawn = table(heads, right=heads[1:], fold=heads, header_style="bold")
    for receiver in counts:
        row = [counts[sender].get(receiver, 0) for sender in counts]
        drawn.add_row(receiver, *(str(count or "") for count in row), str(sum(row)))
    sent = [sum(row.values()) for row in counts.values()]
    drawn.add_row("sent", *map(str, sent), str(sum(sent)))
    return drawn


def _number(value: float | None, unit: str = "") -> str:
    if value is None:
        return ABSENT
    number = f"{value:.{0 if unit == '%' else 1}f}"
    return f"{number} {unit}" if unit else number


# --- `roco export`: a recording as tables for other tools ----------------------


class To(StrEnum):
    """Formats of the export."""

    PARQUET = "parquet"
    CSV = "csv"


class Written(msgspec.Struct, frozen=True):
    """A table: its file, rows and columns."""

    file: str
    rows: int
    columns: int


def export(
    recording: Annotated[
        Path, argument("A run's folder, or a recording.", complete=completion.runs, exists=True)
    ],
    out: Annotated[Path, option("Folder of the tables; made where missing.", "--out")],
    to: Annotated[To, option("parquet for tools, csv for all else.", "--to")] = To.PARQUET,
    form: Form = Format.TEXT,
) -> None:
    """Write what a recording holds as tables: communicates, events, telemetry.

    Examples:
      roco export runs/latest --to parquet --out tables
      roco export runs/latest/traffic.mcap --to csv --out tables --format json
    """
    with problems(form):
        from operate.experiments import tables
        from operate.recording.run import opened

        run = opened(recording)
        made = tables.of_history(run.history, run.system)
        files = zip(tables.write(made, out, to), made.values(), strict=True)
        written = [Written(str(file), table.num_rows, table.num_columns) for file, table in files]
        if form is Format.JSON:
            tell_json(written)
            return
        for one in written:
            print(f"{one.file}: {one.rows} rows, {one.columns} columns")

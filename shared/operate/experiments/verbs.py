"""`python -m services.monitor again | export | compare | invariants | experiment`: the room's work for `roco`, in JSON.

Exit code 2, with one line on standard error, where there is nothing to work on. What they need is imported when called.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import msgspec
import typer

Place = Annotated[Path, typer.Argument(help="A run's folder, or a recording.")]
Runs = Annotated[Path, typer.Argument(help="An experiment's folder, a run's folder, or a recording.")]
WRONG = 2


def again(
    place: Place, out: Annotated[Path | None, typer.Option(help="Where the files go; else a run's own folder.")] = None
) -> None:
    """Make report.json, report.html and run.rrd again, or without a place for them only print the report."""
    from operate.experiments import measures
    from operate.recording import history
    from operate.reports import make, report
    from operate.system import of_run

    with _telling():
        past = history.of(place, of_run(place))
        target = _target(place, out)
        if target is not None and not make.everything(target, of_run(place), _complain):
            raise typer.Exit(1)
        told = report.of(past, of_run(place))
        shown = measures.shown(told, measures.of(of_run(place)))
    _print({"folder": None if target is None else str(target), "report": told, "shown": shown})


def export(
    place: Place,
    out: Annotated[Path, typer.Option(help="Folder of the tables.")],
    to: Annotated[str, typer.Option(help="parquet or csv")] = "parquet",
) -> None:
    """Write communicates, events and telemetry as tables; print which files and how many rows."""
    from operate.experiments import tables
    from operate.recording import history
    from operate.system import of_run

    with _telling():
        made = tables.of_history(history.of(place, of_run(place)), of_run(place))
        files = tables.write(made, out, to)
    rows = zip(files, made.values(), strict=True)
    _print([{"file": str(file), "rows": table.num_rows, "columns": table.num_columns} for file, table in rows])


def compare(
    a: Runs,
    b: Runs,
    threshold: Annotated[list[str] | None, typer.Option(help="KIND=PERCENT, or PERCENT for all kinds.")] = None,
) -> None:
    """Compare two sets of runs."""
    from operate.experiments import comparing, results

    with _telling():
        limits = comparing.thresholds(threshold or [])
        found = comparing.compared(results.load(a), results.load(b), limits)
    _print(found)


def invariants(place: Annotated[Path, typer.Argument(help="A run's folder.")]) -> None:
    """Print what does not hold of a run, though it must whatever was done to it."""
    from operate.judging import invariants as judging
    from operate.system import of_run

    with _telling():
        found = judging.checked(place, of_run(place))
    _print(found)


def experiment(place: Annotated[Path, typer.Argument(help="An experiment's folder.")]) -> None:
    """Make the report of an experiment: report.json, .html, .md, runs.parquet, communicates.parquet."""
    from operate.experiments import make

    with _telling():
        made = make.everything(place)
    _print(made)


def _target(place: Path, out: Path | None) -> Path | None:
    """Return the folder for the files: a run's own, or one that gets the recording, too; None: nowhere."""
    import shutil

    from operate.run_folder import TRAFFIC_FILE

    if out is None:
        return place if place.is_dir() else None
    source = place / TRAFFIC_FILE if place.is_dir() else place
    copy = out / TRAFFIC_FILE
    if source.is_file() and source.resolve() != copy.resolve():
        if copy.exists():
            raise ValueError(f"{out} holds a recording already; give another --out")
        out.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, copy)
    return out


@contextmanager
def _telling() -> Iterator[None]:
    """Turn the caller's wrong names into a line and exit code 2."""
    from operate.experiments.results import NothingHere

    try:
        yield
    except (NothingHere, ValueError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(WRONG) from error


def _complain(event: str, **fields: object) -> None:
    if fields.get("level") == "error":
        typer.echo(f"{event}: {str(fields.get('why', '')).strip().splitlines()[-1]}", err=True)


def _print(what: object) -> None:
    sys.stdout.buffer.write(msgspec.json.encode(what) + b"\n")

"""`roco export`: a recording as tables for other tools."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from operate.cli import completion
from operate.cli.output import Form, Format, problems, tell_json


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
        Path, typer.Argument(help="A run's folder, or a recording.", autocompletion=completion.runs, exists=True)
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder of the tables; made where missing.")],
    to: Annotated[To, typer.Option("--to", help="parquet for tools, csv for all else.")] = To.PARQUET,
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

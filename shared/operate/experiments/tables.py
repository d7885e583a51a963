"""Tables for other tools, Parquet and CSV: communicates and states of agents, and what a system
adds.

docs/experiments.md says what each column is.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import pyarrow
from pyarrow import csv, parquet

from agent_runtime.io.run_files import replaced
from operate.experiments.measures import of
from operate.experiments.run_figures import SentMessage, sent_messages
from operate.recording.history import History
from operate.reports.report import Busy, busy
from operate.system import System

SEED = "seed"
FORMATS = ("parquet", "csv")
_TYPES = {float: pyarrow.float64(), int: pyarrow.int64(), str: pyarrow.string()}


def of_history(history: History, system: System) -> dict[str, pyarrow.Table]:
    """Return the tables of a run by name; one without rows has its columns all the same."""
    own = of(system).tables
    made = {
        "communicates": of_rows(SentMessage, sent_messages(history, system.words)),
        "states": of_rows(Busy, busy(history)),
    }
    return made if own is None else made | own(history)


def of_rows(kind: type[msgspec.Struct], rows: Iterable[msgspec.Struct]) -> pyarrow.Table:
    """Return Structs of a kind as a table with their fields, all of them plain."""
    schema = pyarrow.schema(
        [(field.name, _TYPES[field.type]) for field in msgspec.structs.fields(kind)]
    )
    return pyarrow.Table.from_pylist([msgspec.structs.asdict(row) for row in rows], schema)


def write(tables: Mapping[str, pyarrow.Table], folder: Path, to: str) -> tuple[Path, ...]:
    """Write each table into a file of its own, Parquet or CSV; the files. ValueError: another
    format.
    """
    if to not in FORMATS:
        raise ValueError(f"{to!r} is not a format; give {' or '.join(FORMATS)}")
    folder.mkdir(parents=True, exist_ok=True)
    files = {name: folder / f"{name}.{to}" for name in tables}
    for name, file in files.items():
        if to == "csv":
            csv.write_csv(tables[name], file)
        else:
            parquet.write_table(tables[name], file, compression="zstd")
    return tuple(files.values())


def write_said(file: Path, by_seed: Mapping[int, Sequence[SentMessage]]) -> None:
    """Write the traffic of several runs into one Parquet file with a column for the seed."""
    rows = [(seed, row) for seed in sorted(by_seed) for row in by_seed[seed]]
    told = of_rows(SentMessage, (row for _, row in rows))
    numbered = told.add_column(0, SEED, pyarrow.array([seed for seed, _ in rows], pyarrow.int64()))
    with replaced(file) as written:
        parquet.write_table(numbered, written, compression="zstd")


def said_in(file: Path) -> dict[int, tuple[SentMessage, ...]]:
    """Return the contents of a file of write_said, by seed."""
    found: dict[int, list[SentMessage]] = {}
    for row in parquet.read_table(file).to_pylist():
        found.setdefault(row.pop(SEED), []).append(msgspec.convert(row, SentMessage))
    return {seed: tuple(rows) for seed, rows in found.items()}


def table(types: Mapping[str, pyarrow.DataType], columns: Mapping[str, list[Any]]) -> pyarrow.Table:
    """Return a table of these columns, in the order of `types`."""
    return pyarrow.table({name: pyarrow.array(columns[name], kind) for name, kind in types.items()})

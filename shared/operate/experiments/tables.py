"""Tables for other tools, Parquet and CSV: communicates, events and the loop's telemetry of runs.

One row for each communicate, event, and sample of telemetry (20 Hz); docs/experiments.md says what each column is.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import pyarrow
from pyarrow import csv, parquet

from companion.tools.report.clock import Clock
from companion.tools.report.events import events
from companion.tools.telemetry import robot
from operate.experiments.exchanges import Said, said
from operate.recording.history import History
from velma.names import BODY

SEED = "seed"
FORMATS = ("parquet", "csv")
_NARROW = {
    float: pyarrow.float64(),
    int: pyarrow.int64(),
    str: pyarrow.string(),
    bool: pyarrow.bool_(),
}


def of_history(history: History) -> dict[str, pyarrow.Table]:
    """The three tables of a run, by name; one without rows has its columns all the same."""
    return {
        "communicates": communicates(said(history)),
        "events": happened(history),
        "telemetry": telemetry(history),
    }


def communicates(rows: Iterable[Said]) -> pyarrow.Table:
    """What was said: the fields of Said."""
    kept = tuple(rows)
    types = {field.name: _NARROW[field.type] for field in msgspec.structs.fields(Said)}
    return _table(types, {name: [getattr(row, name) for row in kept] for name in types})


def happened(history: History) -> pyarrow.Table:
    """The events of a run: t [s after the first communicate], sim_s, name, channels, text."""
    clock, found = Clock(history), events(history)
    types = {"t": float, "sim_s": float, "name": str, "channels": str, "text": str}
    columns: dict[str, list[Any]] = {
        "t": [one.at - history.begin for one in found],
        "sim_s": [clock.sim(one.at) for one in found],
        "name": [one.name for one in found],
        "channels": [" ".join(one.channels) for one in found],
        "text": [one.text for one in found],
    }
    return _table({name: _NARROW[kind] for name, kind in types.items()}, columns)


def telemetry(history: History) -> pyarrow.Table:
    """What the loop told: times, joints [rad], work [J], mode, act, cycles and how late they were [us]."""
    states = robot(history)
    columns: dict[str, list[Any]] = {
        "t": [at - history.begin for at, _ in states],
        "sim_s": [state.sim_time_s for _, state in states],
        "work_J": [state.work_J for _, state in states],
        "mode": [state.mode for _, state in states],
        "act": [state.act for _, state in states],
        "skill": [state.skill for _, state in states],
        "cycles": [state.cycles for _, state in states],
        "missed": [state.missed for _, state in states],
        "skipped": [state.skipped for _, state in states],
        "faults": [state.faults for _, state in states],
        "lateness_p50_us": [state.lateness_us.p50 for _, state in states],
        "lateness_p99_us": [state.lateness_us.p99 for _, state in states],
        "lateness_max_us": [state.lateness_us.max for _, state in states],
        "compute_p50_us": [state.compute_us.p50 for _, state in states],
        "compute_p99_us": [state.compute_us.p99 for _, state in states],
    }
    types = {name: pyarrow.string() if name in ("mode", "act", "skill") else pyarrow.float64() for name in columns}
    types |= dict.fromkeys(("cycles", "missed", "skipped", "faults"), pyarrow.int64())
    for n, joint in enumerate(BODY):
        columns[joint] = [state.body[n] if n < len(state.body) else None for _, state in states]
        types[joint] = pyarrow.float64()
    return _table(types, columns)


def write(tables: Mapping[str, pyarrow.Table], folder: Path, to: str) -> tuple[Path, ...]:
    """Write each table into a file of its own, Parquet or CSV; the files. ValueError: another format."""
    if to not in FORMATS:
        raise ValueError(f"{to!r} is no format; give {' or '.join(FORMATS)}")
    folder.mkdir(parents=True, exist_ok=True)
    files = {name: folder / f"{name}.{to}" for name in tables}
    for name, file in files.items():
        if to == "csv":
            csv.write_csv(tables[name], file)
        else:
            parquet.write_table(tables[name], file, compression="zstd")
    return tuple(files.values())


def write_said(file: Path, by_seed: Mapping[int, Sequence[Said]]) -> None:
    """What was said in several runs, in one Parquet file with a column for the seed."""
    rows = [(seed, row) for seed in sorted(by_seed) for row in by_seed[seed]]
    table = communicates(row for _, row in rows)
    numbered = table.add_column(0, SEED, pyarrow.array([seed for seed, _ in rows], pyarrow.int64()))
    parquet.write_table(numbered, file, compression="zstd")


def said_in(file: Path) -> dict[int, tuple[Said, ...]]:
    """What write_said wrote, by seed."""
    found: dict[int, list[Said]] = {}
    for row in parquet.read_table(file).to_pylist():
        found.setdefault(row.pop(SEED), []).append(msgspec.convert(row, Said))
    return {seed: tuple(rows) for seed, rows in found.items()}


def _table(types: Mapping[str, pyarrow.DataType], columns: Mapping[str, list[Any]]) -> pyarrow.Table:
    return pyarrow.table({name: pyarrow.array(columns[name], kind) for name, kind in types.items()})

"""From the lines and recordings of an experiment to its report: report.json, .html, .md,
runs.parquet.
"""

from pathlib import Path

import msgspec
import pyarrow
from pyarrow import parquet

from agent_runtime.io.run_files import replaced, write_whole
from operate.experiments import page, results, summary, tables
from operate.experiments.measures import Runs
from operate.experiments.results import NothingHere
from operate.experiments.run_figures import RESULTS_FILE, SentMessage, sent_messages
from operate.file_names import TRAFFIC_FILE
from operate.recording.run import Run

REPORT = "report"
RUNS_FILE = "runs.parquet"


class Made(msgspec.Struct, frozen=True):
    """Results of a make, for the caller: `lines` are for people."""

    folder: str
    runs: int
    success: float
    low: float | None
    high: float | None
    lines: list[str]


def everything(place: Path) -> Made:
    """Make the report of an experiment's folder. Raises NothingHere."""
    if not (place / RESULTS_FILE).is_file():
        raise NothingHere(f"{place} holds no experiment; `roco experiment` makes one")
    _keep_said(place)
    runs = results.load(place)
    if not runs.results:
        raise NothingHere(
            f"{place} holds no run that is done; go on with the same `roco experiment … --out"
            f" {place} --resume`"
        )
    told = summary.summed(runs)
    words = msgspec.json.format(msgspec.json.encode(told), indent=1) + b"\n"
    write_whole(place / f"{REPORT}.json", words)
    write_whole(place / f"{REPORT}.md", f"{page.markdown(told, runs.measures)}\n".encode())
    write_whole(place / f"{REPORT}.html", page.rendered(runs, told).encode())
    with replaced(place / RUNS_FILE) as file:
        parquet.write_table(of_runs(runs), file, compression="zstd")
    share, lines = told.success, page.lines(told, runs.measures)
    return Made(str(place), told.runs, share.value, share.low, share.high, lines)


def of_runs(runs: Runs) -> pyarrow.Table:
    """One row a run: seed, success, why not, wall time, load, and every quantity."""
    names = ("seed", "success", "failure", "took_s")
    columns = {name: [getattr(one, name) for one in runs.results] for name in names}
    columns["load"] = [one.load[0] if one.load else None for one in runs.results]
    types = {"seed": pyarrow.int64(), "success": pyarrow.bool_(), "failure": pyarrow.string()}
    for quantity in runs.measures.all_quantities:
        name = f"{quantity.name} [{quantity.unit}]" if quantity.unit else quantity.name
        columns[name] = [
            None if one.figures is None else quantity.read(one.figures) for one in runs.results
        ]
    kinds = {name: types.get(name, pyarrow.float64()) for name in columns}
    return tables.table(kinds, columns)


def _keep_said(place: Path) -> None:
    """Put together what was said in all runs whose recordings are there; of the others what was
    kept stays.
    """
    file = place / results.SAID_FILE
    kept: dict[int, tuple[SentMessage, ...]] = tables.said_in(file) if file.exists() else {}
    for one in results.results(place):
        folder = place / results.RUNS / f"seed-{one.seed}"
        if one.seed is not None and one.seed not in kept and (folder / TRAFFIC_FILE).exists():
            run = Run(folder)
            kept[one.seed] = sent_messages(run.history, run.system.words)
    if kept:
        tables.write_said(file, kept)

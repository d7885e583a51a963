"""The results of runs: an experiment's folder, one run's folder or a recording, read into the same
small Structs.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from operate.experiments import measures, tables
from operate.experiments.measures import Runs
from operate.experiments.run_figures import (
    RESULTS_FILE,
    SETTING_FILE,
    ExperimentSetting,
    Figures,
    Result,
    SentMessage,
    sent_messages,
)
from operate.file_names import REPORT_FILE, TRAFFIC_FILE
from operate.recording.run import opened
from operate.reports import report
from operate.structs import NothingToRead
from operate.system import System, of_run

SAID_FILE = "communicates.parquet"
RUNS = "runs"


class NothingHere(NothingToRead):
    """There is nothing to work on; it says what would be right."""


def load(place: Path) -> Runs:
    """An experiment's folder, a run's folder, a folder of runs' folders or a recording. Raises
    NothingHere.
    """
    if (place / RESULTS_FILE).is_file():
        return _experiment(place)
    inside = sorted(place.glob("*")) if place.is_dir() else []
    runs = [one for one in inside if is_run(one) and not one.is_symlink()]
    singles = [place] if is_run(place) else runs
    if not singles:
        raise NothingHere(
            f"{place} holds no runs; give an experiment's folder ({RESULTS_FILE}), a run's folder"
            f" or a {TRAFFIC_FILE}"
        )
    system = of_run(singles[0])
    return _put_together(place.name, [_single(one) for one in singles], measures.of(system))


def is_run(place: Path) -> bool:
    """Whether a run was recorded here: its folder, or the recording itself."""
    if place.is_file():
        return place.suffix == ".mcap"
    return any((place / name).exists() for name in (TRAFFIC_FILE, REPORT_FILE))


def system_of(place: Path) -> System:
    """Return the system of an experiment: that of one of its runs, where their folders are still
    there.
    """
    return of_run(next(iter(sorted(place.glob(f"{RUNS}/*"))), place))


def results(place: Path, figures: type[Figures] = Figures) -> tuple[Result[Any], ...]:
    """Return the lines of an experiment, each seed once, in the order of seeds; one cut off by a
    kill is left out.

    `figures`: what a report.json is read as.
    """
    found: dict[int | None, Result[Any]] = {}
    line_type: Any = Result[figures]  # type: ignore[valid-type]
    for raw in (place / RESULTS_FILE).read_bytes().splitlines():
        with suppress(msgspec.DecodeError):
            line = msgspec.json.decode(raw, type=line_type)
            found.setdefault(line.seed, line)
    return tuple(found[seed] for seed in sorted(found, key=lambda seed: seed or 0))


def setting(place: Path) -> ExperimentSetting | None:
    """Return an experiment's setting, None if it was not written down."""
    try:
        return msgspec.json.decode((place / SETTING_FILE).read_bytes(), type=ExperimentSetting)
    except (OSError, msgspec.DecodeError):
        return None


def _experiment(place: Path) -> Runs:
    file, own = place / SAID_FILE, measures.of(system_of(place))
    said_there = tables.said_in(file) if file.exists() else {}
    return Runs(place.name, setting(place), results(place, own.figures), said_there, own)


def _single(place: Path) -> tuple[Result[Any], tuple[SentMessage, ...]]:
    """A run; its report.json counts where it is there, else one is made of the recording."""
    run, file = opened(place), place / REPORT_FILE
    past, system = run.history, run.system
    kept = place.is_dir() and file.exists()
    raw = file.read_bytes() if kept else msgspec.json.encode(report.of(past, system))
    try:
        figures = msgspec.json.decode(raw, type=measures.of(system).figures)
    except msgspec.DecodeError as error:
        raise NothingHere(
            f"{file} is not a report ({error}); `roco report {place}` makes it again"
        ) from error
    failure = None if figures.success else figures.failure or "the report does not say why"
    return Result(figures.seed, failure, figures, figures.began), sent_messages(past, system.words)


def _put_together(
    name: str, singles: list[tuple[Result[Any], tuple[SentMessage, ...]]], own: measures.Measures
) -> Runs:
    """Runs whose seeds do not tell them apart are numbered instead."""
    seeds = {result.seed for result, _ in singles}
    seeded = None not in seeds and len(seeds) == len(singles)
    if not seeded:
        singles = [
            (msgspec.structs.replace(result, seed=n), rows)
            for n, (result, rows) in enumerate(singles, 1)
        ]
    told = {one.seed: rows for one, rows in singles if rows and one.seed is not None}
    return Runs(name, None, tuple(one for one, _ in singles), told, own, seeded)

"""What runs came to: an experiment's folder, one run's folder or a recording, each read into the same small Structs.

A file of another version may lack a figure: it is None then, and left out where figures are put together.
Must not know: which statistics are made of it.
"""

import tempfile
from contextlib import suppress
from pathlib import Path

import msgspec

from companion.tools.report import report
from operate.experiments import tables
from operate.experiments.exchanges import Said, said
from operate.recording import history
from operate.run_folder import REPORT_FILE, TRAFFIC_FILE
from operate.system import of_run

SETTING_FILE = "experiment.json"
RESULTS_FILE = "results.jsonl"
SAID_FILE = "communicates.parquet"
RUNS = "runs"


class NothingHere(Exception):
    """There is nothing to work on; it says what would be right."""


class Setting(msgspec.Struct, frozen=True):
    """experiment.json, as `roco experiment` writes it."""

    task: str = ""
    runs: int = 0
    seed: int = 0
    speed: str = ""
    scene: str = ""
    timeout_s: float = 0.0
    most_load: float = 0.0
    began: float = 0.0
    version: str = ""
    commit: str = ""
    machine: str = ""
    cores: int = 0
    python: str = ""


class Plan(msgspec.Struct, frozen=True):
    """How a plan was made (operate.reports.report.Plan)."""

    number: int
    t: float = 0.0
    wall_s: float | None = None
    queries: int | None = None
    communicates: int | None = None
    bytes: int | None = None
    km_s: float | None = None


class Happened(msgspec.Struct, frozen=True):
    """An event, `t` s after the first communicate, `sim_s` on the simulation's clock."""

    name: str
    t: float
    sim_s: float | None = None
    channels: tuple[str, ...] = ()


class Sizes(msgspec.Struct, frozen=True):
    """Sizes of some communicates [bytes]."""

    count: int = 0
    total: int = 0
    least: int = 0
    mean: float = 0.0
    largest: int = 0


class Communicates(msgspec.Struct, frozen=True):
    """Counts (operate.reports.counts.Communicates)."""

    total: int = 0
    copies: int = 0
    small: float | None = None
    matrix: dict[str, dict[str, int]] = {}
    per_channel: dict[str, Sizes] = {}


class Spans(msgspec.Struct, frozen=True):
    """Durations [ms]."""

    count: int = 0
    p50: float = 0.0
    p99: float = 0.0
    max: float = 0.0


class Latency(msgspec.Struct, frozen=True):
    """Of one use of a protocol (operate.reports.counts.Latency)."""

    channel: str
    use: str
    budget_ms: float | None = None
    answer: Spans | None = None


class Figures(msgspec.Struct, frozen=True):
    """What is used of a report.json, which has more."""

    success: bool = False
    failure: str | None = None
    poured_fraction: float | None = None
    sim_time_s: float | None = None
    wall_time_s: float | None = None
    energy_J: float | None = None
    communicates: Communicates = Communicates()
    plans: tuple[Plan, ...] = ()
    events: tuple[Happened, ...] = ()
    latency: tuple[Latency, ...] = ()
    seed: int | None = None
    speed: str | None = None
    began: float = 0.0

    def happened(self, name: str) -> Happened | None:
        """The first event of this name."""
        return next((one for one in self.events if one.name == name), None)

    def plan(self, number: int) -> Plan | None:
        """The plan of this number."""
        return next((one for one in self.plans if one.number == number), None)


class Result(msgspec.Struct, frozen=True):
    """One run: a line of results.jsonl. `figures` None: it left no report; `failure` None: a success."""

    seed: int | None
    failure: str | None
    figures: Figures | None
    began: float = 0.0
    took_s: float | None = None
    timed_out: bool = False
    load: tuple[float, float] | None = None

    @property
    def success(self) -> bool:
        """Whether the run did what it should."""
        return self.failure is None


class Runs(msgspec.Struct, frozen=True):
    """A set of runs; `said`: seed -> what was said in that run, where that was recorded."""

    name: str
    setting: Setting | None
    results: tuple[Result, ...]
    said: dict[int, tuple[Said, ...]]


def load(place: Path) -> Runs:
    """An experiment's folder, a run's folder, a folder of runs' folders or a recording. Raises NothingHere."""
    if (place / RESULTS_FILE).is_file():
        return _experiment(place)
    singles = (
        [place]
        if is_run(place)
        else sorted(one for one in place.glob("*") if is_run(one) and not one.is_symlink())
        if place.is_dir()
        else []
    )
    if not singles:
        raise NothingHere(
            f"{place} holds no runs; give an experiment's folder ({RESULTS_FILE}), a run's folder or a {TRAFFIC_FILE}"
        )
    return _put_together(place.name, [_single(one) for one in singles])


def is_run(place: Path) -> bool:
    """Whether a run was recorded here: its folder, or the recording itself."""
    return (
        place.suffix == ".mcap" if place.is_file() else any((place / n).exists() for n in (TRAFFIC_FILE, REPORT_FILE))
    )


def of_recording(place: Path) -> history.History:
    """The history of a run's folder or of a recording. Raises NothingHere."""
    if place.is_dir() and ((place / TRAFFIC_FILE).exists() or (place / history.STEPS).is_dir()):
        return history.load(place, of_run(place))
    if not place.is_file():
        raise NothingHere(f"{place} holds no recording; give a run's folder or a {TRAFFIC_FILE}")
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, TRAFFIC_FILE).symlink_to(place.resolve())
        return history.load(Path(folder), of_run(place))


def results(place: Path) -> tuple[Result, ...]:
    """The lines of an experiment, each seed once, in the order of seeds; one cut off by a kill is left out."""
    found: dict[int | None, Result] = {}
    for raw in (place / RESULTS_FILE).read_bytes().splitlines():
        with suppress(msgspec.DecodeError):
            line = msgspec.json.decode(raw, type=Result)
            found.setdefault(line.seed, line)
    return tuple(found[seed] for seed in sorted(found, key=lambda seed: seed or 0))


def setting(place: Path) -> Setting | None:
    """What an experiment was, None where nobody wrote it down."""
    try:
        return msgspec.json.decode((place / SETTING_FILE).read_bytes(), type=Setting)
    except (OSError, msgspec.DecodeError):
        return None


def _experiment(place: Path) -> Runs:
    file = place / SAID_FILE
    return Runs(place.name, setting(place), results(place), tables.said_in(file) if file.exists() else {})


def _single(place: Path) -> tuple[Result, tuple[Said, ...]]:
    """A run; its report.json counts where it is there, else one is made of the recording."""
    past = of_recording(place)
    file = place / REPORT_FILE
    raw = file.read_bytes() if place.is_dir() and file.exists() else msgspec.json.encode(report.build(past))
    try:
        figures = msgspec.json.decode(raw, type=Figures)
    except msgspec.DecodeError as error:
        raise NothingHere(f"{file} is no report ({error}); `roco report {place}` makes it again") from error
    failure = None if figures.success else figures.failure or "the report does not say why"
    return Result(figures.seed, failure, figures, figures.began), said(past)


def _put_together(name: str, singles: list[tuple[Result, tuple[Said, ...]]]) -> Runs:
    """Runs whose seeds do not tell them apart are numbered instead."""
    seeds = [result.seed for result, _ in singles]
    if None in seeds or len(set(seeds)) < len(seeds):
        seeds = list(range(1, len(singles) + 1))
    numbered = [msgspec.structs.replace(result, seed=n) for n, (result, _) in zip(seeds, singles, strict=True)]
    told = {n: rows for n, (_, rows) in zip(seeds, singles, strict=True) if rows and n is not None}
    return Runs(name, None, tuple(numbered), told)

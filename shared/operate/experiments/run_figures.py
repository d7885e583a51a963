"""The figures of a run as an experiment reads them: what every system's report.json has. Pure.

A file of another version may lack a figure: it is None then, and left out where figures are put together. A system
whose report has more gives a subclass of Figures (operate.experiments.measures.Measures.figures).
"""

from typing import Generic, TypeVar

import msgspec


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


class Happened(msgspec.Struct, frozen=True):
    """An event, of these things or numbers, `t` s after the first communicate, `sim_s` on the simulation's clock.

    `words`: for people; results before 2026-11-29 have those alone, as `name`.
    """

    name: str
    t: float
    of: tuple[str, ...] = ()
    words: str = ""
    sim_s: float | None = None
    channels: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """Its name with what it is of: `grasped jar_1`."""
        return " ".join((self.name, *self.of))


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
    """Durations [ms] (operate.reports.counts.Spans)."""

    count: int = 0
    p50: float = 0.0
    p99: float | None = None
    max: float = 0.0


class Latency(msgspec.Struct, frozen=True):
    """Of one use of a protocol (operate.reports.counts.Latency)."""

    channel: str
    use: str
    budget_ms: float | None = None
    answer: Spans | None = None


class Figures(msgspec.Struct, frozen=True):
    """The fields used of a report.json, which has more."""

    success: bool = False
    failure: str | None = None
    communicates: Communicates = Communicates()
    events: tuple[Happened, ...] = ()
    latency: tuple[Latency, ...] = ()
    seed: int | None = None
    speed: str | None = None
    began: float = 0.0

    def happened(self, event: str) -> Happened | None:
        """Return the first event of this id."""
        return next((one for one in self.events if one.id == event), None)


F = TypeVar("F", bound=Figures)


class Result(msgspec.Struct, Generic[F], frozen=True):
    """One run: a line of results.jsonl. `figures` None: it left no report; `failure` None: a success."""

    seed: int | None
    failure: str | None
    figures: F | None
    began: float = 0.0
    took_s: float | None = None
    timed_out: bool = False
    load: tuple[float, float] | None = None

    @property
    def success(self) -> bool:
        """Whether the run did what it should."""
        return self.failure is None

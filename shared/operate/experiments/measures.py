"""Measured quantities of a run: those of every system, and those that a system adds. Pure.

All of them are better when smaller, but success, which is a share of runs and stands apart. A
published figure stands beside ours where the system names one.
"""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import msgspec

from operate.experiments.intervals import Interval
from operate.experiments.run_figures import ExperimentSetting, Figures, Result, SentMessage
from operate.quantiles import enough
from operate.recording.history import History
from operate.system import NoSystemError, System
from topdown.model.design import Design

if TYPE_CHECKING:
    import pyarrow

Value = float | int | None


class Quantity(msgspec.Struct, frozen=True):
    """`kind`: latency, energy or traffic, by which a threshold is given; `read`: its value of
    Figures, or of the system's own subclass; `judged`: a regression of it counts.
    """

    name: str
    kind: str
    unit: str
    read: Callable[[Any], Value]
    judged: bool = True
    digits: int = 1


class Row(msgspec.Struct, frozen=True):
    """A quantity over all successful runs; `least`, `largest`: of a single run; `published`: None
    where none is.
    """

    name: str
    unit: str
    mean: Interval
    least: float
    largest: float
    published: float | None
    digits: int


class Published(msgspec.Struct, frozen=True):
    """Figures of somebody else's run, to stand beside ours. `by`: a word for a column's head;
    `source`: where they stand; `figures`: quantity -> value; `times`: event -> s; `events`: event
    -> words; `matrix`: sender -> receiver -> communicates.
    """

    by: str = "published"
    source: str = ""
    figures: dict[str, float] = {}
    times: dict[str, float] = {}
    events: dict[str, str] = {}
    matrix: dict[str, dict[str, int]] = {}


class Drawing(msgspec.Struct, frozen=True):
    """A section of the page. `draw`: of Runs, SVG texts; empty ones are left out."""

    title: str
    note: str
    draw: "Callable[[Runs], Iterable[str]]"


class Measures(msgspec.Struct, frozen=True):
    """Quantities that a system measures beyond the traffic, each part optional.

    `done`: what a successful run did, one word; `agents`: order of the count matrix, () for the
    design's; `figures`: what its report.json is read as; `quantities`: rows beside those of the
    traffic; `rows`: further rows of Runs; `told`: names of the rows that a person at the terminal
    is told; `notes`: section of the page (run, events, counts, sizes) -> a sentence; `drawings`:
    further sections; `tables`: further tables of `roco export`, of a History.
    """

    design: Design
    done: str = "succeeded"
    agents: tuple[str, ...] = ()
    figures: type[Figures] = Figures
    quantities: tuple[Quantity, ...] = ()
    rows: "Callable[[Runs], Iterable[Row]] | None" = None
    told: tuple[str, ...] = ()
    published: Published = Published()
    notes: dict[str, str] = {}
    drawings: tuple[Drawing, ...] = ()
    tables: "Callable[[History], dict[str, pyarrow.Table]] | None" = None

    @property
    def order(self) -> tuple[str, ...]:
        """The agents as the count matrix has them."""
        return self.agents or tuple(self.design.agents)

    @property
    def all_quantities(self) -> tuple[Quantity, ...]:
        """In the order in which they are shown: what a person is told first, then traffic, the
        rest, and answers.
        """
        first = tuple(one for one in self.quantities if one.name in self.told)
        others = tuple(one for one in self.quantities if one.name not in self.told)
        return (*first, *TRAFFIC, *others, *answers(self.design))


class Runs(msgspec.Struct, frozen=True):
    """A set of runs; `said`: seed -> what was said in that run, where that was recorded.

    `seeded`: each has a seed of its own; else they are numbered, and the numbers say nothing.
    """

    name: str
    setting: ExperimentSetting | None
    results: tuple[Result[Any], ...]
    said: dict[int, tuple[SentMessage, ...]]
    measures: Measures
    seeded: bool = True


def of(system: System) -> Measures:
    """Return what a system measures: its addition, or the traffic alone. Raise NoSystemError where
    that is not one.
    """
    added = system.addition("measures")
    if added is None:
        return Measures(system.design)
    if not isinstance(added, Measures):
        raise NoSystemError(
            f"{system.additions.measures} is {type(added).__name__}; it must be a Measures"
        )
    return added


class Shown(msgspec.Struct, frozen=True):
    """A figure of one run, for people."""

    name: str
    unit: str
    value: float | None


def shown(report: msgspec.Struct, own: Measures) -> tuple[Shown, ...]:
    """Return the figures of a report that a person is told, beside those of the traffic."""
    figures = msgspec.json.decode(msgspec.json.encode(report), type=own.figures)
    told = (one for one in own.quantities if one.name in own.told)
    return tuple(Shown(one.name, one.unit, one.read(figures)) for one in told)


def answers(design: Design) -> tuple[Quantity, ...]:
    """Return one quantity per use of a protocol: the time from its opening to its first answer."""
    found = []
    for name in (use.name for use in design.file.protocol):
        for part, words in (("p50", "half within"), ("p99", "99 % within"), ("max", "longest")):
            read, judged = _latency(name, part), part == "p50"
            found.append(Quantity(f"{name}: answer, {words}", "latency", "ms", read, judged))
    return tuple(found)


def channel_size(name: str, part: str) -> Callable[[Figures], Value]:
    """Return a reader of the sizes on a channel [bytes]; `part`: least, mean or largest."""

    def read(figures: Figures) -> Value:
        sizes = figures.communicates.per_channel.get(name)
        return None if sizes is None else getattr(sizes, part)

    return read


def values(quantity: Quantity, results: Iterable[Result[Any]]) -> dict[int, float]:
    """Seed -> value, by seed, of the successful runs that have it: one that broke off would pull
    every mean down.
    """
    found: dict[int, float] = {}
    for result in results:
        if result.success and result.figures is not None and result.seed is not None:
            value = quantity.read(result.figures)
            if value is not None:
                found[result.seed] = float(value)
    return dict(sorted(found.items()))


def _latency(use: str, part: str) -> Callable[[Figures], Value]:
    def read(figures: Figures) -> Value:
        spans = next((one.answer for one in figures.latency if one.use == use), None)
        few = spans is None or (part == "p99" and not enough(spans.count, 0.99))
        return None if few else getattr(spans, part)

    return read


def _bytes(figures: Figures) -> Value:
    sizes = figures.communicates.per_channel.values()
    return sum(one.total for one in sizes) / 1000 if sizes else None


def _small(figures: Figures) -> Value:
    small = figures.communicates.small
    return None if small is None else 100 * small


def _largest(figures: Figures) -> Value:
    return max((one.largest for one in figures.communicates.per_channel.values()), default=None)


SMALL, LARGEST = "share below 0.5 kB", "largest communicate"
TRAFFIC: tuple[Quantity, ...] = (
    Quantity("communicates", "traffic", "", lambda f: f.communicates.total),
    Quantity(
        "communicates sent again", "traffic", "", lambda f: f.communicates.copies, judged=False
    ),
    Quantity("all bytes", "traffic", "kB", _bytes),
    Quantity(SMALL, "traffic", "%", _small, judged=False),
    Quantity(LARGEST, "traffic", "B", _largest, judged=False, digits=0),
)
"""Of every system."""

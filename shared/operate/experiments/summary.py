"""What an experiment came to: every figure with its interval, the paper's Tables 7 and 8 with ours beside. Pure."""

from collections.abc import Callable, Iterable

import msgspec

from companion.tools.report.paper import PAPER, TABLE_8
from operate.experiments import intervals
from operate.experiments.intervals import Interval
from operate.experiments.quantities import QUANTITIES, peak_kbit_s, values
from operate.experiments.results import Figures, Result, Runs, Setting

PEAK_STEP_S = 1.0
"""Of the paper's peak the step is not said; a second is what its drawing could show (estimate)."""
SENT, RECEIVED = "sent", "received"
"""The margins of Table 8: a last row, and a last column."""
METHOD = (
    "95 % intervals over runs. Shares of runs: Wilson's score interval; means: Student's t over runs, each run "
    "counting once. Means are of the successful runs."
)


class Row(msgspec.Struct, frozen=True):
    """A quantity over all successful runs; `least`, `largest`: of a single run; `paper`: None where it does not say."""

    name: str
    unit: str
    mean: Interval
    least: float
    largest: float
    paper: float | None
    digits: int


class Event(msgspec.Struct, frozen=True):
    """A row of Table 7: wall and simulated time after the first communicate [s]; `runs`: in how many it happened."""

    name: str
    channels: tuple[str, ...]
    t: Interval | None
    sim_s: Interval | None
    runs: int
    paper: float | None


class Cell(msgspec.Struct, frozen=True):
    """A cell of Table 8: communicates of a sender to a receiver in a run."""

    mean: Interval
    paper: int


class Failure(msgspec.Struct, frozen=True):
    """A run that did not do what it should."""

    seed: int | None
    why: str


class Summary(msgspec.Struct, frozen=True):
    """report.json of an experiment. `table_8`: sender -> receiver -> cell, with margins; `load`: least and largest."""

    name: str
    method: str
    setting: Setting | None
    runs: int
    success: Interval
    failures: tuple[Failure, ...]
    rows: tuple[Row, ...]
    table_7: tuple[Event, ...]
    table_8: dict[str, dict[str, Cell]]
    load: tuple[float, float] | None
    took_s: float | None


def summed(runs: Runs) -> Summary:
    """The summary of a set of runs. ValueError without any."""
    results = runs.results
    success = intervals.share(sum(one.success for one in results), len(results))
    if success is None:
        raise ValueError(f"{runs.name} holds no run that is done")
    loads = [load for one in results if one.load for load in one.load]
    took = [one.took_s for one in results if one.took_s is not None]
    return Summary(
        name=runs.name,
        method=METHOD,
        setting=runs.setting,
        runs=len(results),
        success=success,
        failures=tuple(Failure(one.seed, one.failure) for one in results if one.failure is not None),
        rows=(*_rows(results), *_peaks(runs)),
        table_7=tuple(_table_7(results)),
        table_8=_table_8(results),
        load=(min(loads), max(loads)) if loads else None,
        took_s=sum(took) if took else None,
    )


def good(results: Iterable[Result]) -> list[Figures]:
    """The figures of the successful runs."""
    return [one.figures for one in results if one.success and one.figures is not None]


def _rows(results: tuple[Result, ...]) -> Iterable[Row]:
    for one in QUANTITIES:
        row = _row(one.name, one.unit, list(values(one, results).values()), one.paper, one.digits)
        if row is not None:
            yield row


def _peaks(runs: Runs) -> Iterable[Row]:
    """Peak bandwidth of C4 while plans are made."""
    for number in (1, 2):
        peaks = []
        for one in runs.results:
            plan = one.figures.plan(number) if one.success and one.figures else None
            said = runs.said.get(one.seed or 0, ())
            peak = peak_kbit_s(said, plan, PEAK_STEP_S) if plan and said else None
            peaks += [] if peak is None else [peak]
        theirs = PAPER.made(number)
        name = f"plan {number}: peak bandwidth of C4, in steps of {PEAK_STEP_S:g} s"
        row = _row(name, "kbit/s", peaks, theirs.peak_kbit_s if theirs else None, 1)
        if row is not None:
            yield row


def _row(name: str, unit: str, some: list[float], paper: float | None, digits: int) -> Row | None:
    mean = intervals.mean(some)
    return None if mean is None else Row(name, unit, mean, min(some), max(some), paper, digits)


def _table_7(results: tuple[Result, ...]) -> Iterable[Event]:
    """Events in the order of their mean time; those of the paper that never came stay, last and empty."""
    figures, rows = good(results), []
    names = dict.fromkeys(event.name for one in figures for event in one.events)
    for name in names:
        found = [event for one in figures if (event := one.happened(name)) is not None]
        sim = [event.sim_s for event in found if event.sim_s is not None]
        t = intervals.mean([event.t for event in found])
        rows.append(Event(name, found[0].channels, t, intervals.mean(sim), len(found), PAPER.times.get(name)))
    rows.sort(key=lambda row: row.t.value if row.t else 0.0)
    missing = (Event(name, (), None, None, 0, at) for name, at in PAPER.times.items() if name not in names)
    return (*rows, *missing)


def _table_8(results: tuple[Result, ...]) -> dict[str, dict[str, Cell]]:
    """Of every pair of agents; the margins are those of the sums of each run."""
    figures, agents = good(results), TABLE_8

    def cell(read: Callable[[Figures], float], paper: int) -> Cell:
        mean = intervals.mean([read(one) for one in figures])
        return Cell(mean or Interval(0.0, None, None, 0), paper)

    def theirs(sender: str, receiver: str) -> int:
        return PAPER.matrix.get(sender, {}).get(receiver, 0)

    def sent(one: Figures, sender: str) -> float:
        return sum(one.communicates.matrix.get(sender, {}).values())

    def received(one: Figures, receiver: str) -> float:
        return sum(row.get(receiver, 0) for row in one.communicates.matrix.values())

    table = {
        s: {
            r: cell(lambda one, s=s, r=r: one.communicates.matrix.get(s, {}).get(r, 0), theirs(s, r))  # type: ignore[misc]
            for r in agents
        }
        for s in agents
    }
    for s in agents:
        table[s][SENT] = cell(lambda one, s=s: sent(one, s), sum(theirs(s, r) for r in agents))  # type: ignore[misc]
    table[RECEIVED] = {
        r: cell(lambda one, r=r: received(one, r), sum(theirs(s, r) for s in agents))  # type: ignore[misc]
        for r in agents
    }
    return table

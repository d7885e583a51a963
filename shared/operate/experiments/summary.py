"""The summary of an experiment: every figure with its interval, published ones beside. Pure."""

from collections.abc import Collection, Iterable, Mapping
from math import fsum
from typing import Any

import msgspec

from operate.experiments import intervals
from operate.experiments.intervals import Interval
from operate.experiments.measures import Measures, Published, Row, Runs, values
from operate.experiments.run_figures import ExperimentSetting, Figures, Result

SENT, RECEIVED = "sent", "received"
"""The margins of the count matrix: a last row, and a last column."""
METHOD = (
    "95 % intervals over runs. Shares of runs: Wilson's score interval; means: Student's t over"
    " runs, each run counting once. Means are of the successful runs."
)


class Event(msgspec.Struct, frozen=True):
    """An event over all runs: wall and simulated time after the first communicate [s]; `runs`:
    those that had it.
    """

    name: str
    channels: tuple[str, ...]
    t: Interval | None
    sim_s: Interval | None
    runs: int
    published: float | None


class Cell(msgspec.Struct, frozen=True):
    """A cell of the count matrix: communicates of a sender to a receiver in a run."""

    mean: Interval
    published: int


class Failure(msgspec.Struct, frozen=True):
    """A run that did not do what it should."""

    seed: int | None
    why: str


class Summary(msgspec.Struct, frozen=True):
    """report.json of an experiment. `matrix`: sender -> receiver -> cell, with margins; `load`:
    least and largest.
    """

    name: str
    method: str
    setting: ExperimentSetting | None
    runs: int
    success: Interval
    failures: tuple[Failure, ...]
    rows: tuple[Row, ...]
    events: tuple[Event, ...]
    matrix: dict[str, dict[str, Cell]]
    load: tuple[float, float] | None
    took_s: float | None


def summed(runs: Runs) -> Summary:
    """Return the summary of a set of runs. Raise ValueError without any."""
    results, own = runs.results, runs.measures
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
        failures=tuple(
            Failure(one.seed, one.failure) for one in results if one.failure is not None
        ),
        rows=(*_rows(results, own), *(own.rows(runs) if own.rows else ())),
        events=tuple(_events(results, own.published)),
        matrix=_matrix(results, own),
        load=(min(loads), max(loads)) if loads else None,
        took_s=fsum(took) if took else None,
    )


def good(results: Iterable[Result[Any]]) -> list[Figures]:
    """The figures of the successful runs."""
    return [one.figures for one in results if one.success and one.figures is not None]


def row_of(
    name: str, unit: str, some: list[float], published: float | None, digits: int
) -> Row | None:
    """Return the row of some values, one of each run; None without any."""
    mean = intervals.mean(some)
    return None if mean is None else Row(name, unit, mean, min(some), max(some), published, digits)


def _rows(results: tuple[Result[Any], ...], own: Measures) -> Iterable[Row]:
    for one in own.all_quantities:
        some = list(values(one, results).values())
        row = row_of(one.name, one.unit, some, own.published.figures.get(one.name), one.digits)
        if row is not None:
            yield row


def _events(results: tuple[Result[Any], ...], published: Published) -> Iterable[Event]:
    """Events in the order of their mean time; published ones that never came stay, last and
    empty.
    """
    figures, rows = good(results), []
    ids = dict.fromkeys(event.id for one in figures for event in one.events)
    for id in ids:
        found = [event for one in figures if (event := one.happened(id)) is not None]
        sim = [event.sim_s for event in found if event.sim_s is not None]
        t = intervals.mean([event.t for event in found])
        name = found[0].words or id
        sim_s, theirs = intervals.mean(sim), published.times.get(id)
        rows.append(Event(name, found[0].channels, t, sim_s, len(found), theirs))
    rows.sort(key=lambda row: row.t.value if row.t else 0.0)
    lacking = (
        (published.events.get(id, id), at) for id, at in published.times.items() if id not in ids
    )
    missing = (Event(name, (), None, None, 0, at) for name, at in lacking)
    return (*rows, *missing)


def _matrix(results: tuple[Result[Any], ...], own: Measures) -> dict[str, dict[str, Cell]]:
    """Of every pair of agents; the margins are those of the sums of each run."""
    runs, agents = [one.communicates.matrix for one in good(results)], own.order
    told = (name for run in runs for sender in run for name in (sender, *run[sender]))
    everybody = {*agents, *told}

    def cell(senders: Collection[str], receivers: Collection[str]) -> Cell:
        def said(matrix: Mapping[str, Mapping[str, int]]) -> int:
            return sum(matrix.get(s, {}).get(r, 0) for s in senders for r in receivers)

        mean = intervals.mean([said(one) for one in runs]) or Interval(0.0, None, None, 0)
        return Cell(mean, said(own.published.matrix))

    table = {s: {r: cell({s}, {r}) for r in agents} | {SENT: cell({s}, everybody)} for s in agents}
    return table | {RECEIVED: {r: cell(everybody, {r}) for r in agents}}

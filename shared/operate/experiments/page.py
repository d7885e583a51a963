"""The report of an experiment: report.html for people, one file that needs nothing else, report.md,
report.json and runs.parquet.
"""

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow
from matplotlib.axes import Axes
from pyarrow import parquet

from agent_runtime.io.run_files import replaced, write_whole
from operate.experiments import intervals, results, summary, tables
from operate.experiments.intervals import Interval
from operate.experiments.measures import LARGEST, SMALL, Measures, Published, Row, Runs
from operate.experiments.results import NothingHere
from operate.experiments.run_figures import RESULTS_FILE, SentMessage, sent_messages
from operate.experiments.summary import RECEIVED, SENT, Summary
from operate.file_names import TRAFFIC_FILE
from operate.recording.run import Run
from operate.reports.counts import SMALL_BYTES
from operate.reports.figures import ACCENT, INK, above, drawing, in_bytes, sizes_over_time
from operate.reports.page import ABSENT, STYLE, number, template

# --- Sizes of communicates over many runs, as SVG to stand inside a page: means with 95 % intervals
# over runs


BINS = 40
"""Steps of time in a figure; estimate: fine enough for a shape, wide enough for some communicates
of every run.
"""
SHADE = 0.22
THEIRS = "#d97706"
"""Colour of published figures."""
POINT_DPI = 110
"""Points of all runs are one picture inside the figure: thousands of shapes would be megabytes
(estimate).
"""


def sizes(runs: Runs) -> str:
    """Size of each communicate over time, all runs; the mean in steps of time. "" where nothing was
    said.
    """
    told, design = _traffic(runs), runs.measures.design
    if not told:
        return ""
    text = "Size of each communicate over time, all runs, by channel"
    with drawing("all-sizes", 3.9, text) as (axes, svg):
        dots = [(one.channel, one.t, one.size) for said in told for one in said]
        sizes_over_time(axes, dots, design, alpha=0.3)
        axes.figure.set_dpi(POINT_DPI)
        _mean_size(axes, told)
        above(axes, 7)
    return svg[0]


def shares(runs: Runs) -> str:
    """Share of the communicates of a run below each size, beside what was published."""
    told = _traffic(runs)
    if not told:
        return ""
    edges = np.logspace(1.8, 6, 120)
    sizes = [np.array([[one.size] for one in said]) for said in told]
    below = np.array([(some < edges).mean(axis=0) for some in sizes])
    middle, half = intervals.band(100 * below)
    with drawing("all-shares", 2.6, "Share of communicates below each size") as (axes, svg):
        shaded: dict[str, Any] = {"color": ACCENT, "alpha": SHADE, "linewidth": 0}
        axes.fill_between(edges, middle - half, middle + half, **shaded)
        axes.plot(edges, middle, color=ACCENT, linewidth=1.6)
        _published(axes, runs.measures.published)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(in_bytes)
        axes.set_xlabel("size")
        axes.set_ylabel("smaller [%]")
        axes.set_ylim(0, 102)
    return svg[0]


def _published(axes: Axes, published: Published) -> None:
    """Mark somebody else's share below 500 bytes and largest communicate."""
    small, largest = published.figures.get(SMALL), published.figures.get(LARGEST)
    if small is not None:
        axes.plot((SMALL_BYTES,), (small,), "D", color=THEIRS, markersize=6, zorder=5)
        note = {"xytext": (8, -12), "textcoords": "offset points", "color": THEIRS, "fontsize": 8}
        axes.annotate(f"{published.by}: {small:.0f} % below 0.5 kB", (SMALL_BYTES, small), **note)  # type: ignore[arg-type]
    if largest is not None:
        axes.axvline(largest, color=THEIRS, linewidth=1, linestyle=(0, (4, 3)))
        axes.text(largest, 8, f"{published.by}: largest ", ha="right", color=THEIRS, fontsize=8)


def _traffic(runs: Runs) -> list[tuple[SentMessage, ...]]:
    """Return the traffic of the successful runs."""
    return [runs.said[one.seed] for one in runs.results if one.success and one.seed in runs.said]


def _mean_size(axes: Axes, told: Sequence[tuple[SentMessage, ...]]) -> None:
    """The mean size in steps of time: each run's own mean, then over the runs that said something
    then.
    """
    until = max(one.t for said in told for one in said)
    edges = np.linspace(0.0, until, BINS + 1)
    for start, end in pairwise(edges):
        inside = [[one.size for one in said if start <= one.t < end] for said in told]
        found = intervals.mean([float(np.mean(some)) for some in inside if some])
        if found is None or found.low is None or found.high is None:
            continue
        low, high = max(found.low, 50.0), found.high
        shaded: dict[str, Any] = {"color": INK, "alpha": SHADE, "linewidth": 0, "zorder": 3}
        axes.fill_between((start, end), (low, low), (high, high), **shaded)
        axes.plot((start, end), (found.value, found.value), color=INK, linewidth=1.3, zorder=4)
    axes.plot([], [], color=INK, linewidth=1.3, label="mean")


# --- The report of an experiment for people -------------------------------------------------------


TEMPLATE = Path(__file__).with_name("page.html.j2")


def rendered(runs: Runs, told: Summary) -> str:
    """The page of an experiment."""
    filters = (value, span, percent, percent_span, count, half)
    return template(TEMPLATE, **{one.__name__: one for one in filters}).render(
        told=told,
        results=runs.results,
        began=began(told),
        own=runs.measures,
        style=STYLE,
        sizes=sizes(runs),
        shares=shares(runs),
        drawings=[(one, [svg for svg in one.draw(runs) if svg]) for one in runs.measures.drawings],
    )


def markdown(told: Summary, own: Measures) -> str:
    """The same without figures, for reading where it lies."""
    return "\n".join(
        (*_head(told, own), *_rows(told, own), *_events(told, own), *_matrix(told, own))
    )


def lines(told: Summary, own: Measures) -> list[str]:
    """Return what a person at the terminal reads: success, and some figures of a run."""
    fine = told.runs - len(told.failures)
    words = [
        f"{fine} of {told.runs} runs {own.done}: {percent(told.success)}, 95 % interval"
        f" {percent_span(told.success)}"
    ]
    words += [f"  seed {one.seed}: {one.why}" for one in told.failures]
    wanted = (*own.told, "communicates", "all bytes")
    words += [
        f"{row.name}: {_in_words(row, own.published.by)}" for row in told.rows if row.name in wanted
    ]
    return words


def began(told: Summary) -> str:
    """The day and the hour at which it was begun."""
    at = told.setting.began if told.setting else 0.0
    return datetime.fromtimestamp(at).strftime("%Y-%m-%d %H:%M") if at else ABSENT


def value(interval: Interval | None, digits: int) -> str:
    """The mean; a dash where there is none."""
    return ABSENT if interval is None else number(interval.value, digits)


def span(interval: Interval | None, digits: int) -> str:
    """From where to where; a dash where that cannot be said."""
    if interval is None or interval.low is None or interval.high is None:
        return ABSENT
    return f"{number(interval.low, digits)} … {number(interval.high, digits)}"


def percent(interval: Interval) -> str:
    """A share in per cent."""
    return f"{100 * interval.value:.0f} %"


def percent_span(interval: Interval) -> str:
    """Return the interval of a share, in per cent."""
    if interval.low is None or interval.high is None:
        return ABSENT
    return f"{100 * interval.low:.0f} … {100 * interval.high:.0f} %"


def count(interval: Interval) -> str:
    """A mean count: whole where it is whole; nothing for none at all."""
    if interval.value == 0:
        return ""
    return number(interval.value, 0 if interval.value == round(interval.value) else 1)


def half(interval: Interval) -> str:
    """Half the width of an interval; "" where all runs were alike, or there is none."""
    wide = 0.0 if interval.high is None else interval.high - interval.value
    return number(wide, 1 if wide < 10 else 0) if wide >= 0.05 else ""


def _in_words(row: Row, by: str) -> str:
    unit = f" {row.unit}" if row.unit else ""
    theirs = f" ({by}: {number(row.published)}{unit})" if row.published is not None else ""
    reach = f"95 % interval {span(row.mean, row.digits)}"
    if row.mean.low is None:
        few = (
            f"{number(row.least, row.digits)} … {number(row.largest, row.digits)} in {row.mean.n}"
            " runs"
        )
        reach = few if row.mean.n > 1 else "one run"
    return f"{number(row.mean.value, row.digits)}{unit}, {reach}{theirs}"


def _head(told: Summary, own: Measures) -> Iterator[str]:
    setting = told.setting
    yield f"# {told.runs - len(told.failures)} of {told.runs} runs {own.done}"
    yield ""
    yield (
        f"{percent(told.success)} of runs, 95 % interval {percent_span(told.success)}."
        f" {told.method}"
    )
    yield ""
    if setting is not None:
        yield (
            f"- Begun {began(told)}; seeds {setting.seed} to {setting.seed + setting.runs - 1},"
            f" speed {setting.speed}"
        )
        yield (
            f"- {setting.machine}, {setting.cores} cores, Python {setting.python}; sources"
            f" {setting.commit or ABSENT}"
        )
    if told.load is not None:
        yield f"- Load of the machine: {told.load[0]:.1f} to {told.load[1]:.1f}"
    for one in told.failures:
        yield f"- Seed {one.seed} failed: {one.why}"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """A table of Markdown."""
    names = (*head,)
    yield f"| {' | '.join(names)} |"
    yield "|---" * len(names) + "|"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _rows(told: Summary, own: Measures) -> Iterator[str]:
    head = ("figure of a run", "mean", "95 % interval", "least", "largest", own.published.by)
    rows = (
        (
            f"{row.name} [{row.unit}]" if row.unit else row.name,
            number(row.mean.value, row.digits),
            span(row.mean, row.digits),
            number(row.least, row.digits),
            number(row.largest, row.digits),
            number(row.published),
        )
        for row in told.rows
    )
    yield from ("", *_table(head, rows))


def _events(told: Summary, own: Measures) -> Iterator[str]:
    if not told.events:
        return
    head = ("event", "wall time", "95 %", "simulated", "95 %", "runs", own.published.by)
    rows = (
        (
            row.name,
            *(value(row.t, 1), span(row.t, 1), value(row.sim_s, 1), span(row.sim_s, 1)),
            *(str(row.runs), number(row.published)),
        )
        for row in told.events
    )
    yield from ("", "Events: s after the first communicate", "", *_table(head, rows))


def _matrix(told: Summary, own: Measures) -> Iterator[str]:
    beside = f"; in brackets: {own.published.by}" if own.published.matrix else ""
    yield from ("", f"Communicates of a run, rows receive, columns send{beside}", "")
    senders = (*own.order, RECEIVED)

    def words(receiver: str) -> Iterator[str]:
        yield receiver
        for cells in (told.matrix[sender] for sender in senders):
            if receiver in cells:
                published = cells[receiver].published
                yield count(cells[receiver].mean) + (f" ({published})" if published else "")

    yield from _table(("", *senders), map(words, (*own.order, SENT)))


# --- From the lines and recordings of an experiment to its report ---------------------------------


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
    written = msgspec.json.format(msgspec.json.encode(told), indent=1) + b"\n"
    write_whole(place / f"{REPORT}.json", written)
    write_whole(place / f"{REPORT}.md", f"{markdown(told, runs.measures)}\n".encode())
    write_whole(place / f"{REPORT}.html", rendered(runs, told).encode())
    with replaced(place / RUNS_FILE) as file:
        parquet.write_table(of_runs(runs), file, compression="zstd")
    share, words = told.success, lines(told, runs.measures)
    return Made(str(place), told.runs, share.value, share.low, share.high, words)


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

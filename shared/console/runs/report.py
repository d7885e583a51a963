"""What a recording gives: `roco report` makes the report of its run again and shows it, `roco
export` makes tables and rosbags.
"""

import shutil
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer
from rich.console import RenderableType
from rich.table import Table

from console import completion
from console.errors import ConsoleError, UsageError, needing
from console.output import Form, Format, argument, option, tell, tell_json
from console.terminal.console import Console, table
from operate.file_names import REPORT_FILE, RRD_FILE, TRAFFIC_FILE
from operate.wording import bytes_in_words

if TYPE_CHECKING:
    from operate.experiments.comparing import Compared, Comparison, Diverged
    from operate.experiments.intervals import Interval
    from operate.experiments.measures import Shown
    from operate.experiments.run_figures import SentMessage
    from operate.ros import bag as rosbag


ABSENT = "-"


def report(
    recording: Annotated[
        Path, argument("A run's folder, or a recording.", complete=completion.runs, exists=True)
    ],
    out: Annotated[
        Path | None,
        option("Where its files go; else a run's own folder, of a recording nowhere.", "--out"),
    ] = None,
    again: Annotated[
        bool,
        option("Draw report.html and run.rrd anew, also where they are up to date.", "--again"),
    ] = False,
    form: Form = Format.TEXT,
) -> None:
    """Make the report of a run again from its recording, and show it. Exits with 1 if the run
    did not succeed.

    For a run's folder it makes report.json again, and report.html and run.rrd if they are older
    than the recording. For a single recording it writes files only with --out.

    Examples:
      roco report runs/latest
      roco report runs/latest --again
      roco report traffic.mcap --out again
      roco report runs/latest/traffic.mcap --format json
    """
    from operate.experiments import measures
    from operate.recording.run import Run, opened
    from operate.reports.make import PAGE_FILE, current, everything
    from operate.reports.report import of

    run, complaints = opened(recording), list[str]()

    def complain(event: str, **fields: object) -> None:
        if fields.get("level") == "error":
            complaints.append(f"{event}: {str(fields.get('why', '')).strip().splitlines()[-1]}")

    folder, drawn = _target(recording, out), tuple[str, ...]((PAGE_FILE, RRD_FILE))
    if folder is not None:
        there = Run(folder, run.system)
        drawn = tuple(name for name in drawn if again or not current(there, name))
        made = Run(folder, run.system, words=RRD_FILE in drawn)
        run = made if folder == recording else run
        if not everything(made, complain, again=again):
            raise ConsoleError(complaints[-1])
    told = of(run.history, run.system)
    shown = measures.shown(told, measures.of(run.system))
    tell(told, form, lambda: show(msgspec.to_builtins(told), shown, folder, Console(), drawn))
    if getattr(told, "success", None) is False:
        raise typer.Exit(1)


def _target(place: Path, out: Path | None) -> Path | None:
    """Return the folder for the files: a run's own, or one that gets the recording, too; None:
    nowhere.
    """
    if out is None:
        return place if place.is_dir() else None
    source = place / TRAFFIC_FILE if place.is_dir() else place
    copy = out / TRAFFIC_FILE
    if source.is_file() and source.resolve() != copy.resolve():
        if copy.exists():
            raise UsageError(f"{out} holds a recording already; give another --out")
        out.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, copy)
    return out


def show(
    told: dict[str, Any],
    shown: "tuple[Shown, ...]",
    folder: Path | None,
    console: Console,
    drawn: tuple[str, ...],
) -> None:
    """Print for people: the verdict, the figures, what happened when, who told whom.

    `shown`: the figures that the system has beyond the traffic; `drawn`: the files that were made
    in the folder besides report.json.
    """
    console.print(headline(told), highlight=False)
    for part in (figures(told, shown), *([events(told)] if "events" in told else []), matrix(told)):
        console.print()
        console.print(part)
    for hole in told["holes"]:
        console.print(f"not recorded: {hole['text']}", style="yellow", highlight=False)
    for name in told.get("missing", ()):
        console.print(f"no {name}", style="dim", highlight=False)
    if folder is not None:
        files = ", ".join((f"{folder}/{REPORT_FILE}", *drawn))
        rest = "" if drawn else "; page and pictures are up to date, --again draws them anew"
        console.print(f"\nwritten: {files}{rest}", highlight=False, soft_wrap=True)


def headline(told: dict[str, Any]) -> str:
    """Success, or why not."""
    if told.get("success") is None:
        verdict = "a run without a verdict of its own"
    else:
        verdict = "success" if told["success"] else f"no success: {told['failure']}"
    return f"{verdict}; seed {told['seed']}, speed {told['speed']}" if told["speed"] else verdict


_TRUTH = {None: "", True: "; true", False: "; NOT TRUE"}


def figures(told: dict[str, Any], shown: "tuple[Shown, ...]") -> RenderableType:
    """Return the figures of the whole run, and of each plan."""
    said = told["communicates"]
    rows = [(one.name, _number(one.value, one.unit)) for one in shown]
    size = f"{sum(said['bytes'].values()) / 1000:.1f} kB"
    rows.append(("communicates", f"{said['total']}, {size}, {said['copies']} sent again"))
    for plan in told.get("plans", ()):
        words = f"{plan['outcome'] or 'no answer'} in {_number(plan['wall_s'], 's')}"
        words += f", {plan['queries']} queries; {plan['ended'] or 'not carried out to its end'}"
        rows.append((f"plan {plan['number']}", words))
    for number, task in enumerate(told.get("tasks", ()), start=1):
        came = "done" if task["success"] else task["failure"]
        rows.append((f"task {number}", f"{task['asked']}: {came}"))
        rows += [("", f"{one['words']}{_TRUTH[one['true']]}") for one in task.get("claims", ())]
    return table(("", ""), rows, fold=("",))


def events(told: dict[str, Any]) -> RenderableType:
    """Return the table of events with their times."""
    times = ("wall [s]", "simulated [s]")
    rows = ((one["words"], _number(one["t"]), _number(one["sim_s"])) for one in told["events"])
    return table(("event", *times), rows, right=times, fold=("event", *times), header_style="bold")


def matrix(told: dict[str, Any]) -> RenderableType:
    """Return the matrix of message counts: rows receive, columns send."""
    counts: dict[str, dict[str, int]] = told["communicates"]["matrix"]
    heads = ("to \\ from", *counts, "received")
    drawn = table(heads, right=heads[1:], fold=heads, header_style="bold")
    for receiver in counts:
        row = [counts[sender].get(receiver, 0) for sender in counts]
        drawn.add_row(receiver, *(str(count or "") for count in row), str(sum(row)))
    sent = [sum(row.values()) for row in counts.values()]
    drawn.add_row("sent", *map(str, sent), str(sum(sent)))
    return drawn


def _number(value: float | None, unit: str = "") -> str:
    if value is None:
        return ABSENT
    number = f"{value:.{0 if unit == '%' else 1}f}"
    return f"{number} {unit}" if unit else number


# --- `roco export`: a recording for other tools: tables, or a rosbag2 -----------------------------


class To(StrEnum):
    """Formats of the tables."""

    PARQUET = "parquet"
    CSV = "csv"


class Written(msgspec.Struct, frozen=True):
    """A table: its file, rows and columns."""

    file: str
    rows: int
    columns: int


class Bag(msgspec.Struct, frozen=True):
    """A rosbag2: its folder, bytes and topics."""

    bag: str
    bytes: int
    topics: "tuple[rosbag.Written, ...]"


def export(
    recording: Annotated[
        Path, argument("A run's folder, or a recording.", complete=completion.runs, exists=True)
    ],
    out: Annotated[
        Path | None, option("Write tables: their folder; made where missing.", "--out")
    ] = None,
    to: Annotated[To, option("Tables: parquet for tools, csv for all else.", "--to")] = To.PARQUET,
    bag: Annotated[
        Path | None, option("Write a rosbag2: its folder, which is made.", "--bag")
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Write what a recording holds for other tools: tables, or a rosbag2 of ROS 2.

    Tables hold communicates, events and telemetry (docs/experiments.md), a rosbag2 also pictures,
    frames and the model of the robot (docs/ros.md).

    Examples:
      roco export runs/latest --to parquet --out tables
      roco export runs/latest/traffic.mcap --to csv --out tables --format json
      roco export runs/latest --bag pour
    """
    if (out is None) == (bag is None):
        raise UsageError("say what is wanted: --out FOLDER for tables, or --bag FOLDER")
    if bag is not None:
        told = bagged(recording, bag)
        tell(told, form, lambda: show_bag(told))
    elif out is not None:
        written = tabled(recording, out, to)
        if form is Format.JSON:
            tell_json(written)
            return
        for one in written:
            print(f"{one.file}: {one.rows} rows, {one.columns} columns")


def tabled(recording: Path, out: Path, to: To) -> list[Written]:
    """Write the tables."""
    from operate.experiments import tables
    from operate.recording.run import opened

    run = opened(recording)
    made = tables.of_history(run.history, run.system)
    files = zip(tables.write(made, out, to), made.values(), strict=True)
    return [Written(str(file), table.num_rows, table.num_columns) for file, table in files]


def bagged(recording: Path, folder: Path) -> Bag:
    """Write the rosbag2. Raise MissingExtraError."""
    from operate.recording.run import opened

    with needing("ros"):
        from operate.ros import bag
    topics = bag.write(folder, bag.entries(opened(recording)))
    return Bag(str(folder), sum(one.stat().st_size for one in folder.iterdir()), topics)


def show_bag(told: Bag) -> None:
    """For people: a line for each topic, then the whole."""
    wide = max((len(one.topic) for one in told.topics), default=0)
    for one in told.topics:
        print(f"{one.topic:<{wide}}  {one.messages:>6}  {one.kind}")
    print(f"{told.bag}: {bytes_in_words(told.bytes)}")


# --- `roco compare`: two sets of runs side by side ------------------------------------------------


STYLES = {"worse": "red", "better": "green", "shown": "dim"}
MOST_SEEDS = 5
"""So many seeds are named; a person reads no more (estimate)."""


def compare(
    a: Annotated[
        Path,
        argument(
            "What was: an experiment's folder, a run's, a recording.",
            complete=completion.runs,
            exists=True,
        ),
    ],
    b: Annotated[Path, argument("What is now, likewise.", complete=completion.runs, exists=True)],
    threshold: Annotated[
        list[str] | None,
        option(
            "PERCENT for all, or success=, latency=, energy=, traffic=PERCENT; may be repeated.",
            complete=completion.thresholds,
        ),
    ] = None,
    form: Form = Format.TEXT,
) -> None:
    """Compare two sets of runs: success, latency, energy, traffic. Exits with 1 where B is worse
    beyond a threshold.

    Worse: the 95 % interval of the difference lies beyond the threshold as a whole (success 5
    points, else 10 %).

    Examples:
      roco compare experiments/before experiments/after
      roco compare experiments/before experiments/after --threshold latency=30 --threshold energy=5
      roco compare runs/latest other/traffic.mcap --threshold 20 --format json
    """
    from operate.experiments import comparing, results

    try:
        limits = comparing.thresholds(threshold or [])
    except ValueError as error:
        raise UsageError(str(error)) from error
    told = comparing.compared(results.load(a), results.load(b), limits)
    tell(told, form, lambda: show_comparison(told, Console()))
    if told.regression:
        raise typer.Exit(1)


def show_comparison(told: "Comparison", console: Console) -> None:
    """For people: quantity by quantity, lost seeds, where they diverge, and the conclusion."""
    console.print(
        f"A: {told.a}, {_runs(told.runs[0])}   B: {told.b}, {_runs(told.runs[1])}", highlight=False
    )
    console.print()
    console.print(quantities(told.rows))
    console.print()
    for one in told.lost[:MOST_SEEDS]:
        console.print(f"seed {one.seed} succeeded in A and not in B: {one.why}", highlight=False)
    for line in divergences(told.diverged):
        console.print(line, highlight=False)
    console.print(conclusion(told), style="red" if told.regression else "", highlight=False)


def quantities(rows: "tuple[Compared, ...]") -> Table:
    """A row for each quantity: both sides, how much B is above A with its interval, what that
    means.
    """
    numbers = ("A", "B", "B to A [%]", "95 %")
    drawn = table(("", *numbers, " "), right=numbers, fold=("", " "), header_style="bold")
    for row in rows:
        name = f"{row.name}, {row.unit}" if row.unit else row.name
        sides = (_side(one, row.name == "success") for one in (row.a, row.b))
        bounds = f"{_percent(row.low)} … {_percent(row.high)}" if row.low is not None else ABSENT
        style = STYLES.get(row.verdict, "")
        drawn.add_row(name, *sides, _percent(row.percent), bounds, row.verdict, style=style)
    return drawn


def divergences(pairs: "tuple[Diverged, ...]") -> list[str]:
    """Return lines on where the exchanges of two experiments begin to differ, and in how many
    seeds.
    """
    apart = [(one.seed, one.first) for one in pairs if one.first is not None]
    if not pairs:
        return ["nothing to align: no seed whose communicates both sides have"]
    if not apart:
        return [f"the same was said in {_runs(len(pairs))} of each side"]
    lines = [f"what was said differs in {len(apart)} of {len(pairs)} seeds; where it begins:"]
    for seed, first in apart[:MOST_SEEDS]:
        place = f"conversation {first.conversation}, communicate {first.position} of its sender"
        lines.append(f"  seed {seed}: {first.of}, {place}")
        lines += [f"    A: {_message_line(first.a)}", f"    B: {_message_line(first.b)}"]
    return lines


def conclusion(told: "Comparison") -> str:
    """Return the conclusion in one sentence."""
    worse = [row for row in told.rows if row.verdict == "worse"]
    if worse:
        return f"regression: {', '.join(f'{w.name} (threshold {w.threshold:g})' for w in worse)}"
    still = sum(row.verdict == "open" for row in told.rows)
    more = " (a single run has no interval)" if min(told.runs) < 2 else ""
    opened = f"; {still} open: more runs would tell{more}" if still else ""
    return f"no regression beyond the thresholds{opened}"


def _side(interval: "Interval | None", share: bool) -> str:
    if interval is None:
        return ABSENT
    if share:
        return f"{100 * interval.value:.0f} %"
    return f"{interval.value:.0f}" if abs(interval.value) >= 1000 else f"{interval.value:.3g}"


def _percent(value: float | None) -> str:
    return ABSENT if value is None else f"{value:+.1f}"


def _message_line(one: "SentMessage | None") -> str:
    if one is None:
        return "nothing more"
    return (
        f"{one.t:.2f} s  {one.sender} > {one.receiver}  {one.performative}  {one.text or one.kind}"
    )


def _runs(count: int) -> str:
    return f"{count} run{'s' * (count != 1)}"

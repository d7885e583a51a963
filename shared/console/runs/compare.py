"""`roco compare`: two sets of runs side by side, for people and for a pipeline that must stop at a
regression.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from console import completion
from console.errors import UsageError
from console.output import Form, Format, argument, option, problems, tell
from console.terminal.console import Console
from console.terminal.table import table

if TYPE_CHECKING:
    from operate.experiments.comparing import Compared, Comparison, Diverged
    from operate.experiments.intervals import Interval
    from operate.experiments.run_figures import SentMessage

ABSENT = "-"
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
    with problems(form):
        from operate.experiments import comparing, results

        try:
            limits = comparing.thresholds(threshold or [])
        except ValueError as error:
            raise UsageError(str(error)) from error
        told = comparing.compared(results.load(a), results.load(b), limits)
        tell(told, form, lambda: show(told, Console()))
        if told.regression:
            raise typer.Exit(1)


def show(told: "Comparison", console: Console) -> None:
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
    console.print(sentence(told), style="red" if told.regression else "", highlight=False)


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


def sentence(told: "Comparison") -> str:
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

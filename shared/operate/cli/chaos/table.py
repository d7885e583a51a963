"""Findings of chaos as tables: one per kind of fault, a row per process, a column per phase, seeds in the cells."""

from collections.abc import Iterator, Sequence

from rich.table import Table
from rich.text import Text

from operate.cli.chaos.trial import Result

DONE, EXPLAINED, BROKEN, NOTHING = "green", "yellow", "bold red", "dim"
LEGEND = (
    (DONE, "done"),
    (EXPLAINED, "not done, the reason said"),
    (BROKEN, "broken, stuck or left over"),
    (NOTHING, "the fault did not begin"),
)


def colour(one: Result) -> str:
    """Return how a run is shown."""
    if not one.held:
        return BROKEN
    return NOTHING if not one.began else DONE if one.success else EXPLAINED


def legend() -> Text:
    """Return what the colours of seeds mean."""
    return Text("  ").join([Text("seed", style="dim"), *(Text(words, style=style) for style, words in LEGEND)])


def tables(results: Sequence[Result]) -> Iterator[Table]:
    """Yield a table for each kind of fault that was done."""
    for kind in dict.fromkeys(one.cell.kind for one in results):
        own = [one for one in results if one.cell.kind == kind]
        columns = list(dict.fromkeys(one.cell.phase for one in own))
        drawn = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
        for name in (kind, *columns):
            drawn.add_column(name, overflow="fold")
        for target in dict.fromkeys(one.cell.target for one in own):
            drawn.add_row(target, *(_seeds(own, target, phase) for phase in columns))
        yield drawn


def lines(results: Sequence[Result]) -> Iterator[str]:
    """Yield what was not done and what is broken, a line for each."""
    for one in results:
        for why in (*one.broken, *(f"left over: {orphan}" for orphan in one.orphans)):
            yield f"seed {one.cell.seed}, {one.cell.words}: {why}"
        if one.stuck:
            yield f"seed {one.cell.seed}, {one.cell.words}: stuck, ended after {one.wall_s:.0f} s"
        elif not one.success:
            yield f"seed {one.cell.seed}, {one.cell.words}: not done: {one.why or 'without a reason'}"


def summary(results: Sequence[Result]) -> str:
    """Return the counts of all runs in a line."""
    begun = [one for one in results if one.began]
    done, held = sum(one.success for one in begun), sum(one.held for one in results)
    stuck, left = sum(one.stuck for one in results), sum(len(one.orphans) for one in results)
    return (
        f"{len(results)} runs, {len(begun)} with a fault: {done} of {len(begun)} done, {held} of {len(results)} held;"
        f" {stuck} stuck, {left} processes left over"
    )


def _seeds(results: Sequence[Result], target: str, phase: str) -> Text:
    found = [one for one in results if (one.cell.target, one.cell.phase) == (target, phase)]
    return Text(" ").join(Text(str(one.cell.seed), style=colour(one)) for one in found)

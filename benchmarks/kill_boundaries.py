"""Each of the six agents killed right before and right after each message of the pouring task is
taken: the same world?

In memory, in virtual time, with the true behaviours; search and robot are scripted (tests/fleet).
The agent that dies comes back from its journal 0.5 s later. Compared with the run without a death:
km's world, where things stand, hi's last word, no act commanded or begun twice. One row of
results/kill_boundaries.jsonl for BLOCK messages; rows that stand there are not run again. `--table`
writes docs/results/faults.md; CI runs a sample (tests/fleet/test_deaths.py).

    python benchmarks/kill_boundaries.py
"""

import itertools
import os
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import tables
import typer

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests/fleet"))

from boundaries import VICTIMS, Ending, Side, messages, run  # noqa: E402  (after the path is set)

RESULTS, PAGE = HERE / "results/kill_boundaries.jsonl", HERE.parent / "docs/results/faults.md"
BEGIN, END = (
    "<!-- boundaries: python benchmarks/kill_boundaries.py --table -->\n",
    "<!-- /boundaries -->\n",
)
BLOCK = 29


def different(found: Ending, usual: Ending) -> str:
    """Return what is otherwise than without a death; "" where nothing is. More acts may be
    commanded: looks.
    """
    names = [
        name
        for name in ("world", "stands", "last", "poured")
        if getattr(found, name) != getattr(usual, name)
    ]
    return ", ".join([*names, *(f"{key} twice" for key in found.doubled)])


def block(victim: str, side: Side, numbers: range, usual: Ending) -> dict[str, Any]:
    """Run some messages; their line."""
    began, load, wrong = time.monotonic(), os.getloadavg()[0], {}
    acts: Counter[str] = Counter()
    for number in numbers:
        try:
            found = run(victim, number, side)
        except Exception as error:  # whatever it is, it is a result
            wrong[str(number)] = f"{type(error).__name__}: {error}"
            continue
        acts[str(len(found.acts) - len(usual.acts))] += 1
        if why := different(found, usual):
            wrong[str(number)] = why
    line = {
        "victim": victim,
        "side": side,
        "first": numbers.start,
        "runs": len(numbers),
        "wrong": wrong,
    }
    return line | {
        "more_acts": dict(acts),
        "load": round(load, 1),
        "seconds": round(time.monotonic() - began, 1),
    }


def printed(lines: list[dict[str, Any]]) -> str:
    """Return the table: one row for each agent."""
    runs, wrong = sum(line["runs"] for line in lines), sum(len(line["wrong"]) for line in lines)
    rows = [
        f"{runs:,} runs, {runs - wrong:,} with the same end.",
        "",
        (
            "| killed | runs | same world, same last word, no act twice | acts commanded beyond"
            " those of a run without |"
        ),
        "|---|---|---|---|",
    ]
    for victim in VICTIMS:
        mine = [line for line in lines if line["victim"] == victim]
        if not mine:
            continue
        count, bad = sum(one["runs"] for one in mine), sum(len(one["wrong"]) for one in mine)
        more: Counter[str] = sum((Counter(one["more_acts"]) for one in mine), Counter())
        words = ", ".join(
            f"{extra} in {times}"
            for extra, times in sorted(more.items(), key=lambda one: int(one[0]))
        )
        rows.append(f"| {victim} | {count} | {count - bad} | {words} |")
    return "\n".join(rows) + "\n"


def main(
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[
        bool, typer.Option("--table", help="write the table into docs/results/faults.md, and end")
    ] = False,
) -> None:
    """Run what does not stand in the results file yet."""
    lines = tables.read(out)
    if table:
        tables.put(PAGE, BEGIN, printed(lines), END)
        return
    known = {(line["victim"], line["side"], line["first"]) for line in lines}
    usual, count = run(), messages()
    for first, victim, side in itertools.product(range(1, count + 1, BLOCK), VICTIMS, Side):
        if (victim, side, first) in known:
            continue
        line = block(victim, side, range(first, min(first + BLOCK, count + 1)), usual)
        tables.append(out, line)
        typer.echo(
            f"{victim} {side} {first}: {line['runs']} runs, {line['wrong'] or 'all the same'}"
        )


if __name__ == "__main__":
    typer.run(main)

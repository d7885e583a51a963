"""Whether a pour succeeds when a process is killed, hung, paused or cut off, or the link of two
agents is cut: each process or link, phase and fault.

One run of `roco chaos` per cell (console.faults.chaos). Appends one line per cell to a results
file and skips cells that stand there, so that it may be ended at any time and goes on. `--table`
writes docs/results/faults.md.

    python benchmarks/fault_table.py --faults kill,pause
"""

import itertools
import tempfile
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer

from companion.tools.report.verdict import begun_twice
from companion.tools.system import JOB, SYSTEM
from console.faults import chaos
from console.faults.chaos import Cell
from console.runs import experiment
from operate.file_names import REPORT_FILE
from operate.recording.run import Run

FAULTS: dict[str, float | None] = {"kill": None, "pause": 3.0, "hang": 60.0, "cut": 5.0}
"""Kind -> how long [s]; a supervisor has ended what hangs long before."""
VICTIMS = ("hi", "co", "pl", "km", "ta", "ex", "loop", "router", "monitor")
LINKS = tuple(sorted("-".join(sorted(channel.ends)) for channel in SYSTEM.design.channels.values()))
"""Pairs of agents, each linked with each other; only `cut` is done to them."""
WIRELESS = ("loop", "monitor")
"""They have no wire that could be cut: the loop speaks with nobody, the monitor with the router
directly.
"""
RESULTS = Path(__file__).parent / "results/fault_table.jsonl"
PAGE = Path(__file__).parents[1] / "docs/results/faults.md"
BEGIN, END = "<!-- faults: python benchmarks/fault_table.py --table -->\n", "<!-- /faults -->\n"


def cell(victim: str, phase: str, fault: str, seed: int, out: Path) -> dict[str, Any]:
    """Return what became of one pour, as a line of the results file."""
    one = Cell(seed, fault, victim, phase, JOB.phases[phase], FAULTS[fault])
    asked = experiment.Asked(1, seed, "max", None, JOB.timeout_s, 0.0)
    done = chaos.done(out, experiment.setting_here("chaos", (*JOB.command, "--faults"), asked), one)
    line = {
        "victim": victim,
        "phase": phase,
        "fault": fault,
        "seed": seed,
        "done": done.began,
        "load": done.load,
    }
    line |= {"exit": done.exit, "wall_s": done.wall_s, "poured": done.success, "why": done.why}
    line |= {"broken": done.broken, "stuck": done.stuck, "orphans": done.orphans}
    return line | figures(experiment.folder(out, seed))


def figures(run: Path) -> dict[str, Any]:
    """Return how many plans a pour needed, what was against the design, how many acts were begun
    twice.
    """
    found: dict[str, Any] = {
        "doubled": sum(times - 1 for times in begun_twice(Run(run, SYSTEM).history).values())
    }
    if (run / REPORT_FILE).exists():
        report = msgspec.json.decode((run / REPORT_FILE).read_bytes())
        found["plans"] = len(report["plans"])
        found["violations"] = len(report["judged"]["violations"]) if report.get("judged") else None
    return found


def main(
    faults: Annotated[str, typer.Option(help=", ".join(FAULTS))] = "kill,pause",
    victims: Annotated[str, typer.Option()] = ",".join((*VICTIMS, *LINKS)),
    phases: Annotated[str, typer.Option()] = ",".join(JOB.phases),
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[
        bool, typer.Option("--table", help="write the tables into docs/results/faults.md, and end")
    ] = False,
) -> None:
    """Run the cells that do not stand in the results file yet."""
    lines = tables.read(out)
    if table:
        tables.put(PAGE, BEGIN, printed(lines), END)
        return
    known = {(line["fault"], line["victim"], line["phase"]) for line in lines}
    asked = itertools.product(faults.split(","), phases.split(","), victims.split(","))
    for number, (fault, phase, victim) in enumerate(asked):
        if (fault, victim, phase) in known or victim in (WIRELESS if fault == "cut" else LINKS):
            continue
        with tempfile.TemporaryDirectory(prefix="fault-", ignore_cleanup_errors=True) as folder:
            line = cell(victim, phase, fault, 1 + number % 10, Path(folder))
        tables.append(out, line)
        words = "poured" if line["poured"] else f"NOT POURED: {line['why']}"
        typer.echo(
            f"{fault} {victim} at {phase}: {words}, doubled {line['doubled']}, {line['wall_s']} s"
        )


def printed(lines: list[dict[str, Any]]) -> str:
    """Return a table for each fault: a row for each process, a column for each phase; below it what
    did not pour.

    The newest line of a cell counts. A cell that failed is tried again after the cause is mended;
    both lines stay.
    """
    found = {(line["fault"], line["victim"], line["phase"]): line for line in lines}
    parts = []
    for fault in FAULTS:
        rows = [
            victim
            for victim in (*VICTIMS, *LINKS)
            if any((fault, victim, phase) in found for phase in JOB.phases)
        ]
        if not rows:
            continue
        parts += [
            "",
            f"| {fault} | {' | '.join(JOB.phases)} | poured |",
            "|---" * (len(JOB.phases) + 2) + "|",
        ]
        for victim in rows:
            cells = [found.get((fault, victim, phase)) for phase in JOB.phases]
            ran = [one for one in cells if one is not None]
            marks = ["" if one is None else "✓" if one["poured"] else "✗" for one in cells]
            parts.append(
                f"| {victim} | {' | '.join(marks)} | {sum(one['poured'] for one in ran)} of"
                f" {len(ran)} |"
            )
        wrong = [one for one in lines if one["fault"] == fault and not one["poured"]]
        parts += ["", *(_wrong(one, found) for one in wrong)]
    doubled, stuck = (
        sum(int(line.get(what) or 0) for line in lines) for what in ("doubled", "stuck")
    )
    poured, left = (
        sum(one["poured"] for one in found.values()),
        sum(len(one.get("orphans", ())) for one in lines),
    )
    total = (
        f"{poured} of {len(found)} poured, {stuck} stuck, {doubled} acts begun twice, {left}"
        " processes left over"
    )
    loads = [line["load"] for line in lines]
    total += f" (load {min(loads):.0f} to {max(loads):.0f})." if loads else "."
    return "\n".join((total, *parts)).rstrip() + "\n"


def _wrong(line: dict[str, Any], found: dict[tuple[str, str, str], dict[str, Any]]) -> str:
    """A run that did not pour, and whether the same cell has poured since."""
    since = found[line["fault"], line["victim"], line["phase"]]["poured"]
    return (
        f"- {line['victim']}, {line['phase']}:"
        f" {line['why']}{' **It poured when this was mended.**' if since else ''}"
    )


if __name__ == "__main__":
    typer.run(main)

"""A process is killed or hung while one task is left for another, or cancelled: whether both tasks end as wanted.

A pour is left for a more urgent "look around" while the jar is carried, and taken up again; or cancelled there. One
fleet per cell, --speed max. Good is: what was asked for is done or cancelled, nothing was dropped, and a cancelled pour
leaves everything upright and in no hand. Appends a line per cell and skips cells that stand there.

    python benchmarks/faults_while_switching.py --faults kill,hang --victims co,ta
    python benchmarks/faults_while_switching.py --table
"""

import itertools
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer
from interruptions import POUR
from watched_fleet import ENDED, NotSeenError, WatchedFleet, unsafe

from companion.design import DESIGN
from operate.cli.errors import ConsoleError

RESULTS = Path(__file__).parent / "results/faults_while_switching.jsonl"
PAGE = Path(__file__).parents[1] / "docs/reliability.md"
BEGIN, END = "<!-- switching: python benchmarks/faults_while_switching.py --table -->\n", "<!-- /switching -->\n"
FAULTS = {"kill": (), "hang": ("--for", "60")}
"""Kind -> options of `roco fault`; the supervisor has ended what hangs long before."""
VICTIMS = tuple(DESIGN.agents)
PHASES = ("suspending", "suspended", "resuming", "cancelling")
AT = "carry jar_1"
FAULT_S = 120.0  # wall; estimate: until a process is back, on a busy machine
LEAST = 0.9
"""Share of the content that a pour moves."""


class Cell:
    """One fleet: a pour that is interrupted, and one fault in it."""

    def __init__(self, fleet: WatchedFleet, victim: str, fault: str) -> None:
        self.fleet, self.victim, self.fault = fleet, victim, fault
        self.pour = fleet.say(POUR).task
        if not fleet.reach(self.pour, lambda line, truth: line.at is not None and AT in line.at.path):
            raise NotSeenError(f"the pour ended before {AT}: {fleet.line(self.pour).text}")

    def run(self, phase: str) -> str:
        """Return what is not as wanted; "" for nothing."""
        return self._cancelled() if phase == "cancelling" else self._switched(phase)

    def _switched(self, phase: str) -> str:
        other = self.fleet.say("look around", urgency=1).task
        if phase != "suspending":
            self.fleet.wait(lambda: self._is("suspended", *ENDED), "the pour is left", 600.0)
        if phase == "resuming":
            self.fleet.ended(other)
            self.fleet.wait(lambda: self._is("planning", "running", *ENDED), "the pour goes on", 600.0)
        self._inject()
        looked, poured = self.fleet.ended(other), self.fleet.ended(self.pour)
        wrong = [f"{line.said}: {line.state}: {line.text}" for line in (looked, poured) if line.state != "done"]
        truth = self.fleet.truth()
        share = truth.grains_in["bowl_1"] / truth.grains
        return "; ".join([*wrong, *([] if share >= LEAST else [f"{100 * share:.0f} % is in the bowl"])])

    def _cancelled(self) -> str:
        self.fleet.hi.cancel(self.pour)
        self._inject()
        line = self.fleet.ended(self.pour)
        wrong = [] if line.state == "cancelled" else [f"{line.state}: {line.text}"]
        after = self.fleet.ended(self.fleet.say("look around").task)
        wrong += [] if after.state == "done" else [f"the next task: {after.state}: {after.text}"]
        return "; ".join(filter(None, [*wrong, unsafe(self.fleet.truth())]))

    def _is(self, *states: str) -> bool:
        return self.fleet.line(self.pour).state in states

    def _inject(self) -> None:
        roco = Path(sys.executable).with_name("roco")
        words = [str(roco), "fault", self.fault, self.victim, *FAULTS[self.fault], "--run-dir", str(self.fleet.run)]
        done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=FAULT_S)
        if done.returncode:
            raise NotSeenError(done.stderr)


def measured(victim: str, phase: str, fault: str, seed: int, folder: Path) -> dict[str, Any]:
    """Return one cell, as a line of the results file."""
    line: dict[str, Any] = {"victim": victim, "phase": phase, "fault": fault, "seed": seed}
    line["load"] = round(os.getloadavg()[0], 1)
    began = time.monotonic()
    try:
        with WatchedFleet(folder, seed, "--faults") as fleet:
            line["wrong"] = Cell(fleet, victim, fault).run(phase)
            line["dropped"] = fleet.dropped
    except (NotSeenError, ConsoleError, OSError, subprocess.SubprocessError) as error:
        line["wrong"] = str(error)[:300]
    return line | {"wall_s": round(time.monotonic() - began, 1), "good": not line["wrong"] and not line.get("dropped")}


def printed(lines: list[dict[str, Any]]) -> str:
    """Return a row for each process and fault, a column for each phase; below it what was not as wanted."""
    found = {(line["victim"], line["fault"], line["phase"]): line for line in lines}
    rows = [f"| process | fault | {' | '.join(PHASES)} |", "|---" * (len(PHASES) + 2) + "|"]
    for victim, fault in itertools.product(VICTIMS, FAULTS):
        cells = [found.get((victim, fault, phase)) for phase in PHASES]
        if any(cells):
            marks = ("" if cell is None else "✓" if cell["good"] else "✗" for cell in cells)
            rows.append(f"| {victim} | {fault} | {' | '.join(marks)} |")
    wrong = [
        f"- {one['fault']} {one['victim']}, {one['phase']}: {one['wrong'] or one['dropped']}"
        for one in found.values()
        if not one["good"]
    ]
    loads = [line["load"] for line in lines]
    total = (
        f"{sum(one['good'] for one in found.values())} of {len(found)} as wanted, load {min(loads)} to {max(loads)}."
    )
    return "\n".join([total, "", *rows, *([""] if wrong else []), *wrong]) + "\n"


def main(
    faults: Annotated[str, typer.Option(help=", ".join(FAULTS))] = ",".join(FAULTS),
    victims: Annotated[str, typer.Option()] = ",".join(VICTIMS),
    phases: Annotated[str, typer.Option()] = ",".join(PHASES),
    seed: Annotated[int, typer.Option()] = 7,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[bool, typer.Option("--table", help="write the table into docs/reliability.md, and end")] = False,
) -> None:
    """Run the cells that do not stand in the results file yet."""
    lines = tables.read(out)
    if table:
        tables.put(PAGE, BEGIN, printed(lines), END)
        return
    known = {(line["victim"], line["phase"], line["fault"]) for line in lines}
    base = Path(tempfile.mkdtemp(prefix="faults-"))
    for victim, fault, phase in itertools.product(victims.split(","), faults.split(","), phases.split(",")):
        if (victim, phase, fault) in known:
            continue
        line = measured(victim, phase, fault, seed, base / f"{victim}-{fault}-{phase}")
        tables.append(out, line)
        typer.echo(msgspec.json.encode(line).decode())


if __name__ == "__main__":
    typer.run(main)

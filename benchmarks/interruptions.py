"""A pour that is cancelled, or left for a more urgent task, at each of twelve phases: what becomes of jar and bowl.

One fleet per cell, --speed max. Safe is when everything stands upright, in no hand, from then on; left is when the
task has ended or waits, with the arms at home. Then "look around" must be done. Appends a line per cell to a results
file and skips cells that stand there.

    python benchmarks/interruptions.py --seeds 7 --out benchmarks/results/interruptions.jsonl
    python benchmarks/interruptions.py --table --out benchmarks/results/interruptions.jsonl
"""

import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer
from watched_fleet import ENDED, NotSeenError, WatchedFleet, held, unsafe

from companion.run_files import TaskLine
from operate.cli.errors import ConsoleError
from velma.sim.truth import Truth

PAGE = Path(__file__).parents[1] / "docs/scheduling.md"
BEGIN, END = "<!-- interruptions: python benchmarks/interruptions.py --table -->\n", "<!-- /interruptions -->\n"
POUR = "pour the content of the jar into the bowl"
SAFE_S = 25.0  # simulated; what is wanted
Moment = Callable[[TaskLine, Truth], bool]


def _at(step: str, act: str = "", also: Callable[[Truth], bool] = lambda truth: True) -> Moment:
    return lambda line, truth: line.at is not None and step in line.at.path and act in ("", line.at.act) and also(truth)


def _jar(truth: Truth, least: int, most: int = 99) -> bool:
    return least <= max(truth.fingers_on["jar_1"].values()) <= most


PHASES: dict[str, Moment] = {
    "searching": lambda line, truth: line.state == "planning",
    "approaching": _at("take jar_1", "MoveJoint"),
    "closing": _at("take jar_1", "Grasp", lambda truth: _jar(truth, 1)),
    "jar lifted": _at("take jar_1", "MoveCartesian", lambda truth: _jar(truth, 3)),
    "carrying": _at("carry jar_1", "", lambda truth: _jar(truth, 3)),
    "bowl grasped": _at("take bowl_1", "Grasp", lambda truth: _jar(truth, 3)),
    "putting down": _at("place bowl_1", "Release", lambda truth: "bowl_1" in held(truth)),
    "between plans": _at("look at bowl_1"),
    "replanning": lambda line, truth: line.state == "planning" and any(one.numbers[:1] == (2.0,) for one in line.why),
    "tilting": _at(
        "pour jar_1 bowl_1",
        "Pour",
        lambda truth: 30.0 < truth.tilt_deg["jar_1"] < 90.0 and not truth.grains_in["bowl_1"],
    ),
    "mid-pour": _at(
        "pour jar_1 bowl_1", "Pour", lambda truth: truth.tilt_deg["jar_1"] > 90.0 and truth.grains_in["bowl_1"] > 0
    ),
    "returning": _at(
        "pour jar_1 bowl_1", "Pour", lambda truth: truth.tilt_deg["jar_1"] < 80.0 and truth.grains_in["bowl_1"] > 0
    ),
}
"""Moments of a pour, in their order."""


def measured(seed: int, phase: str, kind: str, folder: Path) -> dict[str, Any]:
    """Return one cell, as a line of the results file."""
    line: dict[str, Any] = {"seed": seed, "phase": phase, "kind": kind, "load": round(os.getloadavg()[0], 1)}
    began = time.monotonic()
    try:
        with WatchedFleet(folder, seed) as fleet:
            line |= _interrupted(fleet, phase, kind)
            line["dropped"] = fleet.dropped
    except (NotSeenError, ConsoleError, OSError, subprocess.SubprocessError) as error:
        line["failure"] = str(error)[:300]
    line["wall_s"] = round(time.monotonic() - began, 1)
    line["good"] = line.get("safe_s", 1e9) <= SAFE_S and not any(
        line.get(wrong) for wrong in ("failure", "unsafe", "dropped")
    )
    return line


class _SafeSince:
    """Time since which everything has been safe, in simulated seconds; None while it is not."""

    def __init__(self, fleet: WatchedFleet) -> None:
        self.fleet = fleet
        self.at: float | None = None

    def look(self) -> None:
        """Note the time, if this is the first look at a safe world since an unsafe one."""
        truth = self.fleet.truth()
        if unsafe(truth):
            self.at = None
        elif self.at is None:
            self.at = truth.time_s


def _interrupted(fleet: WatchedFleet, phase: str, kind: str) -> dict[str, Any]:
    task = fleet.say(POUR).task
    if not fleet.reach(task, PHASES[phase]):
        return {"failure": f"{phase} was not reached: {fleet.line(task).text}"}
    before = fleet.truth()
    other = ""
    if kind == "cancel":
        fleet.hi.cancel(task)
        left = lambda: fleet.line(task).state in ENDED  # noqa: E731
    else:
        other = fleet.say("look around", urgency=1).task
        left = lambda: fleet.line(task).state in ("suspended", *ENDED)  # noqa: E731
    safe = _SafeSince(fleet)

    def done() -> bool:
        safe.look()
        return left()

    fleet.wait(done, "the pour is left", 600.0)
    after, line = fleet.truth(), fleet.line(task)
    found: dict[str, Any] = {"state": line.state, "text": line.text[:120], "held": held(before)}
    found |= {"left_s": round(after.time_s - before.time_s, 1), "unsafe": unsafe(after)}
    if safe.at is not None:
        found["safe_s"] = round(safe.at - before.time_s, 1)
    served = fleet.ended(other or fleet.say("look around").task)
    if served.state != "done":
        found["failure"] = f"the next task: {served.state}: {served.text}"
    if kind == "switch" and line.state == "suspended":
        found["resumed"] = fleet.ended(task).state
        truth = fleet.truth()
        found["poured"] = round(truth.grains_in["bowl_1"] / truth.grains, 2)
        if found["resumed"] != "done":
            found["failure"] = f"resumed: {fleet.line(task).text}"
    return found


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "7",
    kinds: Annotated[str, typer.Option(help="cancel, switch")] = "cancel,switch",
    phases: Annotated[str, typer.Option()] = ",".join(PHASES),
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path("interruptions.jsonl"),
    table: Annotated[bool, typer.Option(help="only write the table of the page")] = False,
) -> None:
    """Try the cells that do not stand in the results file yet."""
    lines = tables.read(out)
    if table:
        tables.put(PAGE, BEGIN, printed(lines), END)
        return
    known = {(line["seed"], line["phase"], line["kind"]) for line in lines}
    base = Path(tempfile.mkdtemp(prefix="interruptions-"))
    for seed in tables.seeds(seeds):
        for kind in kinds.split(","):
            for number, phase in enumerate(phases.split(",")):
                if (seed, phase, kind) in known:
                    continue
                line = measured(seed, phase, kind, base / f"{seed}-{kind}-{number}")
                tables.append(out, line)
                typer.echo(msgspec.json.encode(line).decode())


def printed(lines: list[dict[str, Any]]) -> str:
    """Return the table: a row for each phase."""
    rows = ["| phase | cancel: good, s to safe | switch: good, s to safe, resumed |", "|---|---|---|"]
    for phase in PHASES:
        cells = []
        for kind in ("cancel", "switch"):
            found = [line for line in lines if (line["phase"], line["kind"]) == (phase, kind)]
            times = ", ".join(f"{line['safe_s']:g}" for line in found if "safe_s" in line)
            cell = f"{sum(line['good'] for line in found)} of {len(found)}; {times or '-'}" if found else "not tried"
            if kind == "switch" and found:
                cell += f"; {sum(line.get('resumed') == 'done' for line in found)}"
            cells.append(cell)
        rows.append(f"| {phase} | {cells[0]} | {cells[1]} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    typer.run(main)

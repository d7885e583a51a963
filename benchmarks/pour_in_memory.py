"""The whole task with all six agents in one process on virtual wires: true search, skills, loop and physics.

Appends one line per seed to a results file and skips seeds that stand there.

    python benchmarks/pour_in_memory.py --seeds 1-20 --out benchmarks/results/pour_in_memory.jsonl
"""

import sys
import time
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "fleet"))
from test_pour import TrueFleet  # the fleet that the long test runs, for more seeds

LIMIT_S = 1200.0  # of the wires' clock, as in the test


def measured(seed: int) -> dict[str, Any]:
    """One seed, as a line of the results file."""
    began = time.perf_counter()
    fleet = TrueFleet(seed)
    try:
        fleet.say("pour the jar into the bowl")
        ended = fleet.finish(limit_s=LIMIT_S)
        truth = fleet.truth.read()
    finally:
        fleet.close()
    poured = truth.grains_in.get("bowl_1", 0) / max(1, truth.grains)
    held, tilt = truth.fingers_on["jar_1"]["left"] >= 3, truth.tilt_deg["bowl_1"]
    return {
        "seed": seed, "success": ended == ["done"] and poured >= 0.9 and held and tilt < 10.0,
        "ended": ended, "tasks": [str(task) for task in fleet.tasks], "poured": round(poured, 3), "held": held,
        "bowl_tilt_deg": round(tilt, 2), "sim_time_s": round(truth.time_s, 1),
        "wall_s": round(time.perf_counter() - began, 1),
    }  # fmt: skip


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-20",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path("pour_in_memory.jsonl"),
) -> None:
    """Run the seeds that do not stand in the results file yet."""
    out.parent.mkdir(parents=True, exist_ok=True)
    known = {msgspec.json.decode(line)["seed"] for line in out.read_bytes().splitlines()} if out.exists() else set()
    for seed in tables.seeds(seeds):
        if seed in known:
            continue
        result = measured(seed)
        tables.append(out, result)
        typer.echo(f"seed {seed}: {result}")


if __name__ == "__main__":
    typer.run(main)

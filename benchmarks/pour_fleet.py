"""The whole task with the whole fleet: real processes over Zenoh, one `roco demo` per seed, counted and explained.

Appends one line per seed to a results file and skips seeds that stand there; the run folders go where --runs says.

    python benchmarks/pour_fleet.py --seeds 1-20 --out benchmarks/results/pour_fleet.jsonl
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

DEADLINE_S = 600.0  # estimate: a run takes 40-60 s at --speed max and about two minutes at --speed 1


def measured(seed: int, speed: str, folder: Path) -> dict[str, Any]:
    """One demo, as a line of the results file."""
    roco = Path(sys.executable).with_name("roco")
    command = [str(roco), "demo", "--seed", str(seed), "--speed", speed, "--out", str(folder), "--headless"]
    began = time.perf_counter()
    ended = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    line: dict[str, Any] = {"seed": seed, "speed": speed, "exit": ended.returncode}
    line["demo_wall_s"] = round(time.perf_counter() - began, 1)
    report = folder / "report.json"
    if not report.exists():
        return line | {"success": False, "failure": f"no report: {ended.stdout[-300:]}{ended.stderr[-300:]}"}
    found = msgspec.json.decode(report.read_bytes())
    keys = ("success", "failure", "poured_fraction", "bowl_tilt_deg", "sim_time_s", "wall_time_s", "energy_J", "loop")
    plans = [{k: plan[k] for k in ("queries", "wall_s", "ended")} for plan in found["plans"]]
    communicates = {k: found["communicates"][k] for k in ("total", "bytes")}
    return line | {k: found[k] for k in keys} | {"plans": plans, "communicates": communicates}


def main(
    seeds: Annotated[str, typer.Option(help="first-last")] = "1-20",
    speed: Annotated[str, typer.Option(help="max or 1")] = "max",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path("pour_fleet.jsonl"),
    runs: Annotated[Path | None, typer.Option(help="where the run folders go; else a temporary folder")] = None,
) -> None:
    """Run the seeds that do not stand in the results file yet at this speed."""
    first, last = (int(x) for x in seeds.split("-"))
    out.parent.mkdir(parents=True, exist_ok=True)
    lines = [msgspec.json.decode(line) for line in out.read_bytes().splitlines()] if out.exists() else []
    known = {(line["seed"], line["speed"]) for line in lines}
    base = runs or Path(tempfile.mkdtemp(prefix="pour-fleet-"))
    for seed in range(first, last + 1):
        if (seed, speed) in known:
            continue
        result = measured(seed, speed, base / f"seed-{seed}-{speed}")
        with out.open("ab") as file:
            file.write(msgspec.json.encode(result) + b"\n")
        verdict = "poured" if result["success"] else f"FAILED: {result['failure']}"
        times = f"sim {result.get('sim_time_s')} s, demo {result['demo_wall_s']} s"
        typer.echo(f"seed {seed}: {verdict}, {times}, {result.get('plans')}")


if __name__ == "__main__":
    typer.run(main)

"""The whole task with the whole fleet: real processes over Zenoh, one `roco demo` per seed, counted
and explained.

Appends one line per seed to a results file and skips seeds that stand there; the run folders go
where --runs says. With --busy, stress-ng (Debian: stress-ng) keeps that many processes turning
meanwhile.

    python benchmarks/pour_fleet.py --seeds 1-20 --out benchmarks/results/pour_fleet.jsonl
    python benchmarks/pour_fleet.py --seeds 1-10 --speed found --busy 6 \\
        --out benchmarks/results/first_minute.jsonl
"""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer

# estimate: a run takes 40-60 s at --speed max, two minutes at --speed 1; thrice that when busy
DEADLINE_S = 900.0


@contextlib.contextmanager
def busy_machine(processes: int) -> Iterator[None]:
    """Keep `processes` processes turning without pause, at the usual priority."""
    if not processes:
        yield
        return
    program = shutil.which("stress-ng")
    if program is None:
        raise typer.BadParameter("stress-ng is not installed; on Debian: apt install stress-ng")
    beside = subprocess.Popen([program, "--quiet", "--cpu", str(processes)])
    try:
        yield
    finally:
        beside.terminate()
        beside.wait(timeout=30)


def measured(seed: int, speed: str, folder: Path) -> dict[str, Any]:
    """Return one demo, as a line of the results file; at speed "found" the demo decides, as
    `scripts/demo` does.
    """
    roco = Path(sys.executable).with_name("roco")
    said = [] if speed == "found" else ["--speed", speed]
    command = [str(roco), "demo", "--seed", str(seed), *said, "--out", str(folder), "--headless"]
    began = time.perf_counter()
    load_before = os.getloadavg()[0]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    line: dict[str, Any] = {"seed": seed, "speed": speed, "exit": ended.returncode}
    line["demo_wall_s"] = round(time.perf_counter() - began, 1)
    line["load"] = [round(load_before, 2), round(os.getloadavg()[0], 2)]
    line["announced_max"] = "--speed max" in ended.stdout.split("command received")[0]
    report = folder / "report.json"
    if not report.exists():
        return line | {
            "success": False,
            "failure": f"no report: {ended.stdout[-300:]}{ended.stderr[-300:]}",
        }
    found = msgspec.json.decode(report.read_bytes())
    keys = (
        "success",
        "failure",
        "poured_fraction",
        "bowl_tilt_deg",
        "sim_time_s",
        "wall_time_s",
        "energy_J",
        "loop",
    )
    plans = [{k: plan[k] for k in ("queries", "wall_s", "ended")} for plan in found["plans"]]
    communicates = {k: found["communicates"][k] for k in ("total", "bytes")}
    return line | {k: found[k] for k in keys} | {"plans": plans, "communicates": communicates}


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-20",
    speed: Annotated[str, typer.Option(help="max, 1, or found: the demo decides")] = "max",
    busy: Annotated[int, typer.Option(help="processes of stress-ng that turn meanwhile")] = 0,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path("pour_fleet.jsonl"),
    runs: Annotated[
        Path | None, typer.Option(help="where the run folders go; else a temporary folder")
    ] = None,
) -> None:
    """Run the seeds that do not stand in the results file yet at this speed, on a machine this
    busy.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    lines = tables.read(out)
    known = {(line["seed"], line["speed"], line.get("busy", 0)) for line in lines}
    base = runs or Path(tempfile.mkdtemp(prefix="pour-fleet-"))
    for seed in tables.seeds(seeds):
        if (seed, speed, busy) in known:
            continue
        with busy_machine(busy):
            result = measured(seed, speed, base / f"seed-{seed}-{speed}-{busy}") | {"busy": busy}
        tables.append(out, result)
        verdict = "poured" if result["success"] else f"FAILED: {result['failure']}"
        times = (
            f"sim {result.get('sim_time_s')} s, demo {result['demo_wall_s']} s, load"
            f" {result['load']}"
        )
        typer.echo(f"seed {seed}: {verdict}, {times}, {result.get('plans')}")


if __name__ == "__main__":
    typer.run(main)

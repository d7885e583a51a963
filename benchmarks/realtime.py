"""Whether the loop keeps its 2 ms while the whole fleet works, beside what the machine itself does
in the same minute.

Runs `roco demo --speed 1` and, at the same time, cyclictest (Debian: rt-tests), prints and appends
both: on a shared machine a late cycle says little without the lateness of a bare thread next to it.

    python benchmarks/realtime.py --seed 7 --out benchmarks/results/realtime.jsonl
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Annotated, Any

import tables
import typer
from pour_fleet import measured

# above the loop's: what the machine does, not the loop; at the loop's period
PRIORITY, INTERVAL_US = 90, 2000
FIGURES = re.compile(r"Min:\s*(\d+).*?Avg:\s*(\d+).*?Max:\s*(\d+)", re.S)


def bare(path: Path) -> subprocess.Popen[bytes]:
    """cyclictest until it is ended; its figures go to `path`."""
    program = shutil.which("cyclictest")
    if program is None:
        raise typer.BadParameter("cyclictest is not installed; on Debian: apt install rt-tests")
    command = [program, "-q", "-m", "-t1", f"-p{PRIORITY}", f"-i{INTERVAL_US}"]
    return subprocess.Popen(command, stdout=path.open("wb"), stderr=subprocess.STDOUT)


def figures(path: Path) -> dict[str, int] | None:
    """Return min, avg and max [us] of what cyclictest wrote; None where it wrote none."""
    found = FIGURES.search(path.read_text())
    return (
        dict(zip(("min", "avg", "max"), map(int, found.groups()), strict=True)) if found else None
    )


def main(
    seed: Annotated[int, typer.Option()] = 7,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path("realtime.jsonl"),
) -> None:
    """One demo in real time, with cyclictest beside it."""
    folder = Path(tempfile.mkdtemp(prefix="realtime-"))
    beside = bare(folder / "cyclictest")
    try:
        line: dict[str, Any] = measured(seed, "1", folder / "run")
    finally:
        beside.terminate()
        beside.wait(timeout=10)
    line["cyclictest_us"] = figures(folder / "cyclictest")
    tables.append(out, line)
    loop = line.get("loop", {})
    typer.echo(
        f"success {line['success']}, sim {line.get('sim_time_s')} s, plans {line.get('plans')}"
    )
    typer.echo(
        f"loop: {loop.get('missed')} of {loop.get('cycles')} cycles missed, lateness"
        f" {loop.get('lateness_us')} us"
    )
    typer.echo(f"cyclictest in the same time: {line['cyclictest_us']} us")


if __name__ == "__main__":
    typer.run(main)

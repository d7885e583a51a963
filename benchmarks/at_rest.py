"""Processor and memory of a fleet at rest, as shipped: `python benchmarks/at_rest.py [CHECKOUT …]
[--turns N]`.

Each checkout (this one without any) brings up its own fleet with its own Python, by turns, so that
the machine's load changes all of them alike. Measured are all processes of the fleet, from 90 s
after it is ready on, when what has had no work for a minute has ended: the processor's time over 30
s, and the memory, each page divided by the number of processes that share it (PSS). Rows are
appended to `results/at_rest.jsonl`.
"""

import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Annotated

import tables
import typer
from fleets import ticks, tree

SETTLE_S, MEASURED_S = 90.0, 30.0
OUT = Path(__file__).parent / "results" / "at_rest.jsonl"


def module(pid: int) -> str:
    """Return what follows -m on its command line; of a worker, its entry; else its program."""
    words = [word.decode() for word in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")]
    if "-m" not in words:
        return Path(words[0]).name
    name = words[words.index("-m") + 1]
    return words[words.index("-m") + 2].partition(":")[0] if name.endswith(".worker") else name


def pss_mb(pid: int) -> float:
    """Return its share of the memory [MB]."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024


def measure(checkout: Path) -> dict[str, object]:
    """Return the row of a fleet that is brought up for it."""
    roco = checkout / ".venv" / "bin" / "roco"
    with tempfile.TemporaryDirectory(prefix="roco-") as folder:
        run = Path(folder) / "run"
        subprocess.run(
            [roco, "up", "--out", run], cwd=folder, check=True, capture_output=True, timeout=180.0
        )
        try:
            time.sleep(SETTLE_S)
            load, pids = os.getloadavg()[0], tree(int((run / "supervisor.pid").read_text()))
            before = {pid: ticks(pid) for pid in pids}
            time.sleep(MEASURED_S)
            # a tick a second is 1 %
            spent = {pid: (ticks(pid) - before[pid]) / MEASURED_S for pid in pids}
            memory, names = {pid: pss_mb(pid) for pid in pids}, {pid: module(pid) for pid in pids}
        finally:
            subprocess.run(
                [roco, "down", "--run-dir", run],
                cwd=folder,
                check=True,
                capture_output=True,
                timeout=60.0,
            )
    parts = {names[pid]: (round(spent[pid], 1), round(memory[pid])) for pid in pids}
    whole = {"percent": round(sum(spent.values()), 1), "pss_mb": round(sum(memory.values()))}
    return {"load": round(load, 1), **whole, "processes": len(pids), "parts": parts}


def main(
    checkouts: Annotated[
        list[Path] | None, typer.Argument(help="with a .venv each; none: this one")
    ] = None,
    turns: Annotated[int, typer.Option(min=1)] = 2,
) -> None:
    """Measure by turns, print and append the rows."""
    places = [place.resolve() for place in checkouts or [Path(__file__).parents[1]]]
    for turn in range(turns):
        for place in places:
            row = {
                "commit": tables.commit(place),
                "turn": turn,
                "at": time.strftime("%Y-%m-%d %H:%M"),
                **measure(place),
            }
            tables.append(OUT, row)
            used = (
                f"{row['percent']} % of a core, {row['pss_mb']} MB in {row['processes']} processes"
            )
            print(f"{row['commit']}: {used}; load {row['load']}", flush=True)


if __name__ == "__main__":
    typer.run(main)

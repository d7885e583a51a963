"""Time and memory of the proof of a design: `python benchmarks/proof.py [FILE] [--faults
0,1,2,any]`.

Each verdict runs in a process of its own, so that its memory is its own; ROCO_PLAIN=1: by the loop
in Python. Rows are appended to results/proof.jsonl; a verdict that stands there for this commit and
file is not worked out again.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

from companion.design import FILE
from topdown.model.design import load
from topdown.prove.compiled import library
from topdown.prove.verify import tasks

RESULTS = Path(__file__).parent / "results" / "proof.jsonl"
GONE = ("ta", "ex", "pl", "km")


def main() -> None:
    """Measure what is not measured yet, then print the table."""
    options = _options()
    if options.one:
        print(json.dumps(_one(options.file, options.faults, options.one)))
        return
    known = _known(options.file.name)
    for faults in options.faults.split(","):
        for what in _names(options.file, faults):
            if (faults, what) not in known:
                print(f"{what}, {faults} faults ...", file=sys.stderr)
                command = [
                    sys.executable,
                    __file__,
                    str(options.file),
                    "--faults",
                    faults,
                    "--one",
                    what,
                ]
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                _append(json.loads(done.stdout) | {"commit": _commit(), "file": options.file.name})
    _show(options.file.name)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=FILE)
    parser.add_argument("--faults", default="0,1,2,any")
    parser.add_argument("--one", default="", help=argparse.SUPPRESS)
    return parser.parse_args()


def _tasks(file: Path, faults: str):
    design = load(file)
    gone = [name for name in GONE if name in design.agents] if faults == "0" else []
    most = None if faults == "any" else int(faults)
    return tasks(
        design, faults=most, layers=(1, 2, 3) if faults in ("0", "1") else (2, 3), gone=gone
    )


def _names(file: Path, faults: str) -> list[str]:
    return [task.what for task in _tasks(file, faults)]


def _one(file: Path, faults: str, what: str) -> dict[str, object]:
    task = next(task for task in _tasks(file, faults) if task.what == what)
    began, began_cpu = time.perf_counter(), time.process_time()
    verdict = task.run(None)
    return {
        "layer": verdict.layer,
        "what": what,
        "faults": faults,
        "states": verdict.states,
        "edges": verdict.edges,
        "seconds": round(time.perf_counter() - began, 2),
        "cpu_s": round(time.process_time() - began_cpu, 2),
        "loop": _loop(),
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        "holds": verdict.holds,
        "load": round(_load(), 1),
    }


def _loop() -> str:
    return "Python" if library() is None else "C"


def _load() -> float:
    return float(Path("/proc/loadavg").read_text().split()[0])


def _commit() -> str:
    return subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()


def _rows(file: str) -> list[dict]:
    lines = RESULTS.read_text().splitlines() if RESULTS.exists() else []
    now = {"file": file, "commit": _commit(), "loop": _loop()}
    return [row for row in map(json.loads, lines) if {**row, **now} == row]


def _known(file: str) -> set[tuple[str, str]]:
    return {(row["faults"], row["what"]) for row in _rows(file)}


def _append(row: dict) -> None:
    RESULTS.parent.mkdir(exist_ok=True)
    with RESULTS.open("a") as file:
        file.write(json.dumps(row) + "\n")


def _show(file: str) -> None:
    for row in _rows(file):
        verdict = "holds" if row["holds"] else "FAILS"
        cells = (
            row["what"],
            row["faults"],
            f"{row['states']:,}",
            f"{row['edges']:,}",
            f"{row['cpu_s']} s CPU",
            f"{row['seconds']} s",
        )
        print(
            "| "
            + " | ".join([*cells, f"{row['memory_mb']} MB", verdict, f"load {row['load']}"])
            + " |"
        )


if __name__ == "__main__":
    main()

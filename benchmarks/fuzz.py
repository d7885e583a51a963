"""A million wrong inputs into everything that reads bytes of others: no crash, no hang, memory
bounded.

The readers, the errors they may raise and how inputs are made are in tests/fuzz; CI runs a few
thousand of them. Here each row of results/fuzz.jsonl is one seed of one reader, in a process of its
own; rows that stand there are not run again, so it may be ended at any time and goes on. What
crashes is kept in tests/fuzz_corpus/READER, which CI replays. `--table` writes
docs/results/faults.md.

    nice python benchmarks/fuzz.py --inputs 1000000
"""

import hashlib
import itertools
import multiprocessing
import os
import resource
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import tables
import typer

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests/fuzz"))

from fuzzing import HANGS_S, Outcome, fuzz  # noqa: E402  (after the path is set)
from targets import TARGETS, Target  # noqa: E402

RESULTS, CORPUS = HERE / "results/fuzz.jsonl", HERE.parent / "tests/fuzz_corpus"
PAGE = HERE.parent / "docs/results/faults.md"
BEGIN, END = "<!-- fuzz: python benchmarks/fuzz.py --table -->\n", "<!-- /fuzz -->\n"
ROW = 20_000
"""Inputs of a row for a reader of weight 1: half a minute (measured at a load of 10)."""
ROOM = 2 * 1024**3
"""Bytes of address space beyond what the process has at its begin: more is refused to it
(estimate).
"""
PATIENCE_S = 3600.0  # for a row; an input that hangs in C is ended with its process


def row(target: Target, seed: int, count: int) -> dict[str, Any]:
    """Run one seed in a process of its own; its line of the results file."""
    load, began = os.getloadavg()[0], time.monotonic()
    # or the child would look for its first libraries in the folder here
    os.environ["PYTHONSAFEPATH"] = "1"
    ours, its = multiprocessing.Pipe()
    child = multiprocessing.get_context("spawn").Process(
        target=serve, args=(target.name, seed, count, its)
    )
    child.start()
    its.close()
    try:
        outcome = ours.recv() if ours.poll(PATIENCE_S) else None
    except EOFError:
        outcome = None
    child.kill()
    child.join()
    line = {"target": target.name, "seed": seed, "commit": tables.commit(), "load": round(load, 1)}
    if outcome is None:
        return line | {"inputs": 0, "crashes": [f"the process ended or hung; seed {seed}"]}
    for crash in outcome.crashes:
        keep(target.name, crash.input)
    crashes = sorted({f"{crash.where} {crash.what}" for crash in outcome.crashes})
    return line | {
        "inputs": outcome.inputs, "accepted": outcome.errors.pop("", 0),
        "errors": dict(outcome.errors),
        "slowest_ms": round(outcome.slowest_ms, 1), "slowest_bytes": len(outcome.slowest),
        "peak_mb": outcome.peak_mb,
        "grown_mb": outcome.grown_mb, "crashes": crashes,
        "seconds": round(time.monotonic() - began, 1),
    }  # fmt: skip


def serve(name: str, seed: int, count: int, out: Any) -> None:
    """Fuzz in this process, which may not grow without bound."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + ROOM, size + ROOM))
    found: Outcome = fuzz(next(one for one in TARGETS if one.name == name), seed, count)
    out.send(found)


def keep(name: str, data: bytes) -> None:
    """Keep an input that crashed, for CI."""
    folder = CORPUS / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / hashlib.sha256(data).hexdigest()[:12]).write_bytes(data)


def counts(inputs: int) -> dict[str, int]:
    """Return how many of all inputs each reader gets."""
    whole = sum(target.weight for target in TARGETS)
    return {target.name: round(inputs * target.weight / whole) for target in TARGETS}


def fresh(name: str, known: dict[tuple[str, int], int]) -> int:
    """Return the least seed of a reader that has no row."""
    return next(seed for seed in itertools.count() if (name, seed) not in known)


def printed(lines: list[dict[str, Any]]) -> str:
    """Return the table: one row for each reader."""
    total, crashes = (
        sum(line["inputs"] for line in lines),
        sum(len(line["crashes"]) for line in lines),
    )
    loads = [line["load"] for line in lines]
    rows = [
        (
            f"{total:,} inputs, {crashes} crashes or hangs; 2 cores, other work beside it "
            f"(load {min(loads):g} to {max(loads):g})."
        ),
        "",
        (
            "| reader | inputs | accepted | refused in words, as | slowest, of processor | memory"
            " grew by |"
        ),
        "|---|---|---|---|---|---|",
    ]
    for target in TARGETS:
        mine = [line for line in lines if line["target"] == target.name and line["inputs"]]
        if not mine:
            continue
        inputs, accepted = sum(one["inputs"] for one in mine), sum(one["accepted"] for one in mine)
        errors = sorted({name for one in mine for name in one["errors"]})
        slowest, grown = (
            max(one["slowest_ms"] for one in mine),
            max(one["grown_mb"] for one in mine),
        )
        words = ", ".join(f"`{name}`" for name in errors) or target.answers
        rows.append(
            f"| {target.text} | {inputs:,} | {accepted / inputs:.0%} | {words} | {slowest:.0f} ms |"
            f" {grown:g} MB |"
        )
    return "\n".join(rows) + "\n"


def main(
    inputs: Annotated[int, typer.Option(help="of all readers together")] = 1_000_000,
    only: Annotated[
        str, typer.Option(help="readers, by comma: " + ", ".join(one.name for one in TARGETS))
    ] = "",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[
        bool, typer.Option("--table", help="write the table into docs/results/faults.md, and end")
    ] = False,
) -> None:
    """Run what does not stand in the results file yet, a row of each reader by turns."""
    lines = tables.read(out)
    if table:
        tables.put(PAGE, BEGIN, printed(lines), END)
        return
    wanted = {
        name: count for name, count in counts(inputs).items() if not only or name in only.split(",")
    }
    known = {(line["target"], line["seed"]): line["inputs"] for line in lines}
    done = {name: sum(count for (one, _), count in known.items() if one == name) for name in wanted}
    while any(done[name] < wanted[name] for name in wanted):
        for target in TARGETS:
            left = wanted.get(target.name, 0) - done.get(target.name, 0)
            if left <= 0:
                continue
            line = row(
                target, fresh(target.name, known), min(left, max(500, int(ROW * target.weight)))
            )
            tables.append(out, line)
            known[target.name, line["seed"]] = line["inputs"]
            done[target.name] += line["inputs"] or left
            typer.echo(
                f"{target.name} {line['seed']}: {line['inputs']} inputs,"
                f" {line['crashes'] or 'no crash'}"
            )
    typer.echo(f"an input that takes longer than {HANGS_S:g} s counts as a hang")


if __name__ == "__main__":
    typer.run(main)

"""Twenty commands for two robots that bid for them: their makespan, that of one robot, and that of
the best offline assignment.

A fleet for each robot at full speed, sight by rays, and the dispatcher of examples/dispatch before
them. All orders are there at the start. An order's duration is what its robot's simulated clock
went on from the award to the end; the clock stands while the robot does, so it does not matter that
two fleets share the processors. A robot's time is the sum over its orders, the makespan the longer
one. The best assignment is over all ways to part the same durations among two robots. Planning and
bidding are not in it: wall times have them. It takes up where its results file ends.

    python benchmarks/dispatch.py --seeds 1-3
    python benchmarks/dispatch.py --table
"""

import itertools
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import tables
import typer

from companion.run_files import SLOTS_FILE
from console.fleet import starting
from services.executor.loop.link import AgentLink
from velma.errors import SlotError
from velma.sim.truth import Truth

RESULTS = Path(__file__).parent / "results/dispatch.jsonl"
PAGE = Path(__file__).parent / "README.md"
BEGIN, END = "<!-- dispatch: python benchmarks/dispatch.py --table -->\n", "<!-- /dispatch -->\n"
EXAMPLE = Path(__file__).parents[1] / "examples/dispatch"
RUN = tables.commit()
ROBOTS = {"b1": "velma1", "b2": "velma2"}
UP_S, ALL_S, READ_S, PERIOD_S = 180.0, 3600.0, 20.0, 0.02
"""Wall: the start of a fleet, all orders, a reading of the clock (estimates); between two looks."""


def command(kind: str, **fields: str) -> dict[str, str]:
    """A command as the file of orders has it."""
    return {"type": kind, **fields}


MIX = (
    *itertools.repeat(command("LookAround"), 5),
    *itertools.repeat(command("Bring", object="jar"), 3),
    *itertools.repeat(command("Bring", object="bowl"), 3),
    *itertools.repeat(command("PutDown", object="jar"), 3),
    *itertools.repeat(command("PutDown", object="bowl"), 3),
    *itertools.repeat(command("ClearTable"), 2),
    command("PourInto", source="jar", destination="bowl"),
)
"""Twenty commands, shuffled by the seed; each can be given in any state of the hands."""


class Clock:
    """The simulated clock of a robot."""

    def __init__(self, run: Path) -> None:
        self._file, self._link = run / SLOTS_FILE, None

    def read(self) -> float:
        """In s; it goes on while something moves."""
        until = time.monotonic() + READ_S
        while True:
            with suppress(SlotError, OSError):
                if self._link is None or self._link.file.replaced:
                    self._link: AgentLink | None = AgentLink(self._file)
                if sealed := self._link.sealed_truth():
                    return msgspec.msgpack.decode(sealed, type=Truth).time_s
            if time.monotonic() > until:
                raise TimeoutError(f"the loop of {self._file.parent.name} says nothing")
            time.sleep(PERIOD_S)


@contextmanager
def fleet(run: Path, seed: int) -> Iterator[Clock]:
    """A robot that is up."""
    words = ["up", "--out", str(run), "--speed", "max", "--seed", str(seed)]
    roco = [sys.executable, "-P", "-m", "console"]
    told = os.environ | {"ROCO_EYES": "rays", "ROCO_VIEW": "off"}
    subprocess.run([*roco, *words], check=True, capture_output=True, timeout=UP_S, env=told)
    try:
        yield Clock(run)
    finally:
        starting.down(run)


@contextmanager
def dispatcher(base: Path, orders: list[dict[str, str]]) -> Iterator[Path]:
    """The dispatcher; its log."""
    scene, run = base / "dispatch.toml", base / "dispatch"
    run.mkdir()
    robots = "".join(f'{name} = "{name}"\n' for name in ROBOTS.values())
    tasks = (", ".join(f'{field} = "{value}"' for field, value in one.items()) for one in orders)
    listed = "".join(f"[[order]]\ntask = {{ {one} }}\n" for one in tasks)
    scene.write_text(f"[robots]\n{robots}\n{listed}")
    words = ["--run-dir", str(run), "--scene", str(scene)]
    with (base / "out").open("wb") as out:
        found = os.environ | {"PYTHONPATH": str(EXAMPLE)}
        command = [sys.executable, "-P", "-m", "dispatch", *words]
        process = subprocess.Popen(command, cwd=EXAMPLE, env=found, stdout=out, stderr=out)
    try:
        yield run / "logs/di.jsonl"
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(UP_S)


def lines(log: Path, seen: int) -> list[dict[str, Any]]:
    """Whole lines of a log behind the first `seen`."""
    text = log.read_bytes() if log.exists() else b""
    return [json.loads(one) for one in text[: text.rfind(b"\n") + 1].splitlines()[seen:]]


def measured(seed: int, robots: int, base: Path) -> dict[str, Any]:
    """One run, as a line of the results file."""
    orders = list(MIX)
    random.Random(seed).shuffle(orders)
    found: dict[str, Any] = {"seed": seed, "robots": robots, "commit": RUN}
    found["load"] = round(os.getloadavg()[0], 1)
    done: list[dict[str, Any]] = []
    ends, seen, begun = 0, 0, dict[str, tuple[int, float, float, float]]()
    with ExitStack() as stack:
        clocks = {
            bidder: stack.enter_context(fleet(base / ROBOTS[bidder], seed + number))
            for number, bidder in enumerate(itertools.islice(ROBOTS, robots))
        }
        log = stack.enter_context(dispatcher(base, orders))
        until = time.monotonic() + ALL_S
        first = 0.0
        while ends < len(orders):
            if time.monotonic() > until:
                raise TimeoutError(f"{ends} of {len(orders)} orders ended in {ALL_S:g} s")
            for line in lines(log, seen):
                seen += 1
                robot, event = line.get("robot", ""), line["event"]
                if event == "awarded":
                    first = first or line["t"]
                    begun[robot] = (line["order"], clocks[robot].read(), line["t"], line["rest"])
                elif event in ("done", "not done") and robot in begun:
                    number, clock, at, rest = begun.pop(robot)
                    one = {"order": number, "robot": robot, "good": event == "done", "rest": rest}
                    one |= {"type": orders[number - 1]["type"]}
                    one |= {"sim_s": round(clocks[robot].read() - clock, 2)}
                    done.append(one | {"wall_s": round(line["t"] - at, 2)})
                    found["wall_s"] = round(line["t"] - first, 1)
                    typer.echo(f"  {done[-1]}")
                ends += event in ("done", "given up")
            time.sleep(PERIOD_S)
    return found | {"orders": done}


def makespan(line: dict[str, Any]) -> float:
    """The longest time of a robot [s, simulated]."""
    times = dict.fromkeys(ROBOTS, 0.0)
    for one in line["orders"]:
        times[one["robot"]] += one["sim_s"]
    return max(times.values())


def best(durations: list[float]) -> float:
    """The makespan of the best of all assignments to two robots; release times are 0."""
    sums = np.zeros(1)
    for duration in durations:
        sums = np.concatenate((sums, sums + duration))
    total = sum(durations)
    return float(np.min(np.maximum(sums, total - sums)))


def printed() -> str:
    """The table of all seeds that have both runs."""
    rows = [
        "| seed | one robot: robot time, wall | two: makespan, wall | best assignment"
        " | two over best | one over two | done by each | failed and done by the other |\n",
        "|---|---|---|---|---|---|---|---|\n",
    ]
    found = {(one["seed"], one["robots"]): one for one in tables.read(RESULTS)}
    for seed in sorted({seed for seed, _ in found}):
        alone, both = found.get((seed, 1)), found.get((seed, 2))
        if alone is None or both is None:
            continue
        one_s, two_s = makespan(alone), makespan(both)
        good = [one for one in both["orders"] if one["good"]]
        best_s = best([one["sim_s"] for one in both["orders"]])
        each = " and ".join(str(sum(one["robot"] == robot for one in good)) for robot in ROBOTS)
        walls = [f"{one['wall_s']:.0f} s" for one in (alone, both)]
        rows.append(
            f"| {seed} | {one_s:.0f} s, {walls[0]} | {two_s:.0f} s, {walls[1]}"
            f" | {best_s:.0f} s | {two_s / best_s:.2f} | {one_s / two_s:.2f} | {each}"
            f" | {len(both['orders']) - len(good)} |\n"
        )
    return "".join(rows)


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-3",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[
        bool, typer.Option("--table", help="write the table into benchmarks/README.md, and end")
    ] = False,
) -> None:
    """Run the seeds that do not stand in the results file yet."""
    if table:
        tables.put(PAGE, BEGIN, printed(), END)
        return
    known = {(line["seed"], line["robots"]) for line in tables.read(out)}
    for seed in tables.seeds(seeds):
        for robots in (2, 1):
            if (seed, robots) in known:
                continue
            base = Path(tempfile.mkdtemp(prefix=f"dispatch-{seed}-{robots}-"))
            line = measured(seed, robots, base)
            tables.append(out, line)
            typer.echo(
                f"seed {seed}, {robots} robots: {makespan(line):.1f} s, wall {line['wall_s']} s"
            )


if __name__ == "__main__":
    typer.run(main)

"""Start-up of the fleet, and the first plan after it.

    python benchmarks/startup.py moves [--seed N] [--speed 1] [--insecure] [--keep DIR]
    python benchmarks/startup.py plans [CHECKOUT …] [--scenes canonical,env2] [--seeds 1-3]
    python benchmarks/startup.py table

`moves`: seconds from the start of the supervisor until each process is ready, and until head and
arm move. The script says the sentence as soon as the fleet is ready. The arm moves when a measured
joint has changed by more than `MOVED` since the sentence. For the head, the first such change
counts, because the survey may begin before the sentence.

`plans`: what a person waits for the first plan after `roco up`, by turns for each checkout (this
one without any; each with a .venv), beside a loop in Python alone, with which machines can be
compared. Rows are appended to `results/first_plan.jsonl`. pl's own part is a plan without its waits
for km, which answers once the robot has looked around. `table` puts the rows into README.md.
"""

import http.client
import os
import statistics
import subprocess
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import tables
import typer

from agent_runtime.io.options import Options
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.tap import Sample, open_tap
from companion.run_files import HI_FILE
from companion.telemetry import RobotState, decoded
from companion.tools.verbs.hi import Hi, address
from companion.tools.verbs.pour_run import SENTENCE
from console.fleet import starting
from console.fleet.local import Local
from console.runs import folders
from operate.fleet_file import ProcessState

# [rad], above what the body sways at rest (1 mrad) and what gravity pulls at the start
MOVED = 0.02
LIMIT_S = 120.0
HERE = Path(__file__).parent
OUT = HERE / "results" / "first_plan.jsonl"
SCENES = "canonical,env2,doors,box,no_jar,jar_out_of_reach"
# rounds of the loop in Python alone, which takes about half a second on a quick machine (estimate)
LOOP = 10_000_000
PAGE, BEGIN, END = HERE / "README.md", "<!-- startup.py plans -->\n", "<!-- /startup.py plans -->"
app = typer.Typer()


class Motion:
    """First movements of head and arms, as seconds since `began`."""

    def __init__(self, began: float) -> None:
        self.began = began
        self.first: RobotState | None = None
        self.moved: dict[str, float] = {}
        self.shown_at = 0.0

    def heard(self, sample: Sample) -> None:
        """Take in what ex shows."""
        if not sample.key.endswith("/_/telemetry/ex"):
            return
        state = decoded(sample.data)
        if not isinstance(state, RobotState):
            return
        if self.first is None:
            self.first, self.shown_at = state, sample.at - self.began
        for name in ("head", "body"):
            far = np.abs(np.subtract(getattr(state, name), getattr(self.first, name))).max()
            if far > MOVED:
                self.moved.setdefault(name, sample.at - self.began)


@app.command()
def moves(
    seed: Annotated[int, typer.Option()] = 1,
    speed: Annotated[str, typer.Option()] = "1",
    insecure: Annotated[
        bool, typer.Option("--insecure", help="without TLS, keys and rights")
    ] = False,
    keep: Annotated[
        Path | None, typer.Option(help="the run folder; default: a temporary one")
    ] = None,
) -> None:
    """Measure one start."""
    with tempfile.TemporaryDirectory() as scratch:
        run = keep or Path(scratch) / "run"
        began = time.time()
        supervisor = starting.start(
            run, ["--speed", speed, "--seed", str(seed), *(["--insecure"] if insecure else [])]
        )
        motion, ready = Motion(began), dict[str, float]()
        tap = None
        try:
            while time.time() - began < LIMIT_S and "body" not in motion.moved:
                now, told = time.time() - began, folders.fleet(run)
                for status in told.processes if told else ():
                    if status.state is ProcessState.READY:
                        ready.setdefault(status.name, now)
                if tap is None and told is not None and "router" in ready:
                    options = Options(
                        connect=told.connect, keys=None if insecure else run / KEYS_FOLDER
                    )
                    tap = open_tap(options, motion.heard, lambda: False)
                if (
                    told
                    and "all" not in ready
                    and all(s.name in ready or s.optional for s in told.processes)
                ):
                    ready["all"] = now
                    Hi(address(Local(run))).say(SENTENCE)
                    ready["said"] = time.time() - began
                time.sleep(0.02)
        finally:
            for name, at in ready.items():
                print(f"{at:6.2f} s  {name} {'ready' if name != 'said' else ''}")
            for name, at in motion.moved.items():
                print(f"{at:6.2f} s  {name} moves")
            if tap is not None:
                tap.close()
            starting.down(run)
            supervisor.wait(timeout=90.0)


def reference() -> float:
    """Return the seconds of the loop in Python alone."""
    began, total = time.perf_counter(), 0
    for k in range(LOOP):
        total += k & 7
    return time.perf_counter() - began


def roco(checkout: Path, *words: str) -> None:
    """Run a verb of a checkout, by its own code."""
    python, program = checkout / ".venv/bin/python", checkout / ".venv/bin/roco"
    environment = os.environ | {"PYTHONPATH": f"{checkout}{os.pathsep}{checkout / 'shared'}"}
    command = [str(python), "-P", str(program), *words]
    subprocess.run(
        command, cwd=checkout, env=environment, check=True, capture_output=True, timeout=2 * LIMIT_S
    )


def planned(run: Path, told: dict[str, Any]) -> bool:
    """Whether the newest task of a fleet, of any version, has left the planner."""
    connection = http.client.HTTPConnection("127.0.0.1", told["port"], timeout=10.0)
    connection.request("GET", "/tasks", headers={"Authorization": f"Bearer {told['token']}"})
    tasks = msgspec.json.decode(connection.getresponse().read())["tasks"]
    connection.close()
    return bool(tasks) and tasks[-1]["state"] not in ("", "waiting", "planning", "sent")


def first_plan(checkout: Path, scene: str, seed: int) -> dict[str, object]:
    """Return the row of a fleet that is brought up for it."""
    with tempfile.TemporaryDirectory(prefix="roco-") as folder:
        run, file = Path(folder) / "run", checkout / f"velma/model/scenes/{scene}.toml"
        roco(checkout, "up", "--out", str(run), "--seed", str(seed), "--scene", str(file))
        try:
            load, loop_s = os.getloadavg()[0], reference()
            roco(checkout, "say", SENTENCE, "--run-dir", str(run))
            told, until = (
                msgspec.json.decode((run / HI_FILE).read_bytes()),
                time.monotonic() + 3 * LIMIT_S,
            )
            while not planned(run, told) and time.monotonic() < until:
                time.sleep(0.1)
        finally:
            roco(checkout, "down", "--run-dir", str(run))
        plan = msgspec.json.decode((run / "report.json").read_bytes())["plans"][0]
    kept = {name: plan[name] for name in ("wall_s", "km_s", "queries", "outcome", "expected_s")}
    return {
        "scene": scene,
        "seed": seed,
        "load": round(load, 1),
        "loop_s": round(loop_s, 3),
        **kept,
    }


@app.command()
def plans(
    checkouts: Annotated[
        list[Path] | None, typer.Argument(help="with a .venv each; none: this one")
    ] = None,
    scenes: Annotated[str, typer.Option(help="names of shipped scenes, with commas")] = SCENES,
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-3",
) -> None:
    """Measure first plans by turns, print and append the rows."""
    places = [place.resolve() for place in checkouts or [HERE.parent]]
    for seed in tables.seeds(seeds):
        for scene in scenes.split(","):
            for place in places:
                at = time.strftime("%Y-%m-%d %H:%M")
                row = {"commit": tables.commit(place), "at": at, **first_plan(place, scene, seed)}
                tables.append(OUT, row)
                print(f"{row['commit']} {scene} {seed}: {row['wall_s']:.2f} s, {row}", flush=True)


@app.command()
def table() -> None:
    """Put the medians into README.md: seconds of a plan, and the same with the loop in Python as
    unit.
    """
    found: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for row in tables.read(OUT):
        found[row["scene"], row["commit"]].append(row)
    lines = [
        "| scene | version | plans | load | plan [s]: median, most | loop in Python = 1: median,"
        " most | of it pl's own [s] | questions |"
    ]
    lines.append("|---|---|---|---|---|---|---|---|")
    for (scene, commit), rows in sorted(found.items()):
        waited = [row["wall_s"] for row in rows]
        ratios = [row["wall_s"] / row["loop_s"] for row in rows]
        load = f"{min(row['load'] for row in rows)}-{max(row['load'] for row in rows)}"
        seconds = f"{statistics.median(waited):.2f}, {max(waited):.2f}"
        units = f"{statistics.median(ratios):.2f}, {max(ratios):.2f}"
        own = [row["wall_s"] - row["km_s"] for row in rows]
        mine = f"{statistics.median(own):.2f}, {max(own):.2f}"
        asked = f"{statistics.median(row['queries'] for row in rows):g}"
        lines.append(
            f"| {scene} | {commit} | {len(rows)} | {load} | {seconds} | {units} | {mine} |"
            f" {asked} |"
        )
    tables.put(PAGE, BEGIN, "\n".join(lines) + "\n", END)


if __name__ == "__main__":
    app()

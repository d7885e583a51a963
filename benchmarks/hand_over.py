"""Hands the jar over in one process, as pour_one_process pours: to somebody who pulls, who only
knocks, to nobody.

Person x seed, in a scene. The person is a force on the jar in the simulated world, of random size,
direction and time; the robot is not told. Each run appends a line to a results file; runs that the
file has are skipped.

    python benchmarks/hand_over.py --seeds 1-20
    python benchmarks/hand_over.py --seeds 3 --persons pulls --scenes env2 --verbose
    python benchmarks/hand_over.py --table

`good`: handed over to whom pulled, told so, with all content in the jar; put down upright, and told
so, where nobody pulled. `drop`: the jar fell, or lies.
"""

import math
import time
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tables
import typer
from disturbed import Body, crowded
from pour_one_process import Run

from companion.languages import hfsm, rc
from companion.sentences import operator
from companion.skills.loop_messages import Motion, Until
from companion.tasks.hand_over.done import HandOver
from services.task.outgoing_messages import SURVEY
from velma.model.scene import CANONICAL, Scene, load, vary
from velma.sim.disturbances import Disturbance, Kind, Of
from velma.sim.disturbed_world import ASIDE
from velma.sim.mujoco_backend import MujocoBackend

RESULTS = Path(__file__).parent / "results/hand_over.jsonl"
RUN = tables.commit()
JAR = "jar_1"
PULL_N, KNOCK_N = (8.0, 12.0), (10.0, 25.0)
PULLS_S, KNOCKS_S = (1.0, 10.0), (1.0, 25.0)  # after it is held out
ASKEW = math.radians(30.0)  # of a pull from the way away from the robot (estimate)
FLOOR_M, UPRIGHT_DEG, LEAST = 0.3, 10.0, 0.9
PERSONS = ("pulls", "knocks", "nobody")
TASK = hfsm.Task("hand_over", ("jar",))


class Handing(Run):
    """A run with a person."""

    def __init__(self, scene: Scene, seed: int, person: str, verbose: bool) -> None:
        super().__init__(scene, seed, verbose, backend=MujocoBackend(scene, crowded(scene)))
        self.body: Body = Body(self.body.core, self.body.eye, self._watch)
        self.person, self.rng = person, np.random.default_rng([seed, *person.encode()])
        self.came = False
        self.going_on: tuple[Disturbance, ...] = ()
        self.outcomes: list[rc.Done | rc.NotDone] = []

    def act(self, command: rc.Command) -> rc.Done | rc.NotDone:
        """Perform a command, and keep the outcome of a hand-over."""
        outcome = super().act(command)
        if isinstance(command, HandOver):
            self.outcomes.append(outcome)
        return outcome

    def _watch(self, motion: Motion) -> None:
        if motion.until is not Until.PULL or self.came:
            return
        self.came = True
        if self.person == "pulls":
            force = self._force(self.rng.uniform(*PULL_N), self.rng.uniform(-ASKEW, ASKEW))
            self.body.after(self.rng.uniform(*PULLS_S), lambda: self._begin(Kind.PULLED, force))
        elif self.person == "knocks":
            for at in sorted(self.rng.uniform(*KNOCKS_S, size=3)):
                force = self._force(self.rng.uniform(*KNOCK_N), self.rng.uniform(-math.pi, math.pi))
                self.body.after(at, lambda force=force: self._begin(Kind.KNOCKED, force))

    def _force(self, size: float, askew: float) -> tuple[float, float, float]:
        x, y, _ = self.truth.pose(JAR)[1]
        around = math.atan2(y, x) + askew
        return size * math.cos(around), size * math.sin(around), 0.0

    def _begin(self, kind: Kind, force: tuple[float, float, float]) -> None:
        self.going_on = (
            *self.going_on,
            Disturbance(f"{len(self.going_on)}", Of.THING, kind, JAR, force),
        )
        self.backend.disturb(self.going_on)


def measured(name: str, person: str, seed: int, verbose: bool) -> dict[str, Any]:
    """Return the line of one run."""
    began = time.perf_counter()
    run = Handing(vary(load(CANONICAL.with_stem(name)), seed), seed, person, verbose)
    try:
        run.act(SURVEY)
        failure = operator(run.carry_out(TASK))
        run.body.rest(2.0)
    finally:
        run.body.eye.close()
    truth = run.truth.read()
    x, _, z = truth.at[JAR]
    given = x < ASIDE[0] + 0.5
    full = truth.grains_in.get(JAR, 0) >= LEAST * truth.grains
    stands = (
        z > FLOOR_M
        and truth.tilt_deg[JAR] < UPRIGHT_DEG
        and not any(truth.fingers_on.get(JAR, {}).values())
    )
    drop = not given and (z <= FLOOR_M or truth.tilt_deg[JAR] >= 45.0)
    wanted = given and not failure if person == "pulls" else stands and bool(failure)
    evidence = [
        [str(one.claim), [str(by) for by in one.by]] for one in run.evidence if one.of == JAR
    ]
    ended = [
        type(one).__name__ if isinstance(one, rc.Done) else f"{one.kind}: {operator(one.why)}"
        for one in run.outcomes
    ]
    return {
        "scene": name, "person": person, "seed": seed, "good": bool(wanted and full and run.came),
        "drop": drop,
        "given": given, "failure": failure, "hand_over": ended, "evidence": evidence,
        "came": run.came,
        "content": round(truth.grains_in.get(JAR, 0) / max(1, truth.grains), 3),
        "sim_time_s": round(run.here.time, 1),
        "wall_s": round(time.perf_counter() - began, 1), "plans": run.plans, "acts": run.acts,
        "commit": RUN,
    }  # fmt: skip


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-20",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    scenes: Annotated[str, typer.Option(help="of velma/model/scenes")] = "canonical",
    persons: Annotated[str, typer.Option(help="what the person does")] = ",".join(PERSONS),
    verbose: Annotated[bool, typer.Option()] = False,
    table: Annotated[bool, typer.Option("--table", help="print what there is, and end")] = False,
) -> None:
    """Run what does not stand in the results file yet."""
    lines = {(line["scene"], line["person"], line["seed"]): line for line in tables.read(out)}
    if table:
        for (scene, person), count in sorted(
            Counter((scene, person) for scene, person, _ in lines).items()
        ):
            of = [line for (s, p, _), line in lines.items() if (s, p) == (scene, person)]
            good, drops = sum(one["good"] for one in of), sum(one["drop"] for one in of)
            typer.echo(f"{scene}, {person}: {good} of {count} good, {drops} drops")
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    for seed in tables.seeds(seeds):
        for scene in scenes.split(","):
            for person in persons.split(","):
                if (scene, person, seed) in lines:
                    continue
                line = measured(scene, person, seed, verbose)
                tables.append(out, line)
                typer.echo(
                    " ".join(
                        f"{key} {value}"
                        for key, value in line.items()
                        if key not in ("acts", "plans")
                    )
                )


if __name__ == "__main__":
    typer.run(main)

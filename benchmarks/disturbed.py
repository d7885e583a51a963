"""Pours while somebody moves things, and compares the words of the robot with the truth.

The pour is that of pour_one_process.

`pushed`: jar or bowl is shifted by 5 cm while the robot reaches for it, or the bowl on the table before the tilt.
`knocked`: the jar is struck out of the hand (its fingers lose their friction for 1.5 s) while it is carried.
`obstructed`: a box is put where the bowl is going to be put down. `removed`: a thing is taken away, out of sight.
Appends a line per run to a results file and skips runs that stand there; the table has the newest of each case and
seed.

    python benchmarks/disturbed.py --seeds 1-10
    python benchmarks/disturbed.py --table
"""

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
import mujoco
import numpy as np
import tables
import typer
from pour_one_process import Run

from companion.languages import rc
from velma.model.grains import grain_name
from velma.model.kinds import Model
from velma.model.scene import Thing, load, vary

RESULTS = Path(__file__).parent / "results/disturbed.jsonl"
PAGE = Path(__file__).parents[1] / "docs/eyes.md"
BEGIN, END = "<!-- disturbed: python benchmarks/disturbed.py --table -->\n", "<!-- /disturbed -->\n"
PUSH_M, KNOCK_S = 0.05, 1.5  # as far as a passing arm pushes (estimate); as in tests/fleet/test_lost.py
JAR, BOWL, BOX = "jar_1", "bowl_1", "box_1"
RUN = tables.commit()
ASIDE = (-2.0, 2.0, 0.056)  # on the floor, where nobody looks or reaches
LEAST = 0.9  # of the content, that a pour moves, as the report demands


class Disturbed(Run):
    """A run in which one thing happens just before the first act that `when` accepts."""

    def __init__(self, seed: int, when: Callable[[rc.Act], bool], what: Callable[["Disturbed", rc.Act], None]) -> None:
        scene = vary(load(), seed)
        box = Thing(BOX, Model.BOX1, ASIDE)
        super().__init__(msgspec.structs.replace(scene, things=(*scene.things, box)), seed)
        self.when, self.what, self.happened = when, what, False
        self.rng = np.random.default_rng(seed)

    def act(self, command: rc.Act) -> rc.Done | rc.NotDone:
        """Perform a command; before it, let it happen."""
        if not self.happened and self.when(command):
            self.happened = True
            self.what(self, command)
        return super().act(command)

    def move(self, name: str, xyz: np.ndarray) -> None:
        """Put the origin of a thing at `xyz` (3,) [m, world], the jar with its grains."""
        model, data = self.backend.model, self.backend.data
        shift = xyz - data.body(name).xpos
        grains = range(self.truth.read().grains if name == JAR else 0)
        for body in (name, *map(grain_name, grains)):
            data.qpos[model.jnt_qposadr[model.body(body).jntadr[0]] + np.arange(3)] += shift
        data.qvel[model.jnt_dofadr[model.body(name).jntadr[0]] + np.arange(6)] = 0.0
        mujoco.mj_step1(model, data)


def pushed(name: str) -> Callable[[Disturbed, rc.Act], None]:
    """Return the shift of a thing to the left or right, as the cabinet stands."""

    def push(run: Disturbed, _: rc.Act) -> None:
        rotation, _at = run.truth.pose("cabinet_2")
        _, at = run.truth.pose(name)
        run.move(name, at + run.rng.choice([-1.0, 1.0]) * PUSH_M * rotation[:, 1])

    return push


def pushed_anywhere(run: Disturbed, _: rc.Act) -> None:
    """Shift the bowl on the table in any direction."""
    around, (_, at) = run.rng.uniform(0.0, math.tau), run.truth.pose(BOWL)
    run.move(BOWL, at + PUSH_M * np.array([math.cos(around), math.sin(around), 0.0]))


def knocked(run: Disturbed, _: rc.Act) -> None:
    """Take the hands' friction away for a while."""
    model, cycle, begun = run.backend.model, run.body.core.cycle, run.body.core.state.time
    hands = [g for g in range(model.ngeom) if "_Hand" in model.body(model.geom_bodyid[g]).name]
    before = model.geom_friction[hands].copy()
    model.geom_friction[hands] = 0.0

    def until() -> None:
        cycle()
        if run.body.core.state.time - begun > KNOCK_S:
            model.geom_friction[hands] = before

    run.body.core.cycle = until  # type: ignore[method-assign]


def obstructed(run: Disturbed, command: rc.Act) -> None:
    """Put the box where the bowl is to stand."""
    assert isinstance(command, rc.Release)
    assert command.place is not None
    x, y, z = command.place.xyz
    run.move(BOX, np.array([x, y, z + 0.056]))


def removed(name: str) -> Callable[[Disturbed, rc.Act], None]:
    """Return the removal of a thing to the floor behind the robot."""

    def remove(run: Disturbed, _: rc.Act) -> None:
        run.move(name, np.array([*ASIDE[:2], 0.001 if name == BOWL else 0.101]))

    return remove


def _grasp(name: str) -> Callable[[rc.Act], bool]:
    return lambda command: isinstance(command, rc.Grasp) and command.object == name


def _carry(command: rc.Act) -> bool:
    return isinstance(command, rc.MoveJoint) and "/2." in command.key


def _pour(command: rc.Act) -> bool:
    return isinstance(command, rc.Pour)


def _over_the_bowl(command: rc.Act) -> bool:
    return isinstance(command, rc.MoveJoint) and command.key.startswith("plan-2/")


def _put(command: rc.Act) -> bool:
    return isinstance(command, rc.Release) and command.object == BOWL


def _look_at_bowl(command: rc.Act) -> bool:
    return isinstance(command, rc.Look) and len(command.at) == 1


CASES: dict[str, tuple[Callable[[rc.Act], bool], Callable[[Disturbed, rc.Act], None]]] = {
    "jar pushed": (_grasp(JAR), pushed(JAR)),
    "bowl pushed": (_grasp(BOWL), pushed(BOWL)),
    "bowl pushed before the tilt": (_pour, pushed_anywhere),
    "jar knocked out of the hand": (_carry, knocked),
    "box on the bowl's place": (_put, obstructed),
    "bowl removed from the table": (_look_at_bowl, removed(BOWL)),
    "bowl removed while the jar is brought": (_over_the_bowl, removed(BOWL)),
    "jar removed from the cabinet": (_grasp(JAR), removed(JAR)),
}


def measured(case: str, seed: int) -> dict[str, Any]:
    """Return one run, as a line of the results file."""
    began, run = time.perf_counter(), Disturbed(seed, *CASES[case])
    try:
        said = run.pour()
    finally:
        run.body.eye.close()
    truth = run.truth.read()
    return {
        "case": case, "seed": seed, "happened": run.happened, "said": said or "done",
        "poured": round(truth.grains_in[BOWL] / truth.grains, 3), "upright": truth.tilt_deg[BOWL] < 10.0,
        "sim_time_s": round(run.here.time, 1), "wall_s": round(time.perf_counter() - began, 1),
        "commit": RUN,
    }  # fmt: skip


def ending(line: dict[str, Any]) -> str:
    """Return how a run ended, by what was said and what is true."""
    poured = line["poured"] >= LEAST and line["upright"]
    if line["said"] == "done":
        return "done" if poured else "FALSE SUCCESS"
    return "poured, said otherwise" if poured else "refused or failed"


def printed(lines: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the table, and below it the words of all that was not done."""
    kinds = ("done", "refused or failed", "poured, said otherwise", "FALSE SUCCESS")
    yield f"| what happens | runs | {' | '.join(kinds)} |"
    yield "|---" * (len(kinds) + 2) + "|"
    for case in CASES:
        ran = [line for line in lines if line["case"] == case and line["happened"]]
        if ran:
            counts = (sum(ending(line) == kind for line in ran) for kind in kinds)
            yield f"| {case} | {len(ran)} | {' | '.join(map(str, counts))} |"
    yield ""
    seeds: dict[str, list[int]] = {}
    for line in lines:
        if line["happened"] and ending(line) != "done":
            words = f"{ending(line)}, {100 * line['poured']:.0f} % in the bowl: {line['said']}"
            seeds.setdefault(f"{line['case']}: {words}", []).append(line["seed"])
    for words, of in seeds.items():
        yield f"- {words} (seed {', '.join(map(str, of))})"


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-10",
    cases: Annotated[str, typer.Option(help=", ".join(CASES))] = ",".join(CASES),
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    table: Annotated[bool, typer.Option("--table", help="write the table into docs/eyes.md, and end")] = False,
) -> None:
    """Run what does not stand in the results file yet."""
    lines = list({(line["case"], line["seed"]): line for line in tables.read(out)}.values())
    if table:
        tables.put(PAGE, BEGIN, "\n".join(printed(lines)) + "\n", END)
        return
    known = {(line["case"], line["seed"]) for line in lines}
    for seed in tables.seeds(seeds):
        for case in cases.split(","):
            if (case, seed) not in known:
                line = measured(case, seed)
                tables.append(out, line)
                typer.echo(f"{case}, seed {seed}: {ending(line)}: {line['said']} ({line['wall_s']} s)")


if __name__ == "__main__":
    typer.run(main)

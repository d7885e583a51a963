"""The whole pouring task in one process and without agents: how often, how long, and why not.

km's store, pl's search, the plan's state machine, ex's skills, the loop and the physics are the
product's own; only the communicates between them are left out. Appends one line per seed to a
results file and skips seeds that the file has. --again runs a seed once more if another version ran
it. The table has the newest run of each seed.

    out=benchmarks/results/pour_one_process.jsonl
    python benchmarks/pour_one_process.py --seeds 1-20 --out $out
    python benchmarks/pour_one_process.py --scene env2 --seeds 1-20 --out $out
    python benchmarks/pour_one_process.py --eyes rays --noise height=0.01,spin=true --seeds 1-20 \\
        --out …
    python benchmarks/pour_one_process.py --out $out --table
"""

import math
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
import tables
import typer
from msgspec.structs import asdict, replace

from companion.acts import ACTS
from companion.eyes import Eyes
from companion.languages import hfsm, rc, wm
from companion.languages.evidence import Evidence
from companion.languages.facts import Facts, Kind, fact
from companion.planning.search import search
from companion.sentences import operator
from companion.skills.performing import perform
from companion.skills.situation import Situation, beginning
from companion.tasks.pour.done import Pour, PourKind
from companion.tasks.put_down.command import PutDown
from companion.tasks.swap_hands.command import SwapHands
from companion.world.observe import observed
from services.executor.loop.core import LoopCore
from services.executor.simulation import InProcess, markers, model_names, receptor
from services.knowledge.answers import ask
from services.knowledge.memory import Overlays
from services.knowledge.store import Store
from services.task import plan as plans
from services.task.outgoing_messages import SURVEY, known_after, not_checked, observations
from services.task.running import LOOK_FIRST, PLAN_AGAIN
from velma.kinematics.robot import Robot
from velma.model.scene import CANONICAL, Content, Noise, Scene, checked, load, vary
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader

MOST_PLANS = 6
SETTLING = {"swap_hands": SwapHands, "put_down": PutDown}
"""Commands of which a plan settles what they mean, as co lets it."""
POUR = hfsm.Task("pour", ("jar", "bowl"))
RUN = tables.commit()
Part = TypeVar("Part", Content, Noise)
PAGE = Path(__file__).parents[1] / "docs/results/disturbances.md"
BEGIN, END = "<!-- noise: python benchmarks/pour_one_process.py --table -->\n", "<!-- /noise -->\n"


class Run:
    """One world, one robot, one memory of it. `backend`: of that scene, None: a new one."""

    def __init__(
        self,
        scene: Scene,
        seed: int,
        verbose: bool = False,
        eyes: Eyes = Eyes.PIXELS,
        backend: MujocoBackend | None = None,
    ) -> None:
        self.seed, self.verbose, self.planned = seed, verbose, 0
        self.backend = backend or MujocoBackend(scene)
        self.truth = TruthReader(self.backend)
        self.body = InProcess(LoopCore(self.backend), receptor(scene, eyes))
        self.here: Situation = beginning(Robot(), model_names(scene), markers(scene))
        self.store, self.overlays, self.version = Store.open(None), Overlays(), 0
        self.evidence: tuple[Evidence, ...] = ()
        self.plans: list[dict[str, float]] = []
        self.acts: list[tuple[str, float, str]] = []

    def act(self, command: rc.Command) -> rc.Done | rc.NotDone:
        """Perform a command, then let km know what was seen."""
        began = time.perf_counter()
        outcome = self.body.perform(perform(self.here, command))
        self.observe(outcome, command)
        name = f"{type(command).__name__} {command.key}"
        ended = (
            "done" if isinstance(outcome, rc.Done) else f"{outcome.kind}: {operator(outcome.why)}"
        )
        self.acts.append((name, round(outcome.sim_time, 2), ended))
        if self.verbose:
            wall = time.perf_counter() - began
            tilt = {k: round(v, 1) for k, v in self.truth.read().tilt_deg.items()}
            times = f"{outcome.sim_time:6.2f} s, wall {wall:5.2f} s"
            typer.echo(f"  {self.here.time:7.2f} {name:28s} {times} {ended}, truly tilted {tilt}")
        return outcome

    def observe(self, outcome: rc.Done | rc.NotDone, command: rc.Command) -> None:
        """Take ta's report to km after an act, and keep what it says of evidence."""
        self.evidence = known_after(self.evidence, outcome)
        own = ACTS[type(command)].sights(command, outcome) if isinstance(outcome, rc.Done) else ()
        for one in (*own, *observations(outcome)):
            self.version += 1
            self.store.write(observed(self.store.scene, one, (1, self.version)))

    def ask(self, query: wm.AnyQuery) -> wm.AnyAnswer:
        """Return km's answer."""
        self.overlays, answer = ask(self.store.scene, self.overlays, query)
        return answer

    def solve(self, number: int, task: hfsm.Task = POUR) -> hfsm.HierarchicalPlan | hfsm.NoPlan:
        """One planning."""
        network = hfsm.GroundTaskNetwork(f"plan-{number}", (task,))
        began = time.perf_counter()
        plan = search(network, self.ask, self.seed)
        wall = time.perf_counter() - began
        if isinstance(plan, hfsm.HierarchicalPlan):
            self.plans.append({"wall_s": round(wall, 2), "queries": plan.queries})
        if self.verbose:
            found = operator(plan.why) if isinstance(plan, hfsm.NoPlan) else plan.queries
            typer.echo(f"plan {number}: {wall:.2f} s {found}")
        return plan

    def follow(self, plan: hfsm.HierarchicalPlan) -> tuple[hfsm.Outcome, Facts]:
        """Run a plan to its end."""
        at: plans.Position | hfsm.Outcome = plans.first(plan.root)
        why: Facts = ()
        while not isinstance(at, hfsm.Outcome):
            outcome, why = self.leaf(plans.leaf(plan.root, at))
            at = plans.after(plan.root, at, outcome)
        return at, why

    def leaf(self, leaf: plans.Leaf) -> tuple[hfsm.Outcome, Facts]:
        """One leaf of a plan."""
        if isinstance(leaf, hfsm.EndState):
            return leaf.outcome, leaf.why
        if isinstance(leaf, hfsm.AskState):
            truth = self.ask(leaf.query)
            holds = isinstance(truth, wm.Truth) and truth.value is leaf.expect
            why = truth.why if isinstance(truth, wm.Unknown) else (fact(Kind.NEW_PLAN_WANTED),)
            return (hfsm.Outcome.SUCCEEDED, ()) if holds else (leaf.otherwise, why)
        done = self.act(leaf.command)
        if isinstance(done, rc.Done):
            if done.arrived is False:
                return hfsm.Outcome.FAILED, (
                    fact(PourKind.REST_NOT_THERE, getattr(leaf.command, "destination", "")),
                )
            if done.missing:
                self.act(SURVEY)
                return hfsm.Outcome.REPLAN, tuple(
                    fact(Kind.NOT_WHERE_IT_WAS, name) for name in done.missing
                )
            if isinstance(leaf.command, Pour) and not done.arrived:
                return hfsm.Outcome.FAILED, (fact(PourKind.NOT_SEEN_IN, leaf.command.destination),)
            return hfsm.Outcome.SUCCEEDED, ()
        if done.kind in LOOK_FIRST:
            self.act(SURVEY)
        return hfsm.Outcome.REPLAN if done.kind in PLAN_AGAIN else hfsm.Outcome.FAILED, done.why

    def pour(self) -> Facts:
        """The task; returns why it failed, or nothing."""
        self.act(SURVEY)
        return self.carry_out(POUR)

    def carry_out(self, task: hfsm.Task) -> Facts:
        """Do a task; return why it failed, and what nobody has checked, as ta does."""
        why: Facts = ()
        for _ in range(MOST_PLANS):
            self.planned += 1
            plan = self.solve(self.planned, task)
            if isinstance(plan, hfsm.NoPlan):
                return (*plan.why, *not_checked(self.evidence))
            if task.name in SETTLING:
                task = SETTLING[task.name](*task.arguments).settled(plan) or task
            outcome, why = self.follow(plan)
            if outcome is not hfsm.Outcome.REPLAN:
                return (
                    *(why if outcome is hfsm.Outcome.FAILED else ()),
                    *not_checked(self.evidence),
                )
        return (fact(Kind.GIVEN_UP, MOST_PLANS, *why),)


def noisy(scene: Scene, noise: str) -> Scene:
    """Return a scene with other noise or content than its own."""
    changes = dict(one.split("=") for one in noise.split(",") if one)
    of_content = {name: changes.pop(name) for name in Content.__struct_fields__ if name in changes}
    content = changed(scene.content or Content(), of_content) if of_content else scene.content
    return checked(replace(scene, noise=changed(scene.noise, changes), content=content))


def changed(part: Part, changes: dict[str, str]) -> Part:
    """Return a part of a scene with some values replaced, given as words."""
    return msgspec.convert({**asdict(part), **changes}, type(part), strict=False)


def measured(
    seed: int, verbose: bool, name: str = CANONICAL.stem, eyes: Eyes = Eyes.PIXELS, noise: str = ""
) -> dict[str, object]:
    """One seed, as a line of the results file. `noise`: of the scene, as
    "height=0.01,outliers=0.02".
    """
    began = time.perf_counter()
    run = Run(noisy(vary(load(CANONICAL.with_stem(name)), seed), noise), seed, verbose, eyes)
    try:
        failure = operator(run.pour())
    finally:
        run.body.eye.close()
    truth = run.truth.read()
    poured = truth.grains_in.get("bowl_1", 0) / max(1, truth.grains)
    held = max(truth.fingers_on.get("jar_1", {}).values(), default=0) >= 3
    good = not failure and poured >= 0.9 and held and truth.tilt_deg["bowl_1"] < 10.0
    return {
        "scene": name, "eyes": eyes, "noise": noise, "seed": seed, "success": good,
        "failure": failure,
        "poured": round(poured, 3), "held": held,
        "bowl_tilt_deg": round(truth.tilt_deg.get("bowl_1", 0.0), 2),
        "sim_time_s": round(run.here.time, 1), "wall_s": round(time.perf_counter() - began, 1),
        "plans": run.plans,
        "work_J": round(truth.work_J, 1), "acts": run.acts, "commit": RUN,
    }  # fmt: skip


def rows(lines: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the table of what each change of the scene does, and below it why a pour was not
    done.
    """
    yield (
        "| scene | eyes | other than in the scene | pours | done | of them run again | simulated,"
        " median [s] |\n"
    )
    yield "|---|---|---|---|---|---|---|\n"
    failed = []
    newest = {(kind(line), line["seed"]): line for line in lines if "noise" in line}
    failing = {(kind(line), line["seed"]) for line in lines if not line["success"]}
    for scene, eyes, noise in sorted({of for of, _ in newest}, key=lambda of: (of[2], *of[:2])):
        same = [line for (of, _), line in newest.items() if of == (scene, eyes, noise)]
        done = [one for one in same if one["success"]]
        again = sum(((scene, eyes, noise), one["seed"]) in failing for one in done)
        middle = statistics.median(one["sim_time_s"] for one in done) if done else math.nan
        words = noise.replace(",", ", ").replace("=", " ") or "none"
        yield (
            f"| {scene} | {eyes} | {words} | {len(same)} | {len(done)} | {again} | {middle:.0f} |\n"
        )
        failed += [
            f"- {scene}, {eyes}, {words}, seed {one['seed']}: {why(one)}\n"
            for one in same
            if not one["success"]
        ]
    yield "".join(["\n", *failed]) if failed else ""


def kind(line: dict[str, Any]) -> tuple[str, str, str]:
    """Return scene, eyes and noise of a run."""
    return line.get("scene", CANONICAL.stem), line.get("eyes", Eyes.RAYS), line.get("noise", "")


def why(line: dict[str, Any]) -> str:
    """Return why a pour counts as failed: what the robot said, or that it was wrong."""
    return (
        str(line["failure"])
        or f"said done, {100 * line['poured']:.0f} % of the content are in the bowl"
    )


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-20",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path(
        "pour_one_process.jsonl"
    ),
    scene: Annotated[str, typer.Option(help="a scene of velma/model/scenes")] = CANONICAL.stem,
    eyes: Annotated[Eyes, typer.Option(help="how the robot sees")] = Eyes.PIXELS,
    noise: Annotated[
        str, typer.Option(help="or content of the scene, as height=0.01,spin=true")
    ] = "",
    verbose: Annotated[bool, typer.Option()] = False,
    again: Annotated[bool, typer.Option(help="those of other versions once more")] = False,
    table: Annotated[
        bool, typer.Option("--table", help="write docs/results/disturbances.md, and end")
    ] = False,
) -> None:
    """Run the seeds that do not stand in the results file yet."""
    if table:
        tables.put(PAGE, BEGIN, "".join(rows(tables.read(out))), END)
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    ran = {line["seed"]: line for line in tables.read(out) if kind(line) == (scene, eyes, noise)}
    for seed in tables.seeds(seeds):
        if seed in ran and not (again and ran[seed].get("commit") != RUN):
            continue
        result = measured(seed, verbose, scene, eyes, noise)
        tables.append(out, result)
        typer.echo(
            f"seed {seed}: {'poured' if result['success'] else 'FAILED'} {result['failure']}"
            f" {result['poured']} sim {result['sim_time_s']} s wall {result['wall_s']} s"
            f" plans {result['plans']}"
        )


if __name__ == "__main__":
    typer.run(main)

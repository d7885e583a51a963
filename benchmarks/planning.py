"""Cost of planning: both plans of the pouring task on varied scenes, with km asked in the same
process.

Run `python benchmarks/planning.py [--seeds 1-20]`. Nothing is simulated: the receptor looks at the
scene from the start posture, and what the first plan supposes of its end is taken for observed
before the second.
"""

import time
from typing import Annotated

import numpy as np
import tables
import typer

from companion.languages import hfsm, wm
from companion.languages.values import BodyPosture, Pose, Side
from companion.planning.search import search
from companion.sentences import operator
from companion.skills.motions import aim
from companion.world.observe import observed
from companion.world.scene import Scene
from services.executor import simulation
from services.knowledge.answers import ask
from services.knowledge.memory import Overlays
from services.task.outgoing_messages import SURVEY
from velma import names
from velma.kinematics.frames import xyz_quat
from velma.model.scene import load, vary
from velma.sim.mujoco_backend import MujocoBackend

PARTS = ("right_arm", "left_arm", "head", "right_hand", "left_hand")


class Planning:
    """One seed: what km knows, and what planning cost."""

    def __init__(self, seed: int) -> None:
        self.seed, self.scene, self.overlays, self.told = seed, Scene(), Overlays(), 0
        self.asking = 0.0
        self._look_around()

    def _look_around(self) -> None:
        scene = vary(load(), self.seed)
        backend, eye, models = (
            MujocoBackend(scene),
            simulation.receptor(scene),
            simulation.model_names(scene),
        )
        qpos = backend.configuration().copy()
        for point in SURVEY.at:
            goal = aim(0.0, point)
            for name, angle in zip(names.HEAD, (goal.pan, goal.tilt), strict=True):
                qpos[backend.model.joint(name).qposadr[0]] = angle
            for sight in eye.look(qpos, (0.0, goal.pan, goal.tilt)):
                self.tell(
                    wm.SeenObject(
                        sight.name, models[sight.name], Pose(*xyz_quat(sight.T_world_object)), 1.0
                    )
                )
        right, left = (
            tuple(float(x) for x in names.START[names.ARM[side]]) for side in ("right", "left")
        )
        self.tell(wm.SeenBody(BodyPosture(0.0, right, left, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4)))
        for side in Side:
            self.tell(wm.SeenHand(side))

    def tell(self, observation: wm.AnyObservation) -> None:
        """km is told something."""
        self.told += 1
        self.scene = observed(self.scene, observation, (1, self.told), 1.0)

    def believe(self) -> None:
        """The last hypothetical state is taken for observed."""
        supposed = list(self.overlays.states.values())[-1].scene
        self.tell(
            wm.SeenBody(
                BodyPosture(supposed.joints["torso"][0], *(supposed.joints[part] for part in PARTS))
            )
        )
        for side, held in supposed.hands.items():
            self.tell(wm.SeenHand(side, held.object, held.grasp, held.pose))
        for thing in supposed.things.values():
            if supposed.holder(thing.id) is None:
                self.tell(wm.SeenObject(thing.id, thing.model, thing.pose, 2.0))

    def ask(self, query: wm.AnyQuery) -> wm.AnyAnswer:
        """Return km's answer, and time it."""
        begun = time.perf_counter()
        self.overlays, answer = ask(self.scene, self.overlays, query)
        self.asking += time.perf_counter() - begun
        return answer

    def plan(self, number: int) -> tuple[list[float], str]:
        """Wall time, processor time, time in km [s], queries, expected duration [s]; and the reason
        if no plan was found.
        """
        network = hfsm.GroundTaskNetwork(f"plan-{number}", (hfsm.Task("pour", ("jar", "bowl")),))
        self.asking, wall, processor = 0.0, time.perf_counter(), time.process_time()
        plan = search(network, self.ask, self.seed)
        cost = [time.perf_counter() - wall, time.process_time() - processor, self.asking]
        if isinstance(plan, hfsm.NoPlan):
            return [*cost, np.nan, np.nan], operator(plan.why)
        return [*cost, plan.queries, plan.duration], ""


def main(seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-20") -> None:
    """Print one line per plan, then medians and worst."""
    costs: dict[int, list[list[float]]] = {1: [], 2: []}
    for seed in tables.seeds(seeds):
        one = Planning(seed)
        for number in costs:
            cost, reason = one.plan(number)
            costs[number].append(cost)
            typer.echo(f"seed {seed:2} plan {number}: " + (reason or _line(cost)))
            if reason:
                break
            one.believe()
    for number, rows in costs.items():
        typer.echo(f"plan {number}, median: {_line(list(np.nanmedian(rows, axis=0)))}")
        typer.echo(f"plan {number}, largest: {_line(list(np.nanmax(rows, axis=0)))}")


def _line(cost: list[float]) -> str:
    wall, processor, asking, queries, duration = cost
    spent = f"{wall:5.2f} s wall, {processor:5.2f} s of processor, {1e3 * asking:2.0f} ms in km"
    return f"{spent}, {queries:3.0f} queries, motions {duration:4.1f} s"


if __name__ == "__main__":
    typer.run(main)

"""Cost of geometry: collision checks, inverse kinematics, time scaling, and the free motions of the pouring task.

Run `python benchmarks/kinematics.py [--seeds 3]`. The motions are those of the task on vary scenes, each from the
posture the one before ended in; searches for grasps and places are timed apart from the motions between them.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Any

import numpy as np
import pinocchio as pin

from companion import models
from velma import names
from velma.kinematics import ik, motion
from velma.kinematics.collision import World
from velma.kinematics.frames import standing, transform
from velma.kinematics.robot import Robot
from velma.kinematics.tasks.carrying import carries, upright
from velma.kinematics.tasks.grasping import Approach, GraspWay, Target, approaches
from velma.kinematics.tasks.placing import Placing, backwards, placings
from velma.kinematics.tasks.pouring import Stream, tiltings
from velma.kinematics.timing import timed
from velma.model.scene import Scene, load, vary

MODEL = {"jar": "jar", "bowl": "bowl_high", "cabinet": "cabinet_no_door", "table": "table"}
PLACE = np.array([0.58, -0.52, 0.775])  # where the trial runs put the bowl
EMPTY, LOADED = 0.35, 0.25  # m/s of the tool
Spent = dict[str, list[float]]


def furnished(robot: Robot, scene: Scene) -> World:
    """The things of a scene with the shapes the agents know."""
    world = World(robot)
    for thing in scene.things:
        model = models.MODELS[MODEL[thing.model]]
        kind = "object" if model.moveable else "furniture"
        world.put(thing.id, model.shapes, standing(thing.xyz, thing.yaw), kind)
    return world


def microseconds(work: Callable[[np.ndarray], object], inputs: np.ndarray) -> float:
    """Mean time of one call."""
    begun = time.perf_counter()
    for q in inputs:
        work(q)
    return 1e6 * (time.perf_counter() - begun) / len(inputs)


class Task:
    """The pouring task as geometry only: every motion is planned, none is simulated."""

    def __init__(self, robot: Robot, seed: int) -> None:
        self.robot, self.seed = robot, seed
        self.scene = vary(load(), seed)
        self.world = furnished(robot, self.scene)
        self.rng = np.random.default_rng(seed)
        self.q = np.array(names.START)
        self.searching: Spent = defaultdict(list)
        self.planning: Spent = defaultdict(list)
        self.moving: Spent = defaultdict(list)
        self.failed: str | None = None

    def search(self, name: str, found: Callable[[], Any]) -> Any:
        """Time a search."""
        begun = time.perf_counter()
        result = found()
        self.searching[name].append(time.perf_counter() - begun)
        return result

    def move(self, name: str, side: str, goals: Iterable[np.ndarray], speed: float, **options: Any) -> int | None:
        """Go to the first goal that can be reached; its number."""
        begun = time.perf_counter()
        for number, goal in enumerate(goals):
            way = motion.plan(self.robot, self.world, side, self.q, goal, seed=self.seed, tool_speed=speed, **options)
            if way is not None:
                self.planning[name].append(time.perf_counter() - begun)
                self.moving[name].append(way.duration)
                self.q = way.path[-1]
                return number
        self.planning[name].append(time.perf_counter() - begun)
        self.failed = name
        return None

    def target(self, name: str, distance: float) -> Target:
        """Return the target for taking a thing out of the cabinet."""
        out = standing((0, 0, 0), self.scene.find("cabinet_2").yaw).rotation[:, 0]
        return Target(name, self.world.pose(name), True, out, distance)

    def grasp(self, name: str, model: str, side: str, distance: float, speed: float, fingers: float) -> Approach | None:
        """Find grasps, go in front of one, take the thing out."""
        kinds = models.GRASPS[model]
        ways = [
            GraspWay(g.id, tuple((transform(s.pose), s.fingers) for s in g.steps))
            for g in kinds
            if g.kind == kinds[0].kind
        ]
        target = self.target(name, distance)
        found = self.search(name, lambda: approaches(self.robot, self.world, side, self.q, target, ways, self.rng))
        number = self.move(f"to {name}", side, (a.way_in[0] for a in found), speed)
        if number is None:
            return None
        approach = found[number]
        self.world.attach(name, side, approach.steps[-1][0].inverse())
        self.world.fingers(side, fingers)
        self.q = approach.way_out[-1]
        return approach

    def run(self) -> None:
        """Jar out and aside, bowl out, onto the table, arm home, jar over the bowl."""
        if self.grasp("jar_1", "jar", "left", 0.28, EMPTY, 1.4) is None:
            return
        T_grip_jar = self.world.held("jar_1")
        aside = carries(self.robot, self.world, "left", self.q, T_grip_jar, self.rng)
        keep = upright(self.robot, "left", T_grip_jar, np.radians(35))
        if self.move("carry", "left", islice(aside, 12), LOADED, keep=keep) is None:
            return
        bowl = self.grasp("bowl_1", "bowl_high", "right", 0.22, LOADED, 1.3)
        if bowl is None or not self.put(bowl):
            return
        self.pour(T_grip_jar)

    def put(self, bowl: Approach) -> bool:
        """Bowl onto the table, right arm home."""
        held = self.world.held("bowl_1")
        retreat = backwards(bowl.steps)

        def places() -> list[Placing]:
            found = placings(
                self.robot, self.world, "right", self.q, "bowl_1", held, [("table_1", PLACE)], retreat, self.rng
            )
            return self.nearest("right", list(islice(found, 6)), lambda placing: placing.above)

        found = self.search("place", places)
        for tilt in (25, 60):
            keep = upright(self.robot, "right", held, np.radians(tilt))
            number = self.move(f"above, tilt {tilt}", "right", (p.above for p in found), LOADED, keep=keep)
            if number is not None:
                break
        else:
            return False
        self.failed, self.q = None, found[number].way_back[-1]
        self.world.detach("bowl_1", found[number].place * standing((0, 0, -0.006)))
        self.world.fingers("right", 1.0)
        return self.move("home", "right", self.homes(), LOADED) is not None

    def nearest(self, side: str, some: list[Any], posture: Callable[[Any], np.ndarray]) -> list[Any]:
        """The same, those first whose posture can be reached soonest."""
        travel = ik.travel(self.robot, side, self.q, np.array([posture(one) for one in some]))
        return [some[k] for k in np.argsort(travel)]

    def homes(self) -> Iterator[np.ndarray]:
        """The right arm down, the torso at some angle."""
        for torso in (self.q[0], 0.0, -0.3, 0.3, -0.6, 0.6, -0.9, 0.9):
            goal = self.q.copy()
            goal[names.ARM["right"]] = names.START[names.ARM["right"]]
            goal[0] = torso
            if self.world.free(goal):
                yield goal

    def pour(self, T_grip_jar: pin.SE3) -> None:
        """Jar to the beginning of the tilt."""
        stream = Stream(self.world.pose("bowl_1").act(np.array([0, 0, 0.1])), 0.1, 0.1)
        found = tiltings(self.robot, self.world, "left", self.q, T_grip_jar, stream, self.rng)
        some = self.search(
            "tilt", lambda: self.nearest("left", list(islice(found, 4)), lambda tilting: tilting.path[0])
        )
        keep = upright(self.robot, "left", T_grip_jar, np.radians(40))
        self.move("to the tilt", "left", (t.path[0] for t in some), LOADED, keep=keep)


def primitives(robot: Robot, rng: np.random.Generator) -> None:
    """Microseconds of the single steps."""
    world = furnished(robot, load())
    states = np.clip(names.START + rng.normal(0, 0.7, (2000, 15)), robot.lower, robot.upper)
    share = np.mean([world.free(q) for q in states])
    print(f"free            {microseconds(world.free, states):7.0f} us a state, {share:.0%} free")
    world.attach("bowl_1", "right", standing((0, 0, 0.08)))
    world.attach("jar_1", "left", standing((0, 0, 0)))
    print(f"  both hands full {microseconds(world.free, states):5.0f} us")
    targets = [robot.grip(q * 0.6, "left") for q in states[:300]]
    begun = time.perf_counter()
    solved = sum(ik.solve(robot, "left", t, q) is not None for t, q in zip(targets, states, strict=False))
    print(f"solve           {(time.perf_counter() - begun) / 300 * 1e6:7.0f} us a start, {solved / 300:.0%} reached")
    begun = time.perf_counter()
    count = sum(len(ik.postures(robot, "left", t, states[0], rng)) for t in targets)
    each = (time.perf_counter() - begun) / 300 * 1e6
    print(f"postures        {each:7.0f} us a call, {count / 300:.0f} comfortable ones found")
    path = [names.START, names.START * 0.5, names.START * 0.8]
    print(f"timed           {microseconds(lambda _: timed(robot, path, tool_speed=0.25), states[:20]):7.0f} us")


def main() -> None:
    """Print the tables."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seeds", type=int, default=3)
    robot = Robot()
    primitives(robot, np.random.default_rng(0))
    tasks = [Task(robot, seed) for seed in range(1, arguments.parse_args().seeds + 1)]
    for task in tasks:
        begun = time.perf_counter()
        task.run()
        moved = sum(sum(v) for v in task.moving.values())
        print(
            f"seed {task.seed}: {time.perf_counter() - begun:5.1f} s in all, {task.world.checks} checks; "
            f"free motions {moved:.1f} s; {'failed at ' + task.failed if task.failed else 'complete'}"
        )
    for title, of in (("search [s]", "searching"), ("plan [s]", "planning"), ("motion [s]", "moving")):
        print(title)
        for name in dict.fromkeys(name for task in tasks for name in getattr(task, of)):
            values = [v for task in tasks for v in getattr(task, of)[name]]
            print(f"  {name:22} median {np.median(values):6.2f}  most {max(values):6.2f}  ({len(values)})")


if __name__ == "__main__":
    main()

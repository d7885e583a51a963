"""Time km needs for each kind of query, for an observation and for a hypothetical state; in one process, no wire.

    python benchmarks/knowledge.py [--rounds N] [--objects N]

Prints a table of microseconds (median, 99th percentile) without and with encoding of the answer, and its size. The aim
is at most 1 ms a query without encoding. `--objects` adds boxes on the table to the recorded scene.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from companion.languages import WM, wm
from companion.languages.values import BodyPosture, Cylinder, Pose, Side
from services.knowledge import observe
from services.knowledge.answers import ask
from services.knowledge.overlays import Overlays
from services.knowledge.store import Store

VOLUME = Cylinder(0.25, 0.6, Pose((0.58, -0.52, 1.1)))


def yaw(angle: float) -> tuple[float, float, float, float]:
    """A turn about z, w first."""
    return math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)


def observations(boxes: int) -> list[wm.AnyObservation]:
    """The recorded scene kb_world_model_011 of proghtn-backstream, and some boxes on its free table."""
    scene: list[wm.AnyObservation] = [
        wm.SeenObject("table_1", "table", Pose((0.783, -0.840, 0.0), yaw(-0.747)), 1.0),
        wm.SeenObject("table_2", "table", Pose((1.087, 0.434, 0.0), yaw(-1.335)), 1.1),
        wm.SeenObject("cabinet_2", "cabinet_no_door", Pose((0.8994, 0.3646, 1.125), yaw(-2.9235)), 1.2),
        wm.SeenObject("jar_1", "jar", Pose((0.851, 0.369, 1.281), yaw(2.976)), 1.3),
        wm.SeenObject("bowl_1", "bowl_high", Pose((0.809, 0.437, 0.881), yaw(-2.14)), 1.4),
        wm.SeenBody(BodyPosture(0.1, (0.2,) * 7, (0.3,) * 7, (0.4, 0.5), (0.6,) * 4, (0.7,) * 4)),
        wm.SeenHand(Side.LEFT),
        wm.SeenHand(Side.RIGHT),
    ]
    for n in range(boxes):
        place = Pose((0.5 + 0.12 * (n % 5), -1.1 + 0.12 * (n // 5), 0.83))
        scene.append(wm.SeenObject(f"box_{n}", "box1", place, 2.0))
    return scene


def queries(state: str) -> list[wm.AnyQuery]:
    """One of each kind."""
    return [
        wm.ListObjects(kind="Container", state=state),
        wm.ObjectPose(object="jar_1", state=state),
        wm.ObjectModel(object="bowl_1", state=state),
        wm.MoveableObjects(state=state),
        wm.StaticObjects(state=state),
        wm.ObjectHole(object="jar_1", state=state),
        wm.FlatSurfaces(state=state),
        wm.CurrentGrasp(object="jar_1", state=state),
        wm.GraspAtSide(side=Side.LEFT, state=state),
        wm.GraspSet(object="jar_1", state=state),
        wm.GraspDefinition(object="jar_1", grasp="7", state=state),
        wm.ArmConfiguration(side=Side.LEFT, state=state),
        wm.TorsoConfiguration(state=state),
        wm.HeadConfiguration(state=state),
        wm.GripperConfiguration(side=Side.LEFT, state=state),
        wm.EnvironmentShapes(state=state),
        wm.CollisionsInVolume(volume=VOLUME, state=state),
        wm.ReservedSpace(state=state),
        wm.RobotReach(side=Side.LEFT, state=state),
        wm.Holds(relation="isIn", subject="jar_1", value="cabinet_2", state=state),
    ]


def timed(work: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Median and 99th percentile of the time of one call [us]."""
    took = []
    for _ in range(rounds):
        begin = time.perf_counter_ns()
        work()
        took.append((time.perf_counter_ns() - begin) / 1e3)
    took.sort()
    return statistics.median(took), took[int(0.99 * (len(took) - 1))]


def filled(store: Store, boxes: int) -> Store:
    """The store with the scene in it."""
    for count, observation in enumerate(observations(boxes), start=1):
        observe.apply(store, observation, (1, count), 2.0)
    return store


def report_observing(name: str, store: Store, rounds: int) -> None:
    """The jar is seen again and again, a little elsewhere each time."""
    counts = iter(range(1000, 1000 + rounds))

    def see() -> None:
        count = next(counts)
        jar = wm.SeenObject("jar_1", "jar", Pose((0.851 + 1e-6 * count, 0.369, 1.281)), float(count))
        observe.apply(store, jar, (1, count))

    median, high = timed(see, rounds)
    print(f"{name:28s} {median:9.1f} {high:9.1f}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=500)
    parser.add_argument("--objects", type=int, default=0, help="boxes added to the scene")
    options = parser.parse_args()
    store = filled(Store.open(), options.objects)
    make = wm.HypotheticalState(
        id="p/1",
        changes=(
            wm.Grasped("jar_1", Side.LEFT, "7", Pose((0.0, 0.0, 0.002))),
            wm.Configured("left_arm", (0.1,) * 7),
            wm.Moved("bowl_1", Pose((0.58, -0.52, 0.775)), "table_1"),
        ),
    )
    overlays, _ = ask(store.scene, Overlays(), make)
    print(f"{'query':28s} {'p50 us':>9s} {'p99 us':>9s} {'+enc p50':>9s} {'bytes':>9s}")
    for query in queries("p/1"):
        median, high = timed(lambda query=query: ask(store.scene, overlays, query), options.rounds)
        encoded, _ = timed(lambda query=query: WM.encode(ask(store.scene, overlays, query)[1]), options.rounds)
        size = len(bytes(WM.encode(ask(store.scene, overlays, query)[1])))
        print(f"{type(query).__name__:28s} {median:9.1f} {high:9.1f} {encoded:9.1f} {size:9d}")
    median, high = timed(lambda: ask(store.scene, Overlays(), make), options.rounds)
    print(f"{'HypotheticalState (3 changes)':28s} {median:8.1f} {high:9.1f}")
    report_observing("observation, in memory", store, options.rounds)
    with TemporaryDirectory() as folder:
        report_observing(
            "observation, on disk", filled(Store.open(Path(folder) / "km"), options.objects), options.rounds
        )


if __name__ == "__main__":
    main()

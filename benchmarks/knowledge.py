"""Time km needs for each kind of query, for an observation and for a hypothetical state; in one process, no wire.

    python benchmarks/knowledge.py [--rounds N] [--objects N ...]

Prints for each number of objects a table of microseconds (median, 99th percentile) without and with encoding of the
answer, and its size. The aims are at most 1 ms a query without encoding, and 2 ms an observation. The objects are those
of the recorded scene, and boxes beside each other.
"""

import argparse

from observing import SCENE, report_observing, seen, timed

from companion.all_languages import WM
from companion.languages import wm
from companion.languages.values import Cylinder, Pose, Side
from services.knowledge.answers import ask
from services.knowledge.overlays import Overlays

VOLUME = Cylinder(0.25, 0.6, Pose((0.58, -0.52, 1.1)))


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


def report_queries(objects: int, rounds: int) -> None:
    """Each kind of query, of a hypothetical state, and the making of it."""
    scene = seen(objects)
    make = wm.HypotheticalState(
        id="p/1",
        changes=(
            wm.Grasped("jar_1", Side.LEFT, "7", Pose((0.0, 0.0, 0.002))),
            wm.Configured("left_arm", (0.1,) * 7),
            wm.Moved("bowl_1", Pose((0.58, -0.52, 0.775)), "table_1"),
        ),
    )
    overlays, _ = ask(scene, Overlays(), make)
    for query in queries("p/1"):
        median, high = timed(lambda query=query: ask(scene, overlays, query), rounds)
        encoded, _ = timed(lambda query=query: WM.encode(ask(scene, overlays, query)[1]), rounds)
        size = len(bytes(WM.encode(ask(scene, overlays, query)[1])))
        print(f"{type(query).__name__:35s} {median:9.1f} {high:9.1f} {encoded:9.1f} {size:9d}")
    median, high = timed(lambda: ask(scene, Overlays(), make), rounds)
    print(f"{'HypotheticalState (3 changes)':35s} {median:9.1f} {high:9.1f}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=500)
    parser.add_argument("--objects", type=int, nargs="+", default=[SCENE], help=f"at least {SCENE} each")
    options = parser.parse_args()
    for objects in options.objects:
        print(f"{f'{objects} objects':35s} {'p50 us':>9s} {'p99 us':>9s} {'+enc p50':>9s} {'bytes':>9s}")
        report_queries(objects, options.rounds)
        report_observing(objects, options.rounds)


if __name__ == "__main__":
    main()

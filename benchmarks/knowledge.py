"""Time km needs for each kind of query, for an observation and for a hypothetical state; in one
process, no wire.

    python benchmarks/knowledge.py [--rounds N] [--objects N ...]

Prints for each number of objects a table of microseconds (median, 99th percentile) without and with
encoding of the answer, and its size. The aims are at most 1 ms a query without encoding, and 2 ms
an observation. The objects are those of the recorded scene, and boxes beside each other.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec import Raw

from agent_runtime.core.events import AnyEvent, Arrived, Next, PeerChanged, Started
from agent_runtime.core.step import Core
from agent_runtime.io.journal import Journal
from agent_runtime.io.steplog import fingerprint
from companion.design import WM, wiring
from companion.languages import wm
from companion.languages.values import BodyPosture, Cylinder, Pose, Side
from companion.world.observe import observed, subject_of
from companion.world.scene import Scene
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative
from services.knowledge.answers import ask
from services.knowledge.behaviours import agent
from services.knowledge.memory import Overlays
from services.knowledge.store import Store

VOLUME = Cylinder(0.25, 0.6, Pose((0.58, -0.52, 1.1)))
SCENE = 5
"""Objects of the recorded scene."""


def yaw(angle: float) -> tuple[float, float, float, float]:
    """A turn about z, w first."""
    return math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)


def observations(boxes: int) -> list[wm.AnySight]:
    """The recorded scene kb_world_model_011 of proghtn-backstream, and some boxes on its free
    table.
    """
    scene: list[wm.AnySight] = [
        wm.SeenObject("table_1", "table", Pose((0.783, -0.840, 0.0), yaw(-0.747)), 1.0),
        wm.SeenObject("table_2", "table", Pose((1.087, 0.434, 0.0), yaw(-1.335)), 1.1),
        wm.SeenObject(
            "cabinet_2", "cabinet_no_door", Pose((0.8994, 0.3646, 1.125), yaw(-2.9235)), 1.2
        ),
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


def jar(count: int) -> wm.SeenObject:
    """The jar, a little elsewhere each time."""
    return wm.SeenObject("jar_1", "jar", Pose((0.851 + 1e-6 * count, 0.369, 1.281)), float(count))


def table(count: int) -> wm.SeenObject:
    """The table with the boxes, pushed a little each time."""
    return wm.SeenObject(
        "table_1", "table", Pose((0.783 + 1e-6 * count, -0.840, 0.0), yaw(-0.747)), float(count)
    )


def timed(work: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Median and 99th percentile of the time of one call [us]."""
    took = []
    for _ in range(rounds):
        begin = time.perf_counter_ns()
        work()
        took.append((time.perf_counter_ns() - begin) / 1e3)
    took.sort()
    return statistics.median(took), took[int(0.99 * (len(took) - 1))]


class Km:
    """km as its shell runs it, but for the wire: each step is a record, a hash, and a write of the
    store on disk.

    `synced`: the record is put on the disk, too.
    """

    def __init__(self, folder: Path, synced: bool) -> None:
        self.core = Core(agent(), wiring("km", "bench"))
        self.state, self.store = self.core.boot(None), Store.open(folder / f"km {synced}")
        self.journal = Journal(folder / "km.journal") if synced else None
        self.count = 0
        self.happen(Started())
        self.happen(PeerChanged("ta", 1))
        self.talk = self.state.memory.soft.subscription
        self.asked = self.state.soft.conversations[self.talk].conversation.asked

    def happen(self, event: AnyEvent) -> None:
        """Step, and again while more can be taken."""
        following: AnyEvent | None = event
        while following is not None:
            after, out = self.core.begin(self.state, following, 100.0)
            if out.record is not None and self.journal is not None:
                self.journal.append(out.record)
            for word in out.tells:
                self.store.write(word.scene)
            effects = self.core.end(self.state, after, out, 100.0)
            fingerprint(effects)
            self.state, following = after, Next() if effects.more else None

    def see(self, sight: wm.AnySight) -> None:
        """Hear of it from ta."""
        self.count += 1
        word = Communicate(
            performative=Performative.INFORM,
            protocol="subscribe",
            conversation=self.talk,
            sender="ta",
            receiver="km",
            id=f"{subject_of(sight)}@1.{self.count}",
            in_reply_to=self.asked,
            content=Raw(WM.encode(sight)),
            language="WM",
        )
        self.happen(Arrived(word))


def seen(objects: int) -> Scene:
    """Return a scene with this many objects."""
    scene = Scene()
    for count, sight in enumerate(observations(objects - SCENE), start=1):
        scene = observed(scene, sight, (1, count), 2.0)
    return scene


def write(store: Store, sight: wm.AnySight, count: int) -> None:
    """See it and write that to the store."""
    store.write(observed(store.scene, sight, (1, count), 2.0))


def report_observing(objects: int, rounds: int) -> None:
    """The jar is seen again and again, then the table with what stands on it."""
    scene, counts = seen(objects), iter(range(100_000, 200_000))
    with TemporaryDirectory() as folder:
        unsynced, synced = (Km(Path(folder), kind) for kind in (False, True))
        for km in (unsynced, synced):
            for sight in observations(objects - SCENE):
                km.see(sight)
        memory, disk = Store.open(), Store.open(Path(folder) / "store")
        for store in (memory, disk):
            store.write(scene)
        for name, work in {
            "alone": lambda count: observed(scene, jar(count), (1, count)),
            "of a full table, alone": lambda count: observed(scene, table(count), (1, count)),
            "stored in memory": lambda count: write(memory, jar(count), count),
            "stored on disk": lambda count: write(disk, jar(count), count),
            "the whole step": lambda count: unsynced.see(jar(count)),
            "the step synced": lambda count: synced.see(jar(count)),
        }.items():
            median, high = timed(lambda work=work: work(next(counts)), rounds)
            print(f"{'observation, ' + name:35s} {median:9.1f} {high:9.1f}")


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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=500)
    parser.add_argument(
        "--objects", type=int, nargs="+", default=[SCENE], help=f"at least {SCENE} each"
    )
    options = parser.parse_args()
    for objects in options.objects:
        print(
            f"{f'{objects} objects':35s} {'p50 us':>9s} {'p99 us':>9s} {'+enc p50':>9s}"
            f" {'bytes':>9s}"
        )
        report_queries(objects, options.rounds)
        report_observing(objects, options.rounds)


if __name__ == "__main__":
    main()

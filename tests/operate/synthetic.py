"""A run of the main job as it would go by a tap: made by hand, with the true codec and the true
languages.

Nothing here is measured; durations, sizes and counts are of the kind that a real run has. Also a
demonstration for the page: `python tests/operate/synthetic.py RUN_DIR` writes its traffic.mcap
there.
"""

import math
import random
from collections.abc import Iterable, Iterator

import msgspec

from agent_runtime.core.events import Receipt
from agent_runtime.io.tap import Sample
from companion.design import DESIGN, LANGUAGES
from companion.languages import cmd, hfsm, rc, rs, sw, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture, Box, Pose, Side
from companion.tasks.pour.command import PourInto
from companion.tasks.pour.done import Pour, PourKind
from companion.telemetry import Lateness, RobotState, TrueState
from companion.tools.system import SYSTEM
from companion.tools.telemetry import DECODERS
from fipa_codec.communicate import Communicate, encode
from fipa_codec.languages import Language
from fipa_codec.performatives import Performative as P
from operate.recording.history import History, Signals
from operate.recording.records import House

PREFIX = "roco"
START = 1_700_000_000.0
TABLE = Pose((0.783, -0.840, 0.0), (math.cos(-0.747 / 2), 0.0, 0.0, math.sin(-0.747 / 2)))
BOWL_END = (0.58, -0.52, 0.775)
PROTOCOLS = {"C1": "coordinate", "C2": "request", "C3": "request", "C4": "query", "C5": "request"}
BODY = BodyPosture(0.0, (0.0,) * 7, (0.0,) * 7, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4)
POSES = {
    "cabinet_2": Pose((0.8994, 0.3646, 1.125), (0.109, 0.0, 0.0, -0.994)),
    "table_1": TABLE,
    "table_2": Pose((1.087, 0.434, 0.0), (0.785, 0.0, 0.0, -0.619)),
}
MODELS = {
    "cabinet_2": "cabinet_no_door",
    "table_1": "table",
    "table_2": "table",
    "jar_1": "jar",
    "bowl_1": "bowl_high",
}


def language_of(content: object) -> Language:
    """The language a content is written in."""
    languages = map(LANGUAGES.named, LANGUAGES.names)
    return next(one for one in languages if type(content) in one.classes)


class Run:
    """Samples in the order of time, and what was put into them, counted as it was made."""

    def __init__(self, seed: int = 1) -> None:
        self.samples: list[Sample] = []
        self.said: list[Communicate] = []
        self.now, self.sim = START, 0.0
        self.random = random.Random(seed)
        self._numbers: dict[tuple[str, str], int] = {}
        self._names: dict[str, int] = {}
        self.q = [0.0] * 15
        self.held: dict[str, str] = {}
        self.at = {"jar_1": (0.851, 0.369, 1.281), "bowl_1": (0.809, 0.437, 0.881)}
        self.tilt = 0.0
        self.inside = {"jar_1": 30, "bowl_1": 0}
        self.act = ""

    # --- making samples ---------------------------------------------------------------------------

    def wait(self, seconds: float, *, acting: bool = False) -> None:
        """Let time pass; telemetry goes on at 20 Hz, simulated time only in acts."""
        end = self.now + seconds
        step = 0.05
        while self.now + step < end:
            self.now += step
            self.sim += step if acting else 0.0
            self._telemetry()
        self.sim += (end - self.now) if acting else 0.0
        self.now = end

    def name(self, agent: str) -> str:
        """The next name an agent makes."""
        self._names[agent] = self._names.get(agent, 0) + 1
        return f"{agent}-1-{self._names[agent]}"

    def say(
        self,
        s: str,
        r: str,
        performative: P,
        content: object = None,
        *,
        talk: str,
        protocol: str,
        silent: str = "",
    ):
        """One communicate goes by."""
        number = self._numbers[s, r] = self._numbers.get((s, r), 0) + 1
        rule = DESIGN.rules[s, r, protocol, performative]
        language = language_of(content) if content is not None else None
        message = Communicate(
            performative=performative,
            content=language.encode(content) if language else msgspec.UNSET,
            language=language.name if language else silent, ontology=rule.ontology,
            protocol=protocol, conversation=talk, sender=s, receiver=r,
            id=str(number) if rule.durable else self.name(s), sent=self.now,
        )  # fmt: skip
        if isinstance(content, wm.SeenObject):
            message = msgspec.structs.replace(message, id=f"{content.object}@1.{number}")
        self.said.append(message)
        self.put(message)
        if rule.durable:
            self._receipt(r, s, number)

    def put(self, message: Communicate) -> None:
        """Its bytes go by (again)."""
        key = DESIGN.key(PREFIX, message)
        self.now += self.random.uniform(0.0003, 0.0012)
        self.samples.append(Sample(key, encode(message), self.now))

    def house(self, kind: str, owner: str, data: bytes, peer: str = "") -> None:
        """Something that is not a communicate goes by."""
        end = f"/{peer}" if peer else ""
        self.samples.append(Sample(f"roco/{PREFIX}/_/{kind}/{owner}{end}", data, self.now))

    def state(self, agent: str, state: str) -> None:
        """An agent's heartbeat."""
        told = {"agent": agent, "state": state, "at": self.now}
        self.house("state", agent, msgspec.json.encode(told))

    def _receipt(self, owner: str, peer: str, taken: int) -> None:
        self.now += self.random.uniform(0.001, 0.004)
        self.house("receipt", owner, msgspec.msgpack.encode(Receipt(peer, taken=taken)), peer)

    def _telemetry(self) -> None:
        cycles = int(500 * (self.now - START))
        robot = RobotState(
            sim_time_s=self.sim, body=tuple(self.q), head=(0.2 * math.sin(self.now), 0.4),
            proximal=(0.5,) * 6, mode="motion", act=self.act, skill=self.act,
            work_J=8.0 * self.sim, cycles=cycles, missed=cycles // 400,
            lateness_us=Lateness(60.0, 310.0, 1450.0, 5200.0),
        )  # fmt: skip
        self.house("telemetry", "ex", msgspec.msgpack.encode(robot))
        jar = Pose(self.at["jar_1"], (math.cos(self.tilt / 2), math.sin(self.tilt / 2), 0.0, 0.0))
        sides, (x, y, z) = ("right", "left"), jar.xyz
        truth = TrueState(
            time_s=self.sim, grains=30, grains_in=dict(self.inside), at=dict(self.at),
            tilt_deg={"jar_1": math.degrees(self.tilt), "bowl_1": 1.2}, work_J=8.0 * self.sim,
            fingers_on={o: {s: 5 * (self.held.get(s) == o) for s in sides} for o in self.at},
            poses={**POSES, "jar_1": jar, "bowl_1": Pose(self.at["bowl_1"])}, models=MODELS,
            grains_at=tuple((x + 0.01 * (k % 3), y, z - 0.08 + 0.005 * k) for k in range(30)),
        )  # fmt: skip
        self.house("truth", "ex", msgspec.msgpack.encode(truth))

    # --- pieces of the story ----------------------------------------------------------------------

    def observe(self, *objects: str) -> None:
        """ta tells km what was seen."""
        for name in objects:
            pose = POSES.get(name) or Pose(self.at[name])
            seen = wm.SeenObject(object=name, model=MODELS[name], pose=pose, at=self.sim)
            self.say("ta", "km", P.INFORM, seen, talk="km-1-1", protocol="subscribe")

    def acting(self, command: rc.Command, seconds: float) -> None:
        """ta asks, ex does."""
        talk = self.name("ta")
        self.say("ta", "ex", P.REQUEST, command, talk=talk, protocol="request")
        self.state("ex", "preparing")
        self.wait(self.random.uniform(0.02, 0.3))
        accepted = rc.Accepted(command.key, seconds)
        self.say("ex", "ta", P.AGREE, accepted, talk=talk, protocol="request")
        self.state("ex", "acting")
        self.act = type(command).__name__.lower()
        start = list(self.q)
        goal = [x + self.random.uniform(-0.25, 0.25) for x in start]
        parts = max(2, int(seconds / 0.5))
        for k in range(1, parts + 1):
            share = 0.5 - 0.5 * math.cos(math.pi * k / parts)
            self.q = [a + share * (b - a) for a, b in zip(start, goal, strict=True)]
            self._during(command, share)
            self.wait(seconds / parts, acting=True)
        self.act = ""
        self._after(command)
        seen = rs.Seen("jar_1", "jar", Pose(self.at["jar_1"]), self.sim)
        done = rc.Done(command.key, BODY, (seen,))
        self.say("ex", "ta", P.INFORM, done, talk=talk, protocol="request")
        self.state("ex", "idle")

    def _during(self, command: rc.Command, share: float) -> None:
        if isinstance(command, Pour):
            self.tilt = 2.3 * math.sin(math.pi * share)
            self.inside = {"jar_1": 30 - int(30 * share), "bowl_1": int(29 * share)}

    def _after(self, command: rc.Command) -> None:
        match command:
            case rc.Grasp(side=side, object=object):
                self.held[side] = object
            case rc.MoveCartesian(side=side) if side in self.held:
                x, y, z = self.at[self.held[side]]
                self.at[self.held[side]] = (x - 0.28, y - 0.1, z + 0.03)
            case rc.Release(side=side, object=object):
                self.held.pop(side, None)
                self.at[object] = BOWL_END
            case Pour():
                self.inside = {"jar_1": 0, "bowl_1": 29}

    def planning(
        self, network: hfsm.GroundTaskNetwork, queries: int, root: hfsm.Machine, rest: float
    ) -> hfsm.HierarchicalPlan:
        """co asks, pl asks km, and answers."""
        talk = self.name("co")
        self.say("co", "pl", P.REQUEST, network, talk=talk, protocol="request")
        self.state("pl", "initialize")
        self.say("pl", "co", P.AGREE, hfsm.Taken(network.id), talk=talk, protocol="request")
        for k in range(queries):
            self.state("pl", "search") if k == 3 else None
            self._query(k, queries)
            self.wait(rest / queries * self.random.uniform(0.3, 1.7))
        plan = hfsm.HierarchicalPlan(network.id, network.tasks[0].name, root, 96.0, queries)
        self.say("pl", "co", P.INFORM, plan, talk=talk, protocol="request")
        self.state("pl", "idle")
        return plan

    def _query(self, k: int, queries: int) -> None:
        talk = self.name("pl")
        shape = Box((0.1, 0.2, 0.3))
        kind = self.random.random()
        if k % 40 == 39 or k > 0.9 * queries:
            ask: object = wm.EnvironmentShapes()
            shapes = (shape,) * self.random.randint(5, 60)
            one = wm.PlacedShape("cabinet_2", POSES["cabinet_2"], shapes)
            answer: object = wm.Shapes((one,) * self.random.randint(1, 12))
        elif kind < 0.2:
            ask, step = wm.GraspSet(object="jar_1"), wm.GraspStep(Pose((0.1, 0.0, 0.2)), 1.0)
            grasp = wm.GraspDef("g", (step,) * 4, 1.5, 0.1, 0.6, 0.28, "side")
            answer = wm.Grasps("jar_1", (grasp,) * self.random.randint(4, 16))
        elif kind < 0.5:
            ask = wm.Holds(relation="isOn", subject="jar_1", value="cabinet_2")
            answer = wm.Truth(True)
        else:
            ask = wm.ObjectPose(object="bowl_1", state=f"co-1-2.{k}")
            answer = wm.PoseOf("bowl_1", Pose(self.at["bowl_1"]), True)
        self.say("pl", "km", P.QUERY_REF, ask, talk=talk, protocol="query")
        self.wait(self.random.uniform(0.0002, 0.003))
        self.say("km", "pl", P.INFORM_REF, answer, talk=talk, protocol="query")

    def running(
        self, plan: hfsm.HierarchicalPlan, outcome: sw.WorkerState, durations: dict[str, float]
    ) -> None:
        """ta carries a plan out, co confirms every report."""
        talk = self.name("co")
        self.say("co", "ta", P.REQUEST, plan, talk=talk, protocol="coordinate")
        self.state("ta", "running")
        self._report(talk, sw.Report(sw.WorkerState.RUNNING))
        for place, command in _leaves(plan.root):
            self._report(talk, sw.Report(sw.WorkerState.RUNNING, at=place))
            self.acting(command, durations.get(type(command).__name__, 4.0))
            seen = ("jar_1",) if isinstance(command, rc.Grasp | rc.MoveCartesian) else ()
            self.observe(*seen, *(("bowl_1",) if isinstance(command, rc.Look | rc.Release) else ()))
        self.state("ta", "finished")
        self._report(talk, sw.Report(outcome))
        self.state("ta", "idle")

    def _report(self, talk: str, report: sw.Report) -> None:
        self.say("ta", "co", P.INFORM, report, talk=talk, protocol="coordinate")
        self.say("co", "ta", P.CONFIRM, talk=talk, protocol="coordinate", silent="SW")


def _leaves(root: hfsm.Machine) -> Iterator[tuple[hfsm.Place, rc.Command]]:
    for step in root.states:
        assert isinstance(step, hfsm.Machine)
        for leaf in step.states:
            assert isinstance(leaf, hfsm.ActState)
            act = type(leaf.command).__name__
            yield hfsm.Place((step.name, leaf.name), step.step, act), leaf.command


def _machine(step: hfsm.Step, *commands: rc.Command) -> hfsm.Machine:
    named = ((f"{type(c).__name__.lower()}{k}", c) for k, c in enumerate(commands))
    states = tuple(hfsm.ActState(*one) for one in named)
    return hfsm.Machine(" ".join((step.does, *step.things)), states[0].name, states, step=step)


def put(release: rc.Release) -> hfsm.Machine:
    """The root of a plan that puts a thing down."""
    step = _machine(hfsm.Step("place", (release.object,)), release)
    return hfsm.Machine("put", step.name, (step,))


def _move(side: Side) -> rc.MoveJoint:
    return rc.MoveJoint("m", side, tuple((0.1 * k,) * 8 for k in range(30)), 0.35)


def _taking(side: Side, object: str) -> hfsm.Machine:
    way = (rc.ApproachPoint(Pose((0.0, 0.0, 0.3)), 0.5),) * 3
    grasp = rc.Grasp("g", side, object, "g1", way, 0.7, 0.3, 0.3)
    up, back = rc.Segment((0.0, 0.0, 0.03), 0.1), rc.Segment((-0.28, 0.0, 0.0), 0.25)
    out = rc.MoveCartesian("c", side, (up, back))
    return _machine(hfsm.Step("take", (object,)), _move(side), grasp, out, _move(side))


def pour(seed: int = 1, *, queries: int = 320) -> Run:
    """The main job, done."""
    run = Run(seed)
    for agent in DESIGN.agents:
        run.samples.append(Sample(f"roco/{PREFIX}/_/alive/{agent}/1", b"", run.now, token=True))
        run.state(agent, DESIGN.agent(agent).initial)
    run.say("km", "ta", P.SUBSCRIBE, wm.ObserveWorld(), talk="km-1-1", protocol="subscribe")
    run.say("ta", "km", P.AGREE, talk="km-1-1", protocol="subscribe", silent="WM")
    run.state("ta", "surveying")
    run.acting(rc.Look("l", ((0.9, 0.4, 1.2), (0.8, -0.8, 0.8))), 5.0)
    run.observe("cabinet_2", "table_1", "table_2", "jar_1", "bowl_1")
    run.state("ta", "idle")
    run.wait(3.0)
    command = run.name("hi")
    run.say("hi", "co", P.REQUEST, PourInto("jar", "bowl"), talk=command, protocol="request")
    waits = cmd.TaskReport(cmd.TaskState.WAITING, (fact(Kind.IS_NEXT),))
    run.say("co", "hi", P.AGREE, waits, talk=command, protocol="request")
    run.wait(0.2)
    network = hfsm.GroundTaskNetwork("co-1-2", (hfsm.Task("pour", ("jar", "bowl")),))
    put = rc.Release("r", Side.RIGHT, "bowl_1", "table_1", Pose(BOWL_END), ())
    first = (
        _taking(Side.LEFT, "jar_1"),
        _taking(Side.RIGHT, "bowl_1"),
        _machine(hfsm.Step("place", ("bowl_1",)), put, rc.Look("l2", ((0.6, -0.5, 0.8),))),
    )
    plan = run.planning(network, queries, hfsm.Machine("pour", first[0].name, first), 7.5)
    lasts = {"MoveJoint": 7.0, "Grasp": 6.0, "Release": 8.0, "Look": 3.0}
    run.running(plan, sw.WorkerState.REPLAN, lasts)
    again = hfsm.GroundTaskNetwork("co-1-4", network.tasks)
    tilt = Pour("p", Side.LEFT, "jar_1", "bowl_1", 0.3, 0.0, (0.35, 2.35), 2.0, 0.2)
    second = (_machine(hfsm.Step("pour", ("jar_1", "bowl_1")), _move(Side.LEFT), tilt),)
    plan = run.planning(again, 22, hfsm.Machine("pour", second[0].name, second), 0.9)
    run.running(plan, sw.WorkerState.SUCCEEDED, {"MoveJoint": 6.0, "Pour": 11.0})
    done = cmd.TaskReport(cmd.TaskState.DONE, (fact(PourKind.ARRIVED, "bowl_1", 0.06),))
    run.say("co", "hi", P.INFORM, done, talk=command, protocol="request")
    run.wait(0.5)
    return run


def with_truth(past: History, states: Iterable[tuple[float, TrueState]]) -> History:
    """The history with these true states in place of its own."""
    others = (one for one in past.signals.houses if one.kind != "truth")
    return with_signals(
        past,
        *others,
        *(House("truth", "ex", "", at, msgspec.msgpack.encode(one)) for at, one in states),
    )


def with_signals(past: History, *houses: House) -> History:
    """The history with these signals in place of its own."""
    some = Signals(sorted(houses, key=lambda one: one.received), DECODERS)
    return msgspec.structs.replace(past, signals=some)


if __name__ == "__main__":
    import sys
    from pathlib import Path

    from operate.recording.recorder import Recorder

    recorder = Recorder(Path(sys.argv[1]), SYSTEM)
    for sample in pour().samples:
        recorder.take(sample)
    recorder.finish()

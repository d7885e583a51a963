"""Does tasks while something goes wrong, and compares the words of the robot with the truth.

Disturbance x task x seed, in two scenes and, for a door, in a third one. One process, as in
pour_one_process, with eyes by pixels. A disturbance begins before the act that it is about or
during a motion of that act. A sense fails from the first act of the task on, unless the case says
otherwise, and does not recover. Each run appends a line to a results file; runs that the file has
are skipped. The table has the newest run of each case in which the disturbance happened.

    python benchmarks/disturbed.py --seeds 1-3
    python benchmarks/disturbed.py --seeds 1 --cases "bowl pushed before,wrist zero" \\
        --acts pour,take --scenes env2
    python benchmarks/disturbed.py --seeds 1 --again "false failed,unsure"
    python benchmarks/disturbed.py --list
    python benchmarks/disturbed.py --table

`right done`, `right failed`: the words are true. `FALSE done`: the robot said "done", but the task
is not done. `false failed`: the task is done, but the robot said that it failed. `unsure`: the task
is done, and the robot said that it could not see or check it. `hang`: the run reached its limit of
simulated time. `drop`: a sense was faulty, and the jar or the bowl is on the floor. `crash`: an
exception ended the robot's process.
"""

import math
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
import mujoco
import numpy as np
import tables
import typer
from pour_one_process import Run

from companion.languages import facts, hfsm, rc
from companion.languages.cmd import BACK
from companion.languages.facts import Facts
from companion.sentences import operator
from companion.skills.loop_messages import KNOT_S, Motion
from companion.skills.situation import Eye
from companion.skills.skill import Asked, Sensed
from companion.tasks.open_door.done import OpenDoor
from companion.tasks.pour.done import Pour, PourKind
from services.executor.loop.core import LoopCore
from services.executor.simulation import InProcess
from services.task.outgoing_messages import SURVEY
from velma.model.build import Kind as Meets
from velma.model.kinds import Model
from velma.model.scene import CANONICAL, Scene, SceneObject, load, vary
from velma.model.scene_xml import scene_xml
from velma.names import COLUMNS, SIDES
from velma.sim import disturbances
from velma.sim.disturbances import Disturbance, Kind, Of
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import Truth

RESULTS = Path(__file__).parent / "results/disturbed.jsonl"
PAGE = Path(__file__).parents[1] / "docs/results/disturbances.md"
BEGIN, END = "<!-- disturbed: python benchmarks/disturbed.py --table -->\n", "<!-- /disturbed -->\n"
RUN = tables.commit()
JAR, BOWL, JAR_2, BOX, TABLE, CABINET = "jar_1", "bowl_1", "jar_2", "box_9", "table_1", "cabinet_2"
SPARE = {
    JAR_2: SceneObject(JAR_2, Model.JAR, (-2.0, 1.0, 0.101)),
    BOX: SceneObject(BOX, Model.BOX1, (-2.0, 0.5, 0.056)),
}
PUSH_M = 0.05  # as far as a passing arm pushes (estimate)
SETTLE_S = 1.2  # until what was disturbed before an act rests
LIMIT_S = 600.0  # simulated; estimate: a pour takes 70, with three plans 150
# as in tests/fleet/test_pour.py; until somebody takes the obstacle away (estimate)
KNOCK_S, OBSTACLE_S = 1.5, 5.0
BESIDE_M = 0.15  # of a person's hand from the way of the robot's; estimate
AHEAD_M = 0.15  # what stands in the way is at least so far from the hand at first; estimate
LEAST = 0.9  # of the content, that a pour moves, as the report demands
UPRIGHT_DEG, FLOOR_M, OPEN_RAD, FINGERS, NEAR_M, LEANS_DEG = 10.0, 0.3, 1.0, 2, 0.06, 45.0
"""Of what stands; of what fell; of an open door; links on a held thing; of what stands where it
stood; of what leans against a hand and is not held. Estimates.
"""
PARKED = np.array([-3.0, 0.0, 1.0])
Event = Callable[["Disturbed"], None]


class When(msgspec.Struct, frozen=True):
    """Moment of a disturbance: before the first act that `act` takes, or at a share of its first
    motion of `motion`.
    """

    act: Callable[["Disturbed", rc.Command], bool]
    motion: Callable[["Disturbed", Motion], bool] | None = None
    share: float = 0.5


class OverError(Exception):
    """Simulated time is over."""


class Body(InProcess):
    """Runs motions cycle by cycle, and does what is due at a time. `watch` is called with each
    motion before it.
    """

    def __init__(self, core: LoopCore, eye: Eye, watch: Callable[[Motion], None]) -> None:
        super().__init__(core, eye)
        self._watch = watch
        self._due: list[tuple[float, Callable[[], None]]] = []

    def do(self, motion: Motion, judge: Callable[[Sensed], Asked] | None = None) -> Sensed:
        """Run a motion to its end, then look; `judge`: as of InProcess. Raise OverError."""
        self._watch(motion)
        return super().do(motion, judge)

    def rest(self, seconds: float) -> None:
        """Let time pass without a motion."""
        for _ in range(math.ceil(seconds / self.core.backend.period_s)):
            self.cycle()

    def after(self, seconds: float, do: Callable[[], None]) -> None:
        """Do something at a later time."""
        self._due.append((self.core.state.time + seconds, do))

    def cycle(self) -> None:
        """Run a cycle, and let happen what is due. Raise OverError."""
        super().cycle()
        now = self.core.state.time
        for one in [one for one in self._due if one[0] <= now]:
            self._due.remove(one)
            one[1]()
        if now > LIMIT_S:
            raise OverError


class Disturbed(Run):
    """A run in which something happens once, at a moment of its task. `file`: what goes on, for the
    camera.
    """

    def __init__(
        self, scene: Scene, seed: int, case: "Case", name: str, file: Path, verbose: bool = False
    ) -> None:
        self.case, self.name, self.file = case, name, file
        self.armed = self.happened = False
        self.going_on: tuple[Disturbance, ...] = ()
        self.command: rc.Command = SURVEY
        super().__init__(scene, seed, verbose, backend=MujocoBackend(scene, crowded(scene)))
        self.body: Body = Body(self.body.core, self.body.eye, self._watch)
        self.rng = np.random.default_rng([seed, *name.encode(), *case.name.encode()])

    def act(self, command: rc.Command) -> rc.Done | rc.NotDone:
        """Perform a command; before or during it, let it happen."""
        self.command, when = command, self.case.moment(self.name)
        if self.armed and when.motion is None and when.act(self, command):
            self.happen()
            self.body.rest(SETTLE_S)
        return super().act(command)

    def _watch(self, motion: Motion) -> None:
        when = self.case.moment(self.name)
        if (
            self.armed
            and when.motion is not None
            and when.act(self, self.command)
            and when.motion(self, motion)
        ):
            self.armed = False
            self.body.after(when.share * seconds(motion), self.happen)

    def happen(self) -> None:
        """Let it happen, once."""
        self.armed, self.happened = False, True
        self.case.what(self)

    def begin(
        self, of: Of, kind: Kind, on: str = "", by: Iterable[float] = (), for_s: float | None = None
    ) -> None:
        """Begin a disturbance, for a time [s, simulated] or to the end."""
        one = Disturbance(
            f"{len(self.going_on)} {of} {kind}", of, kind, on, tuple(float(x) for x in by)
        )
        assert not (wrong := disturbances.wrong(one)), wrong
        self.set((*self.going_on, one))
        if for_s is not None:
            self.body.after(for_s, lambda: self.set(tuple(x for x in self.going_on if x != one)))

    def set(self, going_on: tuple[Disturbance, ...]) -> None:
        """Have this go on in the simulation, and in the camera's process."""
        self.going_on = going_on
        disturbances.write(self.file, going_on)
        self.backend.disturb(going_on)

    def stand(self, name: str, at: np.ndarray) -> None:
        """Have a post or a person's hand at a place (3,) [m, world] for a time."""
        places, place = self.backend.data.mocap_pos, self.backend.model.body(name).mocapid[0]
        places[place] = at
        self.body.after(OBSTACLE_S, lambda: places.__setitem__(place, PARKED))

    def holds(self, name: str) -> bool:
        """Whether the robot thinks that a hand holds this."""
        return self.here.holder(name) is not None

    def side(self) -> str:
        """Return the hand that moves now, or holds the jar."""
        return str(getattr(self.command, "side", "")) or self.here.holder(JAR) or "left"

    def hand_at(self, share: float) -> np.ndarray | None:
        """Return where (3,) [m, world] the hand of the present MoveJoint is at a share of its
        path.
        """
        if not isinstance(self.command, rc.MoveJoint):
            return None
        q, path = self.here.q.copy(), self.command.path
        q[COLUMNS[str(self.command.side)]] = path[
            min(len(path) - 1, round(share * (len(path) - 1)))
        ]
        return np.asarray(self.here.robot.grip(q, str(self.command.side)).translation)


def crowded(scene: Scene) -> mujoco.MjModel:
    """Return the model of a scene with a post and a person's hand, which the eyes do not see, far
    away.
    """
    spec = mujoco.MjSpec.from_string(scene_xml(scene))
    # radius, half the length; estimates
    for name, size in (("post", (0.03, 0.15)), ("hand", (0.04, 0.08))):
        body = spec.worldbody.add_body(name=name, mocap=True, pos=PARKED)
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[*size, 0.0])
        geom.contype, geom.conaffinity = (
            int(Meets.WORLD),
            int(Meets.ARM | Meets.HAND | Meets.OBJECT),
        )
    return spec.compile()


def seconds(motion: Motion) -> float:
    """Return how long a motion takes by its path [s]; 0 for one of a hand."""
    return (len(motion.path()) - 1) * KNOT_S


# --- moments --------------------------------------------------------------------------------------


def grasps(name: str) -> Callable[[Disturbed, rc.Command], bool]:
    """Return whether an act takes this thing."""
    return lambda _, command: isinstance(command, rc.Grasp) and command.object == name


def kind(*kinds: type[rc.Command]) -> Callable[[Disturbed, rc.Command], bool]:
    """Return whether an act is one of these."""
    return lambda _, command: isinstance(command, kinds)


def carries(run: Disturbed, command: rc.Command) -> bool:
    """Whether an act moves the hand that holds the jar: away, or where it is only taken, up."""
    kinds = rc.MoveCartesian if run.name in ("take", "open") else rc.MoveJoint
    return isinstance(command, kinds) and run.here.holder(JAR) == command.side


def reaches(run: Disturbed, command: rc.Command) -> bool:
    """Whether a hand moves freely, and farther than AHEAD_M: there is room for something in its
    way.
    """
    now, then = run.hand_at(0.0), run.hand_at(0.6)
    return now is not None and then is not None and float(np.linalg.norm(then - now)) > AHEAD_M


def any_act(_run: Disturbed, _command: rc.Command) -> bool:
    """Whether it is an act."""
    return True


def moving(_: Disturbed, motion: Motion) -> bool:
    """Whether a motion goes somewhere."""
    return seconds(motion) > 0.5


def tilting(run: Disturbed, motion: Motion) -> bool:
    """Whether a motion of a pour tilts: the one after which it holds."""
    return (
        isinstance(run.command, Pour)
        and moving(run, motion)
        and motion.settle_s == run.command.hold
    )


def leaving(run: Disturbed, motion: Motion) -> bool:
    """Whether a hand that has let go of the jar leaves it."""
    return moving(run, motion) and not run.holds(JAR)


TAKES = ("take", "pour", "bring", "open")
PLACES = ("carry", "put down", "put back", "swap")
ACTS = ("take", "carry", "put down", "put back", "pour", "open", "bring", "swap")
KEY: dict[str, Callable[[Disturbed, rc.Command], bool]] = {
    "take": grasps(JAR), "carry": carries, "put down": kind(rc.Release),
    "put back": kind(rc.Release), "pour": kind(Pour), "open": kind(OpenDoor), "bring": grasps(JAR),
    "swap": kind(rc.Release),
}  # fmt: skip
"""The act of a task that most disturbances are about."""
TAKE = hfsm.Task("take", (JAR, ""))
TASKS: dict[str, tuple[tuple[hfsm.Task, ...], hfsm.Task]] = {
    "take": ((), TAKE),
    "carry": ((), hfsm.Task("put_at", (JAR, "table"))),
    "put down": ((TAKE,), hfsm.Task("put_down", (JAR,))),
    "put back": ((TAKE,), hfsm.Task("put_at", (JAR, BACK))),
    "pour": ((), hfsm.Task("pour", (JAR, BOWL))),
    "open": ((), TAKE),
    "bring": ((), hfsm.Task("bring", (JAR, ""))),
    "swap": ((TAKE,), hfsm.Task("swap_hands", (JAR,))),
}
"""What is done before, undisturbed, and what is then asked for. A door is opened because the jar is
behind it.
"""
SCENES = {"canonical": tuple(a for a in ACTS if a != "open"),
          "env2": tuple(a for a in ACTS if a != "open"),
          "doors": ("open",)}  # fmt: skip


# --- what happens ---------------------------------------------------------------------------------


def pushed(name: str) -> Event:
    """Return a push of a thing in any direction; in the cabinet to its left or right."""

    def push(run: Disturbed) -> None:
        rotation, cabinet = run.truth.pose(CABINET)
        around = run.rng.uniform(0.0, math.tau)
        way = np.array([math.cos(around), math.sin(around), 0.0])
        local = rotation.T @ (run.truth.pose(name)[1] - cabinet)
        if abs(local[0]) < 0.2 and abs(local[1]) < 0.3 and abs(local[2]) < 0.35:
            way = run.rng.choice([-1.0, 1.0]) * rotation[:, 1]
        run.begin(Of.THING, Kind.PUSHED, name, PUSH_M * way)

    return push


def tipped(name: str) -> Event:
    """Return the fall of a thing, in any direction."""

    def tip(run: Disturbed) -> None:
        around = run.rng.uniform(0.0, math.tau)
        run.begin(Of.THING, Kind.TIPPED, name, (math.cos(around), math.sin(around), 0.0))

    return tip


def does(
    of: Of, what: Kind, on: str = "", by: tuple[float, ...] = (), for_s: float | None = None
) -> Event:
    """Return the beginning of a disturbance."""
    return lambda run: run.begin(of, what, on, by, for_s)


def box_on_place(run: Disturbed) -> None:
    """Put the box where a thing is to be put down; in the middle of the table where only that is
    known.
    """
    place = getattr(run.command, "place", None)
    at = run.truth.pose(TABLE)[1] if place is None else np.array(place.xyz)
    top = (
        surface(run, at, (TABLE,))
        if place is None
        else surface(run, at, ("table", "cabinet"), at[2] + 0.02)
    )
    run.begin(Of.THING, Kind.ADDED, BOX, (at[0], at[1], top + 0.056))


def surface(run: Disturbed, at: np.ndarray, of: tuple[str, ...], below: float = math.inf) -> float:
    """Return the height [m] of the highest board of furniture at a place that is below a height."""
    model, data = run.backend.model, run.backend.data
    tops = [0.0]
    for geom in range(model.ngeom):
        if model.body(model.geom_bodyid[geom]).name.startswith(of):
            half, local = (
                model.geom_size[geom],
                data.geom_xmat[geom].reshape(3, 3).T @ (at - data.geom_xpos[geom]),
            )
            top = float(data.geom_xpos[geom][2] + half[2])
            if (np.abs(local[:2]) < half[:2]).all() and top < below:
                tops.append(top)
    return max(tops)


def second_jar(run: Disturbed) -> None:
    """Put another jar on the table, empty."""
    rotation, at = run.truth.pose(TABLE)
    place = at + rotation @ np.array([-0.2, 0.2, 0.0])
    run.begin(
        Of.THING, Kind.ADDED, JAR_2, (place[0], place[1], surface(run, place, (TABLE,)) + 0.101)
    )


def moved(name: str) -> Event:
    """Return the shift of furniture with all on it, to the left or right."""
    return lambda run: run.begin(
        Of.THING, Kind.MOVED, name, (0.0, float(run.rng.choice([-1.0, 1.0])) * PUSH_M, 0.0)
    )


def in_the_way(run: Disturbed) -> None:
    """Have a post in the way of the hand."""
    at = run.hand_at(0.6)
    assert at is not None
    run.stand("post", at)


def person(run: Disturbed) -> None:
    """Have a person's hand beside the way of the robot's."""
    first, at = run.hand_at(0.3), run.hand_at(0.6)
    assert first is not None
    assert at is not None
    beside = np.cross(at - first, (0.0, 0.0, 1.0))
    run.stand("hand", at + BESIDE_M * beside / max(1e-6, float(np.linalg.norm(beside))))


def of_arm(of: Of, what: Kind) -> Event:
    """Return a fault of the elbow of the arm that moves."""
    return lambda run: run.begin(of, what, f"{run.side()}_arm_3_joint")


def stiff_finger(run: Disturbed) -> None:
    """Have a finger of the hand that moves stick."""
    run.begin(Of.FINGER, Kind.STICKS, f"{run.side()} One")


class Case(msgspec.Struct, frozen=True):
    """A disturbance: what happens, in which tasks, and when in each: at `when`, else before the
    task's key act.
    """

    name: str
    what: Event
    acts: tuple[str, ...] = ACTS
    when: dict[str, When] = {}
    sense: bool = False

    def moment(self, act: str) -> When:
        """Return its moment in a task."""
        return self.when.get(act, When(KEY[act]))


def at(when: When, acts: Iterable[str] = ACTS) -> dict[str, When]:
    """Return the same moment for tasks."""
    return dict.fromkeys(acts, when)


def before(name: str) -> dict[str, When]:
    """Return the moment before this thing is taken, where it is."""
    return at(When(grasps(name)), TAKES if name == JAR else ("pour",))


def during(name: str) -> dict[str, When]:
    """Return half of the way to this thing, else half of the first motion of the key act."""
    return {act: When(KEY[act], moving) for act in ACTS} | {
        act: When(grasps(name), moving) for act in (TAKES if name == JAR else ("pour",))
    }


CARRY, REACH, PUTS = When(carries, moving), When(reaches, moving, 0.0), When(kind(rc.Release))
TILT, RELEASE = When(kind(Pour), tilting), When(kind(rc.Release), leaving, 0.3)
START = at(When(any_act))
CASES = {
    one.name: one
    for one in (
        Case("nothing", lambda _: None),
        Case("jar pushed before", pushed(JAR), TAKES, before(JAR)),
        Case("jar pushed during", pushed(JAR), TAKES, during(JAR)),
        Case("jar removed", does(Of.THING, Kind.REMOVED, JAR), TAKES, before(JAR)),
        Case("jar tipped before", tipped(JAR), TAKES, before(JAR)),
        Case("bowl pushed before", pushed(BOWL), when=before(BOWL)),
        Case("bowl pushed during", pushed(BOWL), when=during(BOWL)),
        Case("bowl removed", does(Of.THING, Kind.REMOVED, BOWL), when=before(BOWL)),
        Case("bowl tipped before", tipped(BOWL), when=before(BOWL)),
        Case("bowl pushed before the tilt", pushed(BOWL), ("pour",)),
        Case("bowl pushed during the tilt", pushed(BOWL), ("pour",), {"pour": TILT}),
        Case("bowl removed during the tilt", does(Of.THING, Kind.REMOVED, BOWL), ("pour",),
             {"pour": TILT}),
        Case("jar toppled as the hand lets go", tipped(JAR), PLACES, at(RELEASE)),
        Case("jar struck out of the hand", does(Of.HANDS, Kind.SLIPPERY, for_s=KNOCK_S),
             when=at(CARRY)),
        Case("post in the arm's way", in_the_way, when=at(REACH)),
        Case("a person's hand near", person, when=at(REACH)),
        Case("box on the place", box_on_place, (*PLACES, "pour"), at(PUTS)),
        Case("table moved", moved(TABLE)),
        Case("cabinet moved", moved(CABINET), when=before(JAR)),
        Case("grains four times as heavy", does(Of.GRAINS, Kind.HEAVY), when=START),
        Case("a second jar", second_jar, when=START),
        Case("lights low", does(Of.CAMERA, Kind.DIMMED), when=START, sense=True),
        Case("camera black", does(Of.CAMERA, Kind.BLACK), when=START, sense=True),
        Case("camera frozen", does(Of.CAMERA, Kind.FROZEN), when=START, sense=True),
        Case("camera mirrored", does(Of.CAMERA, Kind.MIRRORED), when=START, sense=True),
        Case("camera black from the act on", does(Of.CAMERA, Kind.BLACK), (*PLACES, "pour"),
             sense=True),
        Case("camera frozen from the act on", does(Of.CAMERA, Kind.FROZEN), (*PLACES, "pour"),
             sense=True),
        Case("wrist zero", does(Of.WRIST, Kind.ZERO), when=START, sense=True),
        Case("wrist stuck", does(Of.WRIST, Kind.STUCK), when=START, sense=True),
        Case("wrist nan", does(Of.WRIST, Kind.NAN), when=START, sense=True),
        Case("wrist off by 3 N", does(Of.WRIST, Kind.BIAS), when=START, sense=True),
        Case("wrist off by 3 N while it carries", does(Of.WRIST, Kind.BIAS), when=at(CARRY),
             sense=True),
        Case("elbow encoder off by 0.05 rad", of_arm(Of.ENCODER, Kind.BIAS), when=START,
             sense=True),
        Case("elbow encoder stuck", of_arm(Of.ENCODER, Kind.STUCK), when=START, sense=True),
        Case("elbow sticks", of_arm(Of.JOINT, Kind.STICKS), when=START),
        Case("a finger sticks", stiff_finger, when=START),
        Case("fingers read zero", does(Of.GRIP, Kind.ZERO), when=START, sense=True),
        Case("fingers read stuck", does(Of.GRIP, Kind.STUCK), when=START, sense=True),
    )
}  # fmt: skip


# --- the truth ------------------------------------------------------------------------------------


def stands(truth: Truth, name: str) -> bool:
    """Whether a thing stands upright above the floor, in no hand."""
    free = max(truth.fingers_on[name].values()) == 0
    return free and truth.tilt_deg[name] < UPRIGHT_DEG and truth.at[name][2] > FLOOR_M


def hand_of(truth: Truth, name: str) -> str:
    """Return the side that holds a thing, "" for none."""
    links, side = max((truth.fingers_on[name][side], side) for side in SIDES)
    return side if links >= FINGERS else ""


def taken(truth: Truth, first: Truth) -> bool:
    """Whether a hand holds the jar, and took it away from where it stood. One that leans against a
    hand is not held.
    """
    away = math.dist(truth.at[JAR], first.at[JAR]) > NEAR_M
    return bool(hand_of(truth, JAR)) and away and truth.tilt_deg[JAR] < LEANS_DEG


def goal(run: Disturbed, act: str, first: Truth, held: str) -> bool:
    """Return whether a task is truly done. `first`: at the beginning, `held`: in which hand the jar
    was then.
    """
    truth = run.truth.read()
    match act:
        case "take" | "bring":
            return taken(truth, first)
        case "open":
            return (
                taken(truth, first)
                and max(abs(angle(run, name)) for name in ("door_1", "door_2")) > OPEN_RAD
            )
        case "carry":
            away = run.truth.pose(TABLE)[0].T @ (np.array(truth.at[JAR]) - run.truth.pose(TABLE)[1])
            return stands(truth, JAR) and bool(np.hypot(*away[:2]) < 0.65)
        case "put down":
            return stands(truth, JAR)
        case "put back":
            near = math.dist(truth.at[JAR], first.at[JAR]) < NEAR_M
            return stands(truth, JAR) and near
        case "pour":
            return (
                truth.grains_in[BOWL] >= LEAST * truth.grains and truth.tilt_deg[BOWL] < UPRIGHT_DEG
            )
        case _:
            return taken(truth, first) and hand_of(truth, JAR) != held


def angle(run: Disturbed, name: str) -> float:
    """Return how far a door is open [rad]."""
    return float(run.backend.data.qpos[run.backend.model.joint(name).qposadr[0]])


def judged(said: str, why: Facts, good: bool, dropped: bool) -> str:
    """Return the verdict on what the robot said, and why. `good`: the task is truly done;
    `dropped`: see above.
    """
    if said.startswith("crash"):
        return "crash"
    if said == OVER:
        return "hang"
    if dropped:
        return "drop"
    if said == "done":
        return "right done" if good else "FALSE done"
    if not good:
        return "right failed"
    return (
        "unsure" if any(one.kind in UNSURE for one in facts.with_reasons(why)) else "false failed"
    )


OVER = "simulated time is over"
UNSURE = (PourKind.NOT_SEEN_IN, facts.Kind.NOT_CHECKED, facts.Kind.UNCHECKABLE)
"""Facts that say that it is not known whether the task is done."""
HOPELESS = dict.fromkeys(
    ("jar removed", "jar tipped before", "jar struck out of the hand",
     "jar toppled as the hand lets go",
     "bowl removed during the tilt"), ACTS,
) | dict.fromkeys(("bowl removed", "bowl tipped before"), ("pour",))  # fmt: skip
"""Case -> tasks that nobody could do then: the thing is gone, lies, or fell to the floor."""
VERDICTS = (
    "right done",
    "right failed",
    "unsure",
    "false failed",
    "FALSE done",
    "drop",
    "hang",
    "crash",
)


def measured(
    scene: str, act: str, case: Case, seed: int, folder: Path, verbose: bool = False
) -> dict[str, Any]:
    """Return one run, as a line of the results file."""
    began, file = time.perf_counter(), folder / "disturbances.json"
    file.unlink(missing_ok=True)
    spare = (SPARE[BOX], SPARE[JAR_2]) if case.name == "a second jar" else (SPARE[BOX],)
    world = vary(load(CANONICAL.with_stem(scene)), seed)
    run = Disturbed(
        msgspec.structs.replace(world, things=(*world.things, *spare)),
        seed,
        case,
        act,
        file,
        verbose,
    )
    first, held = run.truth.read(), ""
    why: Facts = ()
    try:
        run.act(SURVEY)
        before, task = TASKS[act]
        for one in before:
            why = why or run.carry_out(one)
        held = hand_of(run.truth.read(), JAR)
        run.armed = not why
        why = why or run.carry_out(task)
        said = operator(why) or "done"
    except OverError:
        said = OVER
    except Exception as error:
        said = f"crash: {type(error).__name__}: {error}"
    finally:
        run.body.eye.close()
    truth = run.truth.read()
    fallen = [name for name in (JAR, BOWL) if truth.at[name][2] < FLOOR_M]
    good = goal(run, act, first, held)
    return {
        "scene": scene, "act": act, "case": case.name, "seed": seed, "happened": run.happened,
        "said": said,
        "verdict": judged(said, why, good, case.sense and bool(fallen)), "good": good,
        "fallen": fallen,
        "at": {name: [round(x, 3) for x in truth.at[name]] for name in (JAR, BOWL)},
        "tilt_deg": {name: round(truth.tilt_deg[name], 1) for name in (JAR, BOWL)},
        "grains": truth.grains,
        "grains_in": truth.grains_in, "held_by": {name: hand_of(truth,
                                                                name) for name in (JAR, BOWL)},
        "ill": [f"{one.sense} {one.fault}" for one in run.here.ill], "plans": run.planned,
        "acts": len(run.acts),
        "sim_time_s": round(float(run.body.core.state.time), 1),
        "wall_s": round(time.perf_counter() - began, 1),
        "commit": RUN,
    }  # fmt: skip


# --- the table ------------------------------------------------------------------------------------


def printed(lines: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the table of verdicts by disturbance, the same by act, and below the words of what was
    wrong.
    """
    lines = [line for line in lines if line["happened"]]
    yield from counted("what happens", lines, "case", CASES)
    yield ""
    yield from counted("task", lines, "act", ACTS)
    yield ""
    could = [line for line in lines if line["act"] not in HOPELESS.get(line["case"], ())]
    done = sum(line["good"] for line in could)
    share = 100 * done / max(1, len(could))
    yield (
        f"Of the {len(could)} runs in which the task could be done, it is done in {done}"
        f" ({share:.1f} %)."
    )
    yield ""
    wrong: dict[str, list[str]] = {}
    for line in lines:
        if line["verdict"] not in ("right done", "right failed"):
            words = f"{line['verdict']}: {line['case']}, {line['act']}: {line['said']}"
            wrong.setdefault(words, []).append(f"{line['scene']} {line['seed']}")
    for words, of in sorted(wrong.items()):
        yield f"- {words} ({', '.join(of)})"


def counted(
    head: str, lines: list[dict[str, Any]], field: str, values: Iterable[str]
) -> Iterator[str]:
    """Yield a table of how many runs of each value of a field ended how."""
    yield f"| {head} | runs | {' | '.join(VERDICTS)} |"
    yield "|---" * (len(VERDICTS) + 2) + "|"
    for value in values:
        ran = Counter(line["verdict"] for line in lines if line[field] == value)
        if ran:
            yield (
                f"| {value} | {ran.total()} |"
                f" {' | '.join(str(ran[verdict]) for verdict in VERDICTS)} |"
            )


def key(line: dict[str, Any]) -> tuple[str, str, str, int]:
    """Return what a run is one of."""
    return line["scene"], line["act"], line["case"], line["seed"]


def rows(scenes: str, acts: str, cases: str, seeds: str) -> Iterator[tuple[str, str, str, int]]:
    """Yield all runs that are asked for."""
    for seed in tables.seeds(seeds):
        for scene in scenes.split(","):
            for case in cases.split(","):
                yield from ((scene, act, case, seed) for act in SCENES[scene]
                            if act in acts.split(",") and act in CASES[case].acts)  # fmt: skip


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-3",
    cases: Annotated[str, typer.Option(help="names of --list, with commas between")] = ",".join(
        CASES
    ),
    acts: Annotated[str, typer.Option(help=", ".join(ACTS))] = ",".join(ACTS),
    scenes: Annotated[str, typer.Option(help=", ".join(SCENES))] = ",".join(SCENES),
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    again: Annotated[
        str, typer.Option(help="run again what another version ran with one of these verdicts")
    ] = "",
    verbose: Annotated[bool, typer.Option("--verbose", help="tell each act")] = False,
    names: Annotated[bool, typer.Option("--list", help="list the disturbances, and end")] = False,
    table: Annotated[
        bool, typer.Option("--table", help="write docs/results/disturbances.md, and end")
    ] = False,
) -> None:
    """Run what does not stand in the results file yet."""
    if names:
        typer.echo("\n".join(f"{one.name}: {', '.join(one.acts)}" for one in CASES.values()))
        return
    lines = list({key(line): line for line in tables.read(out) if "act" in line}.values())
    if table:
        tables.put(PAGE, BEGIN, "\n".join(printed(lines)) + "\n", END)
        return
    for given, there in ((cases, CASES), (acts, ACTS), (scenes, SCENES)):
        if unknown := [one for one in given.split(",") if one not in there]:
            raise typer.BadParameter(f"{', '.join(unknown)}: there are {', '.join(there)}")
    old = [line for line in lines if line["verdict"] in again.split(",") and line["commit"] != RUN]
    known = {key(line) for line in lines if line not in old}
    with tempfile.TemporaryDirectory() as folder:
        os.environ[disturbances.VARIABLE] = str(Path(folder) / "disturbances.json")
        for scene, act, case, seed in rows(scenes, acts, cases, seeds):
            if (scene, act, case, seed) not in known:
                line = measured(scene, act, CASES[case], seed, Path(folder), verbose)
                tables.append(out, line)
                did = "" if line["happened"] else ", did not happen"
                words = (
                    f"{line['verdict']}{did}: {line['said']} ({line['sim_time_s']} s, wall"
                    f" {line['wall_s']} s)"
                )
                typer.echo(f"{scene}, {act}, {case}, seed {seed}: {words}")


if __name__ == "__main__":
    typer.run(main)

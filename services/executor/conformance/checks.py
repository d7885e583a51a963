"""The properties that the executor relies on: a table of checks, and how each is measured.

A check measures how far a back-end is from a property; more than the limit fails. docs/back-ends.md
is the contract.
"""

import math
import mmap
import os
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np

from companion.skills.loop_messages import Mode, Motion, Phase, motion
from services.executor.conformance.subject import Bench, Subject, bench, dynamics
from services.executor.loop.act import BRAKE_S
from services.executor.loop.core import DAMPING_CYCLES, LoopCore
from services.executor.loop.link import AgentLink, LoopLink, StopLink
from services.executor.loop.process import GONE_TURNS, LATE_TURNS, LoopProcess, Speed
from velma.control import safety
from velma.names import (
    BODY,
    DISTAL_UPPER,
    FINGER_UPPER,
    HEAD_LOWER,
    HEAD_SPEED,
    HEAD_UPPER,
    LOWER,
    SIDES,
    SPREAD_UPPER,
    TORQUE,
    UPPER,
    Array,
)
from velma.sim.backend import PERIOD_S, Backend, Command, State

Measured = tuple[float, str]  # how far from the property, in the check's unit; where, in words


class Check(msgspec.Struct, frozen=True):
    """One property: in words, its limit with the source, the remedy if it does not hold, how it is
    measured.
    """

    name: str
    area: str
    says: str
    limit: float
    unit: str
    source: str
    remedy: str
    measure: Callable[[Subject], Measured]
    rough: bool = False  # pushes joints to their ends: left out with --gentle
    most_s: float = 45.0

    def __str__(self) -> str:
        return self.name


# --- Time: one period a cycle, no call that blocks the loop, no memory that grows -----------------

LATE_PERIODS = 5


def period(subject: Subject) -> Measured:
    """How far the period is from that of the control laws [s]."""
    with bench(subject) as robot:
        return abs(robot.backend.period_s - PERIOD_S), f"period_s is {robot.backend.period_s} s"


def coming_back(subject: Subject) -> Measured:
    """How long observe and step together block the caller: the third longest time of 200 [s]."""
    took = []
    with bench(subject) as robot:
        for _ in range(200):
            began = time.monotonic()
            robot.backend.step(robot.command)
            robot.backend.observe()
            took.append(time.monotonic() - began)
    told = f"of 200 cycles, the two longest left out; the longest {max(took):.3f} s"
    return sorted(took)[-3], told


def passing(subject: Subject) -> Measured:
    """The largest difference between a step of the state's time and the period [s]."""
    with bench(subject) as robot:
        told = [float(robot.backend.observe().time)]
        told += [float(state.time) for state in robot.steps(1.0)]
        off = np.abs(np.diff(told) - robot.backend.period_s)
    k = int(np.argmax(off))
    return float(off[k]), f"cycle {k}: from {told[k]:.6f} s to {told[k + 1]:.6f} s"


def passing_on_the_whole(subject: Subject) -> Measured:
    """How far the state's time is from the number of cycles after a second, as a share."""
    with bench(subject) as robot:
        began = float(robot.backend.observe().time)
        times = [float(state.time) for state in robot.steps(1.0)]
        gone, asked = times[-1] - began, len(times) * robot.backend.period_s
    return abs(gone / asked - 1.0), f"{gone:.4f} s in {len(times)} cycles"


def cost(subject: Subject) -> Measured:
    """The median time that observe and step take of a cycle [ms]."""
    took = []
    with bench(subject) as robot:
        for _ in range(400):
            began = time.perf_counter()
            robot.backend.observe()
            robot.backend.step(robot.command)
            took.append(1e3 * (time.perf_counter() - began))
    return float(np.median(took)), f"p99 {np.percentile(took, 99):.2f} ms"


def memory(subject: Subject) -> Measured:
    """The memory that 1000 cycles leave behind [bytes]."""
    with bench(subject) as robot:
        for _ in robot.wave(0.4):
            pass
        tracing = tracemalloc.is_tracing()
        if not tracing:
            tracemalloc.start()
        try:
            for _ in robot.wave(0.2):
                pass
            before = tracemalloc.get_traced_memory()[0]
            for _ in robot.wave(2.0):
                pass
            left = tracemalloc.get_traced_memory()[0] - before
        finally:
            if not tracing:
                tracemalloc.stop()
    return float(max(0, left)), "of Python and NumPy; what a driver in C takes is not seen"


class Listening:
    """A back-end that records the commands of the loop, and the speeds at which they were sent."""

    def __init__(self, backend: Backend) -> None:
        self._backend, self.period_s = backend, backend.period_s
        self.taus: list[Array] = []
        self.speeds: list[Array] = []

    def observe(self) -> State:
        """The state."""
        return self._backend.observe()

    def step(self, command: Command) -> None:
        """Record the command and pass it on."""
        self.speeds.append(self._backend.observe().v.copy())
        self.taus.append(command.tau.copy())
        self._backend.step(command)

    def configuration(self) -> Array:
        """The coordinates of the world model."""
        return self._backend.configuration()

    @property
    def work_J(self) -> float:
        """Work so far [J]."""
        return self._backend.work_J


class Slow(Listening):
    """A back-end with one late step."""

    late = 10

    def step(self, command: Command) -> None:
        """Pass the command on; one step takes some periods longer."""
        self.late -= 1
        if self.late == 0:
            time.sleep(LATE_PERIODS * self.period_s)
        super().step(command)


def late(subject: Subject) -> Measured:
    """What the loop's figures miss of a late cycle: one of twenty steps takes some periods
    longer.
    """
    with bench(subject) as robot:
        slow, pacer = Slow(robot.backend), subject.pacer(robot.backend.period_s)
        for _ in range(20):
            pacer.wait()
            slow.observe()
            slow.step(robot.command)
            pacer.done()
    told = pacer.timing()
    longest = told.compute_us.get("max", 0.0)
    missed = (told.missed < 1) + (longest < 1e6 * LATE_PERIODS * slow.period_s)
    return missed, f"{told.missed} missed, the longest cycle {1e-3 * longest:.1f} ms"


# --- Readings: true, up to date, in the right units, order and sign -------------------------------

PAIR, HANDS = (2,), (2, 3)
SHAPES = {"q": (15,), "v": (15,), "head": PAIR, "spread": PAIR, "proximal": HANDS, "distal": HANDS}
WRIST = (2, 6)
RANGES: dict[str, tuple[Array | float, Array | float]] = {
    "q": (LOWER, UPPER),
    "head": (HEAD_LOWER, HEAD_UPPER),
    "spread": (0.0, SPREAD_UPPER),
    "proximal": (0.0, FINGER_UPPER),
    "distal": (0.0, DISTAL_UPPER),
}
FINGERS = ("proximal", "distal", "spread")
WINDOW = 50  # cycles over which positions and speeds must agree: noise and quantisation average out
ROUNDING = 0.1  # of the distance: what a filter of the speed may cost


def copied(state: State) -> dict[str, Array]:
    """A copy of the arrays of a state and its time."""
    return {name: np.array(getattr(state, name), dtype=np.float64) for name in (*SHAPES, "time")}


def outside(state: State, names: Iterable[str] = RANGES) -> Measured:
    """How far the farthest reading is outside the range of its joint [rad]."""
    worst, where = 0.0, "all inside"
    for name in names:
        low, high = RANGES[name]
        value = getattr(state, name)
        excess = float(np.max(np.maximum(value - high, low - value)))
        if not excess <= worst:
            worst, where = excess, f"{name} at {state.time:.3f} s"
    return worst, where


def form(subject: Subject) -> Measured:
    """The number of fields that are not float64 arrays of their shape."""
    with bench(subject) as robot:
        state = robot.step()
        wrong = [
            f"{name} is {getattr(value, 'dtype', type(value).__name__)}"
            f" {getattr(value, 'shape', '')}"
            for name, shape in SHAPES.items()
            if not isinstance(value := getattr(state, name), np.ndarray)
            or value.shape != shape
            or value.dtype != np.float64
        ]
        wrong += [] if isinstance(state.time, float) else [f"time is {type(state.time).__name__}"]
        if state.wrist is not None and np.shape(state.wrist) != WRIST:
            wrong.append(f"wrist is {np.shape(state.wrist)}")
        model = robot.backend.configuration()
        if model.ndim != 1 or model.dtype != np.float64:
            wrong.append(f"configuration is {model.dtype} {model.shape}")
    return len(wrong), "; ".join(wrong) or "all as documented"


def numbers(subject: Subject) -> Measured:
    """The number of cycles, in two seconds at rest and in motion, with a reading that is not a
    number.
    """
    with bench(subject) as robot:
        size = robot.backend.configuration().size
        good = [_finite(robot, state) for state in robot.steps(1.0)]
        good += [_finite(robot, state) for state in robot.wave(1.0)]
        same = robot.backend.configuration().size == size
    if not all(good):
        return good.count(False), f"first in cycle {good.index(False)}"
    return int(not same), "always numbers" if same else "the configuration changed its size"


def _finite(robot: Bench, state: State) -> bool:
    read = all(np.isfinite(getattr(state, name)).all() for name in (*SHAPES, "time"))
    felt = state.wrist is None or bool(np.isfinite(state.wrist).all())
    return read and felt and bool(np.isfinite(robot.backend.configuration()).all())


def inside(subject: Subject) -> Measured:
    """How far outside its joint ranges the robot says it starts [rad]."""
    with bench(subject) as robot:
        return outside(robot.backend.observe())


def looking(subject: Subject) -> Measured:
    """What observing twice changes."""
    with bench(subject) as robot:
        for _ in robot.wave(0.1):
            first = copied(robot.backend.observe())
            second = copied(robot.backend.observe())
            worst = max(float(np.abs(first[name] - second[name]).max()) for name in first)
            if not worst <= 0.0:
                return worst, f"at {float(first['time']):.3f} s"
    return 0.0, "nothing"


def resting(subject: Subject) -> Measured:
    """How far the body moves in a second without torque [rad]."""
    with bench(subject) as robot:
        began = robot.backend.observe().q.copy()
        moved = np.max([np.abs(state.q - began) for state in robot.steps(1.0)], axis=0)
    return float(moved.max()), BODY[int(moved.argmax())]


def own_joint(subject: Subject) -> Measured:
    """The number of joints that a positive torque does not move in the positive direction."""
    wrong = []
    with bench(subject) as robot:
        for joint, name in enumerate(BODY):
            began = float(robot.backend.observe().q[joint])
            for state in robot.push(joint, 0.1):  # noqa: B007  (the last one counts)
                pass
            if not (state.q[joint] - began > 1e-4 and state.v[joint] > 0.0):
                wrong.append(
                    f"{name} by {state.q[joint] - began:+.4f} rad at {state.v[joint]:+.3f} rad/s"
                )
            robot.calm()
    return len(wrong), "; ".join(wrong) or "all 15 joints"


def agreeing(subject: Subject) -> Measured:
    """How far positions and integrated speeds differ within a window, beyond the cost of a filter
    [rad].
    """
    with bench(subject) as robot:
        rows = [(state.q.copy(), state.v.copy()) for state in robot.wave(1.0)]
        dt = robot.backend.period_s
    q, v = (np.array(column) for column in zip(*rows, strict=True))
    mean = (v[1:] + v[:-1]) / 2 * dt
    worst, where = 0.0, "all joints"
    for k in range(0, len(q) - WINDOW, WINDOW):
        part = mean[k : k + WINDOW]
        off = np.abs(q[k + WINDOW] - q[k] - part.sum(0)) - ROUNDING * np.abs(part).sum(0)
        if not off.max() <= worst:
            worst, where = float(off.max()), f"{BODY[int(off.argmax())]} after {k} cycles"
    return worst, where


def fresh(subject: Subject) -> Measured:
    """The number of cycles until a torque shows in the speed of its joint."""
    worst, where = 0, ""
    with bench(subject) as robot:
        for joint in (0, 1, 7, 8, 14):
            robot.calm()
            before = float(robot.backend.observe().v[joint])
            seen = next(
                (k for k, s in enumerate(robot.push(joint, 0.1)) if s.v[joint] - before > 1e-3), 99
            )
            worst, where = max((worst, where), (seen + 1, BODY[joint]))
    return worst, where


def head(subject: Subject) -> Measured:
    """The error of pan and tilt, moved one after the other [rad]."""
    with bench(subject) as robot:
        goal = robot.command.head.copy()
        off = []
        for move in ((0.3, 0.0), (0.0, 0.2)):
            goal = goal + move
            off.append(np.abs(robot.towards("head", goal, 0.5).head - goal))
    return float(np.max(off)), ("pan", "tilt")[int(np.max(off, axis=0).argmax())]


def hands(subject: Subject) -> Measured:
    """The error of the fingers, hand by hand, while the other hand has to stay [rad]."""
    worst, where = 0.0, ""
    with bench(subject) as robot:
        goals = {name: getattr(robot.command, name).copy() for name in FINGERS}
        for row, side in enumerate(SIDES):
            rows = (("spread", 0.3, 0.7), ("proximal", 0.6, 1.0), ("distal", 0.2, 0.33))
            for name, move, speed in rows:
                goals[name][row] += move
                state = robot.towards(name, goals[name], speed)
            for name, goal in goals.items():
                off = float(np.abs(getattr(state, name) - goal).max())
                worst, where = max((worst, where), (off, f"{name} after the {side} hand moved"))
    return worst, where


def locks(subject: Subject) -> Measured:
    """How far locked fingers move when commanded to close by 0.6 rad [rad]."""
    with bench(subject) as robot:
        robot.command.locked[:] = 1.0
        for _ in robot.steps(0.1):
            pass
        began = robot.backend.observe().proximal.copy()
        state = robot.towards("proximal", robot.command.proximal + 0.6, 1.0)
        moved = np.abs(state.proximal - began)
    return float(moved.max()), f"{SIDES[int(moved.max(axis=1).argmax())]} hand"


def work(subject: Subject) -> Measured:
    """The number of cycles in which the work fell or was not a number; one more if motion cost no
    work.
    """
    with bench(subject) as robot:
        told = [robot.backend.work_J, *(robot.backend.work_J for _ in robot.wave(0.5))]
    wrong = int((~(np.diff(told) >= 0.0)).sum())
    return wrong + (not told[-1] > told[0]), f"{told[0]:.3f} J to {told[-1]:.3f} J"


# --- Limits: the loop limits its commands, the back-end its joints --------------------------------


SERVOS = ("head", "spread", "proximal", "distal")


def accepted(subject: Subject) -> Measured:
    """The largest command of a motion that is much too fast, as a share of what the lower level
    accepts.
    """
    with bench(subject) as robot:
        heard = Listening(robot.backend)
        core = subject.core(heard, dynamics=dynamics())
        jerk = core.setpoint + np.linspace(0.0, 0.5, 6)[:, None] * np.where(
            core.setpoint > 0.0, -1.0, 1.0
        )
        core.begin(motion("too fast", jerk, tolerance_m=10.0))
        for _ in range(150):
            core.cycle()
    share = np.abs(np.array(heard.taus)) / TORQUE
    if not np.isfinite(share).all():
        return float("nan"), "a command was not a number"
    k, joint = np.unravel_index(int(share.argmax()), share.shape)
    return float(share[k, joint]), f"{BODY[joint]} in cycle {k}"


def ends(subject: Subject) -> Measured:
    """How far joints leave their ranges when all are pushed one way, then the other [rad]."""
    worst: Measured = 0.0, "all inside"
    with bench(subject) as robot:
        for sign in (1.0, -1.0):
            robot.command.tau[:] = sign * subject.push * TORQUE
            worst = max(worst, max(outside(state, ("q",)) for state in robot.steps(3.0)))
    return worst


def servo_ends(subject: Subject) -> Measured:
    """How far head and fingers leave their ranges when their targets do [rad]."""
    worst: Measured = 0.0, "all inside"
    with bench(subject) as robot:
        reach = HEAD_SPEED * robot.backend.period_s
        for goal in (4.0, -4.0):
            for _ in robot.steps(8.0):
                for name in SERVOS:
                    target = getattr(robot.command, name)
                    target += np.clip(goal - target, -reach, reach)
                worst = max(worst, outside(robot.backend.observe(), SERVOS))
    return worst


# --- The robot stops: for a person, after a fault, and when nobody commands it any more -----------

REACH = 0.1  # rad, of the motion that is stopped


class Broken(Listening):
    """A back-end that fails on demand: observe raises ("throws") or gives NaN ("lies"); step raises
    ("stepped").
    """

    def __init__(self, backend: Backend) -> None:
        super().__init__(backend)
        self.how = ""

    def observe(self) -> State:
        """The state, or fail."""
        state = super().observe()
        if self.how == "throws":
            raise RuntimeError("the conformance kit takes the sensors away")
        if self.how != "lies":
            return state
        lie = state.v.copy()  # the robot's own arrays stay as they are
        lie[3] = np.nan
        return msgspec.structs.replace(state, v=lie)

    def step(self, command: Command) -> None:
        """Pass the command on, or fail."""
        if self.how == "stepped":
            raise RuntimeError("the conformance kit takes the drives away")
        super().step(command)


def rising(core: LoopCore, seconds: float = 1.0) -> Motion:
    """A smooth motion of all body joints by REACH."""
    u = np.linspace(0, 1, round(100 * seconds) + 1)
    return motion("rise", core.setpoint + REACH * (u**3 * (10 - 15 * u + 6 * u * u))[:, None])


@contextmanager
def moving(subject: Subject) -> Iterator[tuple[LoopCore, Broken, Bench]]:
    """Yield a loop on the back-end in the middle of a motion, and the record of its commands."""
    with bench(subject) as robot:
        heard = Broken(robot.backend)
        core = subject.core(heard, dynamics=dynamics())
        core.begin(rising(core))
        cycles(core, subject, 250)
        yield core, heard, robot


def cycles(core: LoopCore, subject: Subject, count: int) -> None:
    """Run this number of cycles, in real time if the robot needs it."""
    for _ in range(count):
        began = time.monotonic()
        core.cycle()
        if subject.paced:
            time.sleep(max(0.0, began + core.backend.period_s - time.monotonic()))


def _speed(core: LoopCore, subject: Subject, count: int) -> float:
    worst = 0.0
    for _ in range(count):
        cycles(core, subject, 1)
        worst = max(worst, float(np.abs(core.state.v).max()))
    return worst


def stop_rest(subject: Subject) -> Measured:
    """The speed of the fastest joint, from half a second after a person's stop on [rad/s]."""
    with moving(subject) as (core, _, _):
        core.stop()
        cycles(core, subject, 250)
        return _speed(core, subject, 250), "0.5 s to 1 s after the stop"


def stop_way(subject: Subject) -> Measured:
    """How far a joint still moves after a person's stop [rad]."""
    with moving(subject) as (core, _, _):
        at = core.state.q.copy()
        core.stop()
        worst = 0.0
        for _ in range(500):
            cycles(core, subject, 1)
            worst = max(worst, float(np.abs(core.state.q - at).max()))
    return worst, "within 1 s of the stop"


def stop_kept(subject: Subject) -> Measured:
    """By how many cycles a stop, released at once, is too short; one more if a motion could
    start.
    """
    with moving(subject) as (core, _, _):
        core.stop()
        failed = core.report.phase is Phase.FAILED
        obeyed = core.mode is Mode.STOPPED and failed and core.begin(rising(core)) is not None
        core.release()
        count = 0
        while core.mode is Mode.STOPPED and count < 2 * safety.DWELL_CYCLES:
            cycles(core, subject, 1)
            count += 1
    return max(0, safety.DWELL_CYCLES - count) + (not obeyed), f"left after {count} cycles"


def stop_waits(subject: Subject) -> Measured:
    """The number of cycles, of 1200, in which a stop was not kept though nobody released it."""
    with moving(subject) as (core, _, _):
        core.stop()
        lost = 0
        for _ in range(1200):
            cycles(core, subject, 1)
            lost += core.mode is not Mode.STOPPED
    return lost, f"mode {core.mode} in the end"


def after_fault(how: str) -> Callable[[Subject], Measured]:
    """The number of safe-mode cycles without damping, after a fault of one kind in one cycle."""

    def measure(subject: Subject) -> Measured:
        with moving(subject) as (core, heard, _):
            heard.how = how
            core.cycle()
            heard.how = ""
            modes = [core.mode]
            first = len(heard.taus) - (how != "stepped")
            for _ in range(DAMPING_CYCLES - 1):
                cycles(core, subject, 1)
                modes.append(core.mode)
            pushed = _pushed(heard, first)
            cycles(core, subject, 2)
            kept = core.mode is Mode.HOLD and core.report.phase is Phase.FAILED
        wrong = pushed + sum(mode is not Mode.DAMPING for mode in modes[:-1]) + (not kept)
        return wrong, f"{pushed} commands pushed on; then mode {core.mode}"

    return measure


def _pushed(heard: Listening, first: int) -> int:
    """The number of commands from `first` on that add energy or are not numbers."""
    rows = zip(heard.taus[first:], heard.speeds[first:], strict=True)
    return sum(
        not (np.isfinite(tau).all() and float(tau @ np.nan_to_num(v)) <= 1e-6) for tau, v in rows
    )


def fault_rest(subject: Subject) -> Measured:
    """The speed of the fastest joint, from half a second after a fault on [rad/s]."""
    with moving(subject) as (core, heard, _):
        heard.how = "throws"
        core.cycle()
        heard.how = ""
        cycles(core, subject, 250)
        return _speed(core, subject, 250), f"0.5 s to 1 s after the fault, mode {core.mode}"


@contextmanager
def turning(subject: Subject) -> Iterator[tuple[LoopProcess, Listening, Path]]:
    """Yield the whole loop on the back-end, with its slots, at rest."""
    with bench(subject) as robot, tempfile.TemporaryDirectory() as folder:
        heard, path = Listening(robot.backend), Path(folder) / "loop.slots"
        core = subject.core(heard, dynamics=dynamics())
        speed = Speed.REAL if subject.paced else Speed.MAX
        pacer = subject.pacer(robot.backend.period_s)
        loop = subject.process(core, LoopLink(path), speed=speed, truth=None, pacer=pacer)
        yield loop, heard, path


def stop_file(subject: Subject) -> Measured:
    """The turns of the loop from the stop file to mode stopped, without any agent."""
    with turning(subject) as (loop, _, path):
        agent = AgentLink(path)
        agent.send(rising(loop.core, 2.0))
        loop.turn()
        StopLink(path).stop()
        for turns in range(1, 100):
            loop.turn()
            shown = agent.state()
            if shown is not None and shown.mode is Mode.STOPPED:
                return turns, "shown in the state slot"
    return float("inf"), "never"


def heartbeat(subject: Subject) -> Measured:
    """The turns of the loop that move the set-point, or keep a motion, after the agent's
    silence.
    """
    at_rest, late = LATE_TURNS + math.ceil(BRAKE_S / PERIOD_S), 0
    with turning(subject) as (loop, _, path):
        AgentLink(path).send(rising(loop.core, 60.0))
        loop.turn()
        for silent in range(1, GONE_TURNS + 10):
            before = loop.core.setpoint.copy()
            loop.turn()
            moved = silent > at_rest and bool((loop.core.setpoint != before).any())
            late += loop.core.mode is Mode.MOTION and (moved or silent > GONE_TURNS)
        return late, f"mode {loop.core.mode} after {silent} turns of silence"


def last_commands(subject: Subject) -> Measured:
    """The number of the last 20 commands of a loop that add energy instead of damping."""
    with turning(subject) as (loop, heard, path):
        agent = AgentLink(path)
        agent.send(rising(loop.core, 2.0))
        for _ in range(200):
            agent.beat()
            loop.turn()
        first = len(heard.taus)
        loop.end(cycles=DAMPING_CYCLES - 1)
        return _pushed(heard, first), f"{len(heard.taus) - first} cycles"


# --- Slots: what they show was measured, fits, and is never half a record -------------------------

RECORDS = 4000


def shown(subject: Subject) -> Measured:
    """The largest difference between what the slots show after a motion and what the back-end
    measures.
    """
    with turning(subject) as (loop, heard, path):
        agent = AgentLink(path)
        agent.send(rising(loop.core))
        for _ in range(3000):
            agent.beat()
            loop.turn()
            if agent.told().report.phase is not Phase.RUNNING:
                break
        state, told = copied(heard.observe()), agent.state()
        assert told is not None
        proximal, distal = (np.array(both) for both in zip(*map(told.fingers, (0, 1)), strict=True))
        pairs = {
            "q": told.q,
            "v": told.v,
            "head": told.head,
            "proximal": proximal,
            "distal": distal,
        }
        off = {name: float(np.abs(state[name] - value).max()) for name, value in pairs.items()}
        world = np.abs(heard.configuration() - told.configuration)
        off["configuration"] = float(world.max(initial=0.0))
        off["work"] = abs(heard.work_J - told.work_J)
    where = max(off, key=lambda name: off[name])
    return off[where], f"{where}, {told.cycles} cycles"


def room(subject: Subject) -> Measured:
    """The size of the state's record as a share of its slot."""
    with turning(subject) as (loop, heard, path):
        loop.turn()
        slot = AgentLink(path).file.slots["state"]
        found = slot.read()
        size = len(found[1]) if found else 0
        return (
            size / slot.capacity,
            f"{size} bytes, {heard.configuration().size} coordinates of the world model",
        )


def whole(subject: Subject) -> Measured:
    """The number of wrong records read while another process writes as fast as possible."""
    view = memoryview(mmap.mmap(-1, 1 << 16))
    slot = subject.slot(view)
    records = [bytes([65 + k % 26]) * (1 + 7919 * k % 30000) for k in range(RECORDS)]
    child = os.fork()
    if child == 0:
        for record in records:
            slot.write(record)
        os._exit(0)
    torn, seen, until = 0, 0, time.monotonic() + 30.0
    while os.waitpid(child, os.WNOHANG) == (0, 0) and time.monotonic() < until:
        found = slot.read()
        if found is not None:
            seen += 1
            torn += found[1] != records[found[0] // 2 - 1]
    last = slot.read()
    lost = last is None or last[1] != records[-1]
    return torn + lost, f"of {seen} read while {RECORDS} were written"


# --- The table, in the order in which the checks run ----------------------------------------------

T, R, L, S, M, P = "timing", "readings", "limits", "stop", "safe mode", "slots"
LOOP = (
    "this is the loop's part; a back-end fails it by keeping an old command, or by raising where it"
    " should not"
)

# fmt: off
CHECKS = (
    Check("step-returns", T, "observe and step come back", 0.05, "s",
          "half of the 0.1 s after which a silent agent ends a motion (executor/loop/process.py)",
          "send and return: leave waiting for the robot to a thread of your own", coming_back,
          most_s=15.0),
    Check("period", T, "a step is the period of the control laws", 1e-9, "s",
          "velma_system: the deployed loop steps 2 ms",
          "set period_s to velma.sim.backend.PERIOD_S; run a faster bus inside of step", period),
    Check("time-passes", T,
          "time grows by one period a cycle, never back, and observing takes none", PERIOD_S, "s",
          "one lost cycle of the robot's clock",
          "count steps, or take the robot's clock at the status that belongs to the command",
          passing),
    Check("time-keeps-pace", T, "time and cycles agree over a second", 0.02, "of it",
          "estimate: planned durations and reply-by rely on it",
          "give time in seconds since the start, not in ticks",
          passing_on_the_whole),
    Check("step-cost", T, "observe and step leave the cycle to the control law",
          0.8 * 1e3 * PERIOD_S / 2, "ms",
          "the law takes about 0.3 ms of 2 ms (benchmarks/loop.py); the rest is margin",
          "do slow things (logging, cameras, waiting) elsewhere", cost),
    Check("memory", T, "1000 cycles leave nothing behind", 8192.0, "bytes",
          "estimate: caches of the interpreter; an array of 15 kept in each cycle leaves over "
          "100 kB",
          "write into the arrays made at the start; keep no history", memory),
    Check("late-cycles", T, "a late cycle is counted", 0.0, "uncounted",
          "executor/loop/process.py; measured in every report", LOOP, late),
    Check("form", R, "readings are float64 arrays of the documented shapes", 0.0, "fields",
          "velma/sim/backend.py",
          "make State once by velma.sim.backend.at_rest() and write into its arrays", form),
    Check("numbers", R, "readings are numbers, always", 0.0, "cycles",
          "velma_system: an invalid status drops the body to its safe state",
          "raise if the robot does not answer: the loop then brakes", numbers),
    Check("ranges", R, "the robot begins inside of its joints' ranges", 0.01, "rad",
          "velma.names (RCPRG velma_robot, calibration of 2021)",
          "use rad, zero and sign as in velma.names",
          inside),
    Check("looking", R, "observing twice gives the same and moves nothing", 0.0, "",
          "velma/sim/backend.py: a step is what lets time pass", "let time pass in step only",
          looking),
    Check("rest", R, "without a torque the body stays: its weight is held", 0.01, "rad",
          "estimate; 1e-3 rad in simulation (measured)",
          "add gravity (and the tool's weight) to the torques: Command.tau is beyond gravity",
          resting),
    Check("own-joint", R, "a positive torque moves its own joint in the positive sense", 0.0,
          "joints",
          "velma.names.BODY: the order and sign of every array",
          "map joints by name; turn the sign where the drive counts the other way", own_joint),
    Check("agreement", R, "positions are the integral of speeds", 0.005, "rad",
          "half a period at 5 rad/s, and a tenth for filters; estimate",
          "give rad and rad/s of the same moment",
          agreeing),
    Check("fresh", R, "a torque is seen in the next readings", 3.0, "cycles",
          "the impedance law is stable up to a period of 12 ms (measured in simulation); delay "
          "costs the same",
          "return the newest status, not the one before; empty the buffer of the socket", fresh),
    Check("head", R, "the head follows its targets: pan left, tilt down", 0.05, "rad",
          "estimate; servo error in simulation 0.01 rad (measured)",
          "order (pan, tilt), signs as in velma.names.HEAD",
          head),
    Check("hands", R, "each finger follows its target, hand by hand", 0.05, "rad",
          "estimate; servo error in simulation 0.02 rad (measured)",
          "rows are right, left; columns finger one, two, three", hands),
    Check("locks", R, "locked fingers stay", 0.03, "rad",
          "estimate: the worm gear of the real hand does not yield",
          "stop the finger drives of a locked hand", locks),
    Check("work", R, "work is measured, and never falls", 0.0, "cycles",
          "velma/sim/backend.py: the integral of |torque x speed|",
          "add |torque x speed| x period of the 15 body joints in each step", work),
    Check("accepted-torques", L, "no command is beyond what the lower level accepts", 1.0,
          "of the limit",
          "velma_system common_predicates: 100; 50 50 30 20 20 10 10 Nm", LOOP, accepted,
          rough=True),
    Check("joint-ends", L, "pushed joints stay in their ranges", 0.1, "rad",
          "ranges: velma.names; soft ends estimate",
          "stop a joint at its end; use rad", ends, rough=True),
    Check("servo-ends", L, "head and fingers with targets too far away stay in their ranges", 0.1,
          "rad",
          "ranges: velma.names; soft ends estimate",
          "cut targets to the range before the drives get them",
          servo_ends, rough=True),
    Check("stop-rest", S, "after a person's stop the robot comes to rest", 0.1, "rad/s",
          "estimate; 0.05 rad/s in simulation (measured)",
          "use the command of this cycle and none before",
          stop_rest),
    Check("stop-way", S, "after a person's stop no joint goes far", 0.05, "rad",
          "estimate; 0.02 rad in simulation (measured)",
          "use the command of this cycle and none before",
          stop_way),
    Check("stop-dwell", S,
          "a stop ends the motion, and lasts its dwell however soon it is released", 0.0, "cycles",
          "velma_core_ve_body: 500 cycles in the safe state", LOOP, stop_kept),
    Check("stop-waits", S, "a stop waits for its release", 0.0, "cycles",
          "velma_core_ve_body: left on an explicit command only", LOOP, stop_waits),
    Check("stop-file", S, "a person's stop reaches the loop with every agent dead", 1.0, "turns",
          "docs/run-folder.md: the stop file is read in every cycle", LOOP, stop_file),
    Check("safe-throw", M, "sensors that fail end in damping, then hold", 0.0, "cycles",
          "velma_core_ve_body: viscous damping torque", LOOP, after_fault("throws")),
    Check("safe-lie", M, "a reading that is not a number ends in damping, then hold", 0.0, "cycles",
          "velma_core_ve_body: viscous damping torque", LOOP, after_fault("lies")),
    Check("safe-step", M, "drives that fail end in damping, then hold", 0.0, "cycles",
          "velma_core_ve_body: viscous damping torque", LOOP, after_fault("stepped")),
    Check("safe-rest", M, "after a fault the robot comes to rest", 0.1, "rad/s",
          "estimate; 0.05 rad/s in simulation (measured)",
          "use the command of this cycle and none before",
          fault_rest),
    Check("silent-agent", M, "a motion rests while its agent is silent, and ends when that lasts",
          0.0, "turns",
          f"executor/loop/process.py: {LATE_TURNS} turns of silence, {GONE_TURNS} turns", LOOP,
          heartbeat),
    Check("last-commands", M, "the last commands of a loop are damping", 0.0, "commands",
          "executor/loop/process.py: end()", LOOP, last_commands),
    Check("shown", P, "what the agent sees is what was measured", 0.0, "",
          "executor/loop/link.py: LoopState",
          "keep the state still between step and the next observe", shown),
    Check("room", P, "the state fits its slot", 1.0, "of the slot",
          "executor/loop/link.py: 16 KiB",
          "give fewer coordinates of the world model, or raise SIZES", room),
    Check("whole-records", P, "nobody reads half a record", 0.0, "records",
          "executor/loop/link.py: a number that is odd while a record is written", LOOP, whole),
)
# fmt: on

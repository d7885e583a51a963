"""Checks that the robot stops: for a person, after a fault, and when nobody commands it any more."""

import math
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np

from companion.skills.loop_messages import Mode, Motion, Phase, motion
from services.executor.conformance.bounds import Listening
from services.executor.conformance.judging import Measured
from services.executor.conformance.subject import Bench, Subject, bench, dynamics
from services.executor.loop.act import BRAKE_S
from services.executor.loop.core import DAMPING_CYCLES, LoopCore
from services.executor.loop.link import AgentLink, LoopLink, StopLink
from services.executor.loop.process import GONE_TURNS, LATE_TURNS, LoopProcess, Speed
from velma.control import damping
from velma.sim.backend import PERIOD_S, Backend, Command, State

REACH = 0.1  # rad, of the motion that is stopped


class Broken(Listening):
    """A back-end that fails on demand: observe raises ("throws") or gives NaN ("lies"); step raises ("stepped")."""

    def __init__(self, backend: Backend) -> None:
        super().__init__(backend)
        self.how = ""

    def observe(self) -> State:
        """Return the state, or fail."""
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
    """Return a smooth motion of all body joints by REACH."""
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
    """Return the speed of the fastest joint, from half a second after a person's stop on [rad/s]."""
    with moving(subject) as (core, _, _):
        core.stop()
        cycles(core, subject, 250)
        return _speed(core, subject, 250), "0.5 s to 1 s after the stop"


def stop_way(subject: Subject) -> Measured:
    """Return how far a joint still moves after a person's stop [rad]."""
    with moving(subject) as (core, _, _):
        at = core.state.q.copy()
        core.stop()
        worst = 0.0
        for _ in range(500):
            cycles(core, subject, 1)
            worst = max(worst, float(np.abs(core.state.q - at).max()))
    return worst, "within 1 s of the stop"


def stop_kept(subject: Subject) -> Measured:
    """Return by how many cycles a stop, released at once, is too short; one more if a motion could start."""
    with moving(subject) as (core, _, _):
        core.stop()
        failed = core.report.phase is Phase.FAILED
        obeyed = core.mode is Mode.STOPPED and failed and core.begin(rising(core)) is not None
        core.release()
        count = 0
        while core.mode is Mode.STOPPED and count < 2 * damping.DWELL_CYCLES:
            cycles(core, subject, 1)
            count += 1
    return max(0, damping.DWELL_CYCLES - count) + (not obeyed), f"left after {count} cycles"


def stop_waits(subject: Subject) -> Measured:
    """Return the number of cycles, of 1200, in which a stop was not kept though nobody released it."""
    with moving(subject) as (core, _, _):
        core.stop()
        lost = 0
        for _ in range(1200):
            cycles(core, subject, 1)
            lost += core.mode is not Mode.STOPPED
    return lost, f"mode {core.mode} in the end"


def after_fault(how: str) -> Callable[[Subject], Measured]:
    """Return the number of safe-mode cycles without damping, after a fault of one kind in one cycle."""

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
    """Return the number of commands from `first` on that add energy or are not numbers."""
    rows = zip(heard.taus[first:], heard.speeds[first:], strict=True)
    return sum(not (np.isfinite(tau).all() and float(tau @ np.nan_to_num(v)) <= 1e-6) for tau, v in rows)


def fault_rest(subject: Subject) -> Measured:
    """Return the speed of the fastest joint, from half a second after a fault on [rad/s]."""
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
        yield subject.process(core, LoopLink(path), speed=speed, truth=None, pacer=pacer), heard, path


def stop_file(subject: Subject) -> Measured:
    """Return the turns of the loop from the stop file to mode stopped, without any agent."""
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
    """Return the turns of the loop that move the set-point, or keep a motion, after the agent's silence."""
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
    """Return the number of the last 20 commands of a loop that add energy instead of damping."""
    with turning(subject) as (loop, heard, path):
        agent = AgentLink(path)
        agent.send(rising(loop.core, 2.0))
        for _ in range(200):
            agent.beat()
            loop.turn()
        first = len(heard.taus)
        loop.end(cycles=DAMPING_CYCLES - 1)
        return _pushed(heard, first), f"{len(heard.taus) - first} cycles"

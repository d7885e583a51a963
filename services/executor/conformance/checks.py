"""The table of checks, in the order in which they run."""

import mmap
import os
import time
import tracemalloc

import numpy as np

from companion.skills.loop_messages import Phase
from services.executor.conformance import bounds, readings, stopping
from services.executor.conformance.judging import Area, Check, Measured
from services.executor.conformance.readings import copied
from services.executor.conformance.stopping import rising, turning
from services.executor.conformance.subject import Subject, bench
from services.executor.loop.link import AgentLink
from services.executor.loop.process import GONE_TURNS, LATE_TURNS
from velma.sim.backend import PERIOD_S, Backend, Command, State

# --- Checks of time: one period a cycle, no call that blocks the loop, no memory that grows --------------------------


LATE_PERIODS = 5


def period(subject: Subject) -> Measured:
    """Return how far the period is from that of the control laws [s]."""
    with bench(subject) as robot:
        return abs(robot.backend.period_s - PERIOD_S), f"period_s is {robot.backend.period_s} s"


def coming_back(subject: Subject) -> Measured:
    """Return how long observe and step together block the caller: the third longest time of 200 [s]."""
    took = []
    with bench(subject) as robot:
        for _ in range(200):
            began = time.monotonic()
            robot.backend.step(robot.command)
            robot.backend.observe()
            took.append(time.monotonic() - began)
    return sorted(took)[-3], f"of 200 cycles, the two longest left out; the longest {max(took):.3f} s"


def passing(subject: Subject) -> Measured:
    """Return the largest difference between a step of the state's time and the period [s]."""
    with bench(subject) as robot:
        told = [float(robot.backend.observe().time), *(float(state.time) for state in robot.steps(1.0))]
        off = np.abs(np.diff(told) - robot.backend.period_s)
    k = int(np.argmax(off))
    return float(off[k]), f"cycle {k}: from {told[k]:.6f} s to {told[k + 1]:.6f} s"


def passing_on_the_whole(subject: Subject) -> Measured:
    """Return how far the state's time is from the number of cycles after a second, as a share."""
    with bench(subject) as robot:
        began = float(robot.backend.observe().time)
        times = [float(state.time) for state in robot.steps(1.0)]
        gone, asked = times[-1] - began, len(times) * robot.backend.period_s
    return abs(gone / asked - 1.0), f"{gone:.4f} s in {len(times)} cycles"


def cost(subject: Subject) -> Measured:
    """Return the median time that observe and step take of a cycle [ms]."""
    took = []
    with bench(subject) as robot:
        for _ in range(400):
            began = time.perf_counter()
            robot.backend.observe()
            robot.backend.step(robot.command)
            took.append(1e3 * (time.perf_counter() - began))
    return float(np.median(took)), f"p99 {np.percentile(took, 99):.2f} ms"


def memory(subject: Subject) -> Measured:
    """Return the memory that 1000 cycles leave behind [bytes]."""
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


class Slow:
    """A back-end with one late step."""

    def __init__(self, backend: Backend, late: int) -> None:
        self._backend, self._late, self.period_s = backend, late, backend.period_s

    def observe(self) -> State:
        """Return the state."""
        return self._backend.observe()

    def step(self, command: Command) -> None:
        """Pass the command on; one step takes some periods longer."""
        self._late -= 1
        if self._late == 0:
            time.sleep(LATE_PERIODS * self.period_s)
        self._backend.step(command)


def late(subject: Subject) -> Measured:
    """Return what the loop's figures miss of a late cycle: one of twenty steps takes some periods longer."""
    with bench(subject) as robot:
        slow, pacer = Slow(robot.backend, 10), subject.pacer(robot.backend.period_s)
        for _ in range(20):
            pacer.wait()
            slow.observe()
            slow.step(robot.command)
            pacer.done()
    told = pacer.timing()
    longest = told.compute_us.get("max", 0.0)
    missed = (told.missed < 1) + (longest < 1e6 * LATE_PERIODS * slow.period_s)
    return missed, f"{told.missed} missed, the longest cycle {1e-3 * longest:.1f} ms"


# --- Checks of the slots: what they show was measured, fits, and is never half a record ------------------------------


RECORDS = 4000


def shown(subject: Subject) -> Measured:
    """Return the largest difference between what the slots show after a motion and what the back-end measures."""
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
        pairs = {"q": told.q, "v": told.v, "head": told.head}
        fingers = [told.fingers(row) for row in (0, 1)]
        pairs |= {"proximal": np.array([f[0] for f in fingers]), "distal": np.array([f[1] for f in fingers])}
        off = {name: float(np.abs(state[name] - value).max()) for name, value in pairs.items()}
        off["configuration"] = float(np.abs(heard.configuration() - told.configuration).max(initial=0.0))
        off["work"] = abs(heard.work_J - told.work_J)
    where = max(off, key=lambda name: off[name])
    return off[where], f"{where}, {told.cycles} cycles"


def room(subject: Subject) -> Measured:
    """Return the size of the state's record as a share of its slot."""
    with turning(subject) as (loop, heard, path):
        loop.turn()
        slot = AgentLink(path).file.slots["state"]
        found = slot.read()
        size = len(found[1]) if found else 0
        return size / slot.capacity, f"{size} bytes, {heard.configuration().size} coordinates of the world model"


def whole(subject: Subject) -> Measured:
    """Return the number of wrong records read while another process writes as fast as possible."""
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


# --- The table of checks, in the order in which they run --------------------------------------------------------------


T, R, L, S, M, P = Area.TIMING, Area.READINGS, Area.LIMITS, Area.STOP, Area.SAFE_MODE, Area.SLOTS
LOOP = "this is the loop's part; a back-end fails it by keeping an old command, or by raising where it should not"

# fmt: off
CHECKS = (
    Check("step-returns", T, "observe and step come back", 0.05, "s",
          "half of the 0.1 s after which a silent agent ends a motion (executor/loop/process.py)",
          "send and return: leave waiting for the robot to a thread of your own", coming_back, most_s=15.0),
    Check("period", T, "a step is the period of the control laws", 1e-9, "s",
          "velma_system: the deployed loop steps 2 ms",
          "set period_s to velma.sim.backend.PERIOD_S; run a faster bus inside of step", period),
    Check("time-passes", T, "time grows by one period a cycle, never back, and observing takes none", PERIOD_S, "s",
          "one lost cycle of the robot's clock",
          "count steps, or take the robot's clock at the status that belongs to the command", passing),
    Check("time-keeps-pace", T, "time and cycles agree over a second", 0.02, "of it",
          "estimate: planned durations and reply-by rely on it", "give time in seconds since the start, not in ticks",
          passing_on_the_whole),
    Check("step-cost", T, "observe and step leave the cycle to the control law", 0.8 * 1e3 * PERIOD_S / 2, "ms",
          "the law takes about 0.3 ms of 2 ms (benchmarks/loop.py); the rest is margin",
          "do slow things (logging, cameras, waiting) elsewhere", cost),
    Check("memory", T, "1000 cycles leave nothing behind", 8192.0, "bytes",
          "estimate: caches of the interpreter; an array of 15 kept in each cycle leaves over 100 kB",
          "write into the arrays made at the start; keep no history", memory),
    Check("late-cycles", T, "a late cycle is counted", 0.0, "uncounted",
          "executor/loop/timing.py; measured in every report", LOOP, late),
    Check("form", R, "readings are float64 arrays of the documented shapes", 0.0, "fields", "velma/sim/backend.py",
          "make State once by velma.sim.backend.at_rest() and write into its arrays", readings.form),
    Check("numbers", R, "readings are numbers, always", 0.0, "cycles",
          "velma_system: an invalid status drops the body to its safe state",
          "raise if the robot does not answer: the loop then brakes", readings.numbers),
    Check("ranges", R, "the robot begins inside of its joints' ranges", 0.01, "rad",
          "velma.names (RCPRG velma_robot, calibration of 2021)", "use rad, zero and sign as in velma.names",
          readings.inside),
    Check("looking", R, "observing twice gives the same and moves nothing", 0.0, "",
          "velma/sim/backend.py: a step is what lets time pass", "let time pass in step only", readings.looking),
    Check("rest", R, "without a torque the body stays: its weight is held", 0.01, "rad",
          "estimate; 1e-3 rad in simulation (measured)",
          "add gravity (and the tool's weight) to the torques: Command.tau is beyond gravity", readings.resting),
    Check("own-joint", R, "a positive torque moves its own joint in the positive sense", 0.0, "joints",
          "velma.names.BODY: the order and sign of every array",
          "map joints by name; turn the sign where the drive counts the other way", readings.own_joint),
    Check("agreement", R, "positions are the integral of speeds", 0.005, "rad",
          "half a period at 5 rad/s, and a tenth for filters; estimate", "give rad and rad/s of the same moment",
          readings.agreeing),
    Check("fresh", R, "a torque is seen in the next readings", 3.0, "cycles",
          "the impedance law is stable up to a period of 12 ms (measured in simulation); delay costs the same",
          "return the newest status, not the one before; empty the buffer of the socket", readings.fresh),
    Check("head", R, "the head follows its targets: pan left, tilt down", 0.05, "rad",
          "estimate; servo error in simulation 0.01 rad (measured)", "order (pan, tilt), signs as in velma.names.HEAD",
          readings.head),
    Check("hands", R, "each finger follows its target, hand by hand", 0.05, "rad",
          "estimate; servo error in simulation 0.02 rad (measured)",
          "rows are right, left; columns finger one, two, three", readings.hands),
    Check("locks", R, "locked fingers stay", 0.03, "rad", "estimate: the worm gear of the real hand does not yield",
          "stop the finger drives of a locked hand", readings.locks),
    Check("work", R, "work is measured, and never falls", 0.0, "cycles",
          "velma/sim/backend.py: the integral of |torque x speed|",
          "add |torque x speed| x period of the 15 body joints in each step", readings.work),
    Check("accepted-torques", L, "no command is beyond what the lower level accepts", 1.0, "of the limit",
          "velma_system common_predicates: 100; 50 50 30 20 20 10 10 Nm", LOOP, bounds.accepted, rough=True),
    Check("joint-ends", L, "pushed joints stay in their ranges", 0.1, "rad", "ranges: velma.names; soft ends estimate",
          "stop a joint at its end; use rad", bounds.ends, rough=True),
    Check("servo-ends", L, "head and fingers with targets too far away stay in their ranges", 0.1, "rad",
          "ranges: velma.names; soft ends estimate", "cut targets to the range before the drives get them",
          bounds.servo_ends, rough=True),
    Check("stop-rest", S, "after a person's stop the robot comes to rest", 0.1, "rad/s",
          "estimate; 0.05 rad/s in simulation (measured)", "use the command of this cycle and none before",
          stopping.stop_rest),
    Check("stop-way", S, "after a person's stop no joint goes far", 0.05, "rad",
          "estimate; 0.02 rad in simulation (measured)", "use the command of this cycle and none before",
          stopping.stop_way),
    Check("stop-dwell", S, "a stop ends the motion, and lasts its dwell however soon it is released", 0.0, "cycles",
          "velma_core_ve_body: 500 cycles in the safe state", LOOP, stopping.stop_kept),
    Check("stop-waits", S, "a stop waits for its release", 0.0, "cycles",
          "velma_core_ve_body: left on an explicit command only", LOOP, stopping.stop_waits),
    Check("stop-file", S, "a person's stop reaches the loop with every agent dead", 1.0, "turns",
          "docs/run-folder.md: the stop file is read in every cycle", LOOP, stopping.stop_file),
    Check("safe-throw", M, "sensors that fail end in damping, then hold", 0.0, "cycles",
          "velma_core_ve_body: viscous damping torque", LOOP, stopping.after_fault("throws")),
    Check("safe-lie", M, "a reading that is not a number ends in damping, then hold", 0.0, "cycles",
          "velma_core_ve_body: viscous damping torque", LOOP, stopping.after_fault("lies")),
    Check("safe-step", M, "drives that fail end in damping, then hold", 0.0, "cycles",
          "velma_core_ve_body: viscous damping torque", LOOP, stopping.after_fault("stepped")),
    Check("safe-rest", M, "after a fault the robot comes to rest", 0.1, "rad/s",
          "estimate; 0.05 rad/s in simulation (measured)", "use the command of this cycle and none before",
          stopping.fault_rest),
    Check("silent-agent", M, "a motion rests while its agent is silent, and ends when that lasts", 0.0, "turns",
          f"executor/loop/process.py: {LATE_TURNS} turns of silence, {GONE_TURNS} turns", LOOP,
          stopping.heartbeat),
    Check("last-commands", M, "the last commands of a loop are damping", 0.0, "commands",
          "executor/loop/process.py: end()", LOOP, stopping.last_commands),
    Check("shown", P, "what the agent sees is what was measured", 0.0, "", "executor/loop/link.py: LoopState",
          "keep the state still between step and the next observe", shown),
    Check("room", P, "the state fits its slot", 1.0, "of the slot", "executor/loop/slots.py: 16 KiB",
          "give fewer coordinates of the world model, or raise SIZES", room),
    Check("whole-records", P, "nobody reads half a record", 0.0, "records",
          "executor/loop/slots.py: a number that is odd while a record is written", LOOP, whole),
)
# fmt: on

"""Checks of time: one period a cycle, no call that blocks the loop, no memory that grows."""

import time
import tracemalloc

import numpy as np

from services.executor.conformance.judging import Measured
from services.executor.conformance.subject import Subject, bench
from velma.sim.backend import PERIOD_S, Backend, Command, State

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

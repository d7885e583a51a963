"""The loop with its clock and its slots. `__main__` calls `turn` for ever; tests call it step by
step.

`--speed 1`: a cycle every 2 ms of wall time. A simulated world that stands still is not computed
until something is asked of the robot: every 50 ms its time passes, and it is shown every 0.1 s.
`--speed max`: simulated time goes on only while something happens, as fast as possible; between
acts it stands still.

If a motion is watched, the loop says when a look is due. In real time the motion goes on meanwhile,
and a slow machine looks less often. At `--speed max` time stands still until the look is answered
or the motion is cancelled.

The agent sends heartbeats during an act. If one is late, the arms come to rest along their path and
go on with the next one (at `--speed max` time stands still meanwhile). If none comes for long, the
act is interrupted. A cancelled act needs no heartbeat. Silence is counted in turns, so suspending a
machine with agent and loop does not count.
"""

import ctypes
import gc
import os
import resource
import time
from collections.abc import Callable
from enum import StrEnum
from typing import Protocol, runtime_checkable

import msgspec
import numpy as np

from companion.languages.facts import Kind, fact
from companion.skills.loop_messages import Cancel, LookAgain, Mode, Motion, Phase, Refusal, Release
from companion.telemetry import PageFaults
from services.executor.loop.core import LoopCore
from services.executor.loop.link import LoopAnswer, LoopLink, LoopState, Timing
from services.executor.loop.memory import Keeper
from velma.sim.truth import TruthReader

# --- Timing of cycles: absolute deadlines, real-time priority if the kernel grants it, and lateness
# Lateness is counted in a fixed number of bins, so that memory does not grow while the robot runs.

FIFO_PRIORITY = 80  # below the kernel's own threads (99), above everything normal
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # mlockall(2)

# up to 40 ms; anything later is in the last bin, the maximum is kept separately
BIN_US, BINS = 5, 8000
MOST_BEHIND = 10  # periods that are caught up by running faster; more are skipped and counted


class Histogram:
    """Durations [us] in fixed bins."""

    def __init__(self) -> None:
        self._bins = np.zeros(BINS, dtype=np.int64)
        self._count, self._max = 0, 0.0

    def add(self, us: float) -> None:
        """Count a duration [us]."""
        self._bins[min(BINS - 1, max(0, int(us / BIN_US)))] += 1
        self._count += 1
        self._max = max(self._max, us)

    def figures(self) -> dict[str, float]:
        """Return p50, p99, p999 (upper edges of their bins) and max [us]; {} if nothing was
        counted.
        """
        if not self._count:
            return {}
        upto = np.cumsum(self._bins)
        out = {}
        for name, share in (("p50", 0.5), ("p99", 0.99), ("p999", 0.999)):
            edge = float(BIN_US * (1 + np.searchsorted(upto, share * self._count)))
            out[name] = min(self._max, edge)
        out["max"] = self._max
        return out


class Paging:
    """Counts page faults of the calling thread during motions."""

    def __init__(self) -> None:
        self.told = PageFaults()
        self._before = _page_faults()

    def count(self, moving: bool, missed: bool) -> None:
        """Note the end of a cycle: those since the last one count if a motion is under way."""
        before, self._before = self._before, _page_faults()
        if moving and self._before != before:
            minor, major = (now - then for now, then in zip(self._before, before, strict=True))
            told = self.told
            self.told = PageFaults(
                told.minor + minor, told.major + major, told.late + (missed and major > 0)
            )


def _page_faults() -> tuple[int, int]:
    used = resource.getrusage(resource.RUSAGE_THREAD)
    return used.ru_minflt, used.ru_majflt


class Pacer:
    """Keeps real time: a cycle starts a period after the one before, or after as many as were
    rested.
    """

    def __init__(self, period_s: float, realtime: bool = False) -> None:
        # _since: periods from the last wait to the next
        self._period, self._next, self._since = period_s, 0.0, 1
        self._late, self._compute = Histogram(), Histogram()
        self._cycles = 0
        self._missed = 0
        self._skipped = 0
        self._rested = 0
        self._realtime = realtime
        self._began = 0.0
        self._paging = Paging()

    def wait(self) -> None:
        """Sleep until the next period begins; after that, return at once."""
        self._next = self._next + self._since * self._period if self._cycles else time.monotonic()
        self._since = 1
        left = self._next - time.monotonic()
        if left > 0:
            time.sleep(left)
        self._began = time.monotonic()
        late = self._began - self._next
        if late > MOST_BEHIND * self._period:
            given_up = int(late / self._period)
            self._skipped += given_up
            self._next += given_up * self._period
        self._late.add(1e6 * max(0.0, late))

    def go(self) -> None:
        """Start a cycle at once, without a deadline. Its computing time is counted; longer than a
        period is a miss.
        """
        self._began = self._next = time.monotonic()

    def done(self, moving: bool = True) -> None:
        """Note that the command of this cycle was sent; `moving`: a motion is under way."""
        now = time.monotonic()
        missed = now > self._next + self._period
        self._cycles += 1
        self._missed += missed
        self._paging.count(moving, missed)
        self._compute.add(1e6 * (now - self._began))

    def rest(self, periods: int) -> None:
        """Let the next wait be for as many periods."""
        self._since, self._rested = periods, self._rested + periods

    def timing(self) -> Timing:
        """Return the figures so far."""
        return Timing(
            cycles=self._cycles,
            missed=self._missed,
            skipped=self._skipped,
            rested=self._rested,
            lateness_us=self._late.figures(),
            compute_us=self._compute.figures(),
            realtime=self._realtime,
            page_faults=self._paging.told,
        )


def take_priority() -> str:
    """Request SCHED_FIFO and locked memory. Return "" if granted, else what was refused and why."""
    refused = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))
    except OSError as error:
        refused.append(f"SCHED_FIFO ({error.strerror})")
    if ctypes.CDLL(None, use_errno=True).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0:
        refused.append(f"locked memory ({os.strerror(ctypes.get_errno())})")
    if not refused:
        return ""
    return (
        f"no {' and no '.join(refused)}: some cycles will be late; needs CAP_SYS_NICE and"
        " CAP_IPC_LOCK"
    )


def still_memory() -> None:
    """Turn garbage collection off: what exists stays, and the loop makes no reference cycles."""
    gc.collect()
    gc.freeze()
    gc.disable()


# --- Whether a simulated world stands still: then its cycles need not be computed -----------------

WINDOW = 250  # cycles, 0.5 s; estimate
STILL = 1e-7  # rad or m, by which nothing moves in a window; estimate: 200 times what was measured


@runtime_checkable
class Restable(Protocol):
    """A back-end whose time can pass without steps."""

    def pass_time(self, periods: int) -> None:
        """Let as many periods of 2 ms pass in which nothing moves; the caller knows that nothing
        would.
        """
        ...


class Stillness:
    """Watches the coordinates of a world over windows of cycles; `reached` tells whether it stands
    still.
    """

    def __init__(self, core: LoopCore, world: Restable) -> None:
        self._core, self._world = core, world
        self.restart()

    def restart(self) -> None:
        """Compute the world: something new is asked of the robot or happens to it."""
        self.reached, self._cycles = False, 0
        self._before = self._core.backend.configuration().copy()

    def computed(self) -> None:
        """Count a cycle that was computed; compare the world at the end of a window with that at
        its beginning.
        """
        self._cycles += 1
        if self._cycles == WINDOW:
            now = self._core.backend.configuration()
            still = bool(np.abs(now - self._before).max() <= STILL)
            self.restart()
            self.reached = still and not self._core.busy

    def rest(self, periods: int) -> None:
        """Let periods pass without computing them."""
        self._world.pass_time(periods)
        self._core.cycles += periods


# turns without a heartbeat, 0.1 s: ten beats of the agent (services/executor/devices.py)
LATE_TURNS = 50
# 5 s; estimate: a killed agent is back after 3.3 s (measured), and finds its motion at rest
GONE_TURNS = 2500
SETTLE_S = 0.4  # for things to come to rest on their shelves before anybody looks
SHOW_EVERY, TRUTH_EVERY, TIMING_EVERY = 5, 50, 500  # cycles: 10 ms, 0.1 s, 1 s
# cycles of a still world between two looks for a command, and two states shown
LOOK_EVERY, SHOW_STILL_EVERY = 25, 50
# simulated, until what somebody pushed or tipped rests; at speed max nothing else moves it;
# estimate
UNREST_S = 2.0
IDLE_S = 0.002  # pause between two looks while time stands still


class Speed(StrEnum):
    """Speed of simulated time."""

    REAL = "1"
    MAX = "max"


class LoopProcess:
    """Runs a core by commands from slots. `turn` is one cycle, or a short pause while time stands
    still.

    `keeper` saves the core after each cycle, None for a robot whose world does not end with this
    process. A motion that a killed loop left is cancelled: who asked for it sees a new loop, and
    takes it for lost. `still`: None for a robot whose every cycle has to be computed. `stirred`:
    returns whether a fault has just changed the simulated world, so that it does not rest; called
    in each turn.
    """

    def __init__(
        self,
        core: LoopCore,
        link: LoopLink,
        *,
        speed: Speed,
        truth: TruthReader | None,
        pacer: Pacer,
        keeper: Keeper | None = None,
        still: Stillness | None = None,
        stirred: Callable[[], bool] | None = None,
        settle_s: float = SETTLE_S,
    ) -> None:
        self.core = core
        self._link = link
        self._speed = speed
        self._truth = truth
        self._pacer = pacer
        self._keeper, self._still = keeper, still
        self._stirred, self._unrest = stirred, 0
        self._told, self._shown = LoopAnswer(), core.mode
        self._beat, self._silent = link.heartbeat(), 0
        if self.restored:
            core.cancel()
            link.held = core.stopped  # a release while no loop ran is heard
        else:
            core.hold(settle_s)
        self._publish()

    def turn(self) -> None:
        """Take commands, run the cycles that are due, publish what is new; in real time, wait for
        them first.
        """
        if self._speed is Speed.REAL:
            self._pacer.wait()
        self._people()
        self._take()
        self._listen()
        self._look_at_world()
        if self._speed is Speed.REAL:
            if (
                self._still is not None
                and self._still.reached
                and self.core.cycles % LOOK_EVERY == 0
            ):
                self._rest(self._still)
            else:
                self._cycle()
        elif (self.core.busy or self._unrest) and not self._late and not self.core.look_due:
            self._unrest = max(0, self._unrest - 1)
            self._pacer.go()
            self._cycle()
        else:
            time.sleep(IDLE_S)

    def _look_at_world(self) -> None:
        if self._stirred is not None and self._stirred():
            self._unrest = round(UNREST_S / self.core.backend.period_s)
            if self._still is not None:
                self._still.restart()

    def _cycle(self) -> None:
        moving = self.core.act is not None
        self.core.cycle()
        self._keep()
        self._pacer.done(moving)
        if self._still is not None:
            self._still.computed()
        self._show()

    def _rest(self, still: Stillness) -> None:
        still.rest(LOOK_EVERY)
        self._pacer.rest(LOOK_EVERY)
        if self.core.cycles % SHOW_STILL_EVERY == 0:
            self.core.state = self.core.backend.observe()
            self._keep()
            self._show()

    def _keep(self) -> None:
        if self._keeper is not None:
            self._keeper.save()

    @property
    def restored(self) -> bool:
        """Whether it goes on where another loop was killed or ended."""
        return self._keeper is not None and self._keeper.restored

    def end(self, cycles: int = 50) -> None:
        """End whatever runs; the last commands are damping."""
        self.core.abandon((fact(Kind.ENDED, "loop"),))
        for _ in range(cycles):
            self.core.cycle()
        self._publish()

    def _people(self) -> None:
        stop, release = self._link.people()
        if stop:
            self.core.stop()
        if release:
            self.core.release()
        if stop or release:
            self._publish()

    def _take(self) -> None:
        found = self._link.command()
        if found is None:
            return
        number, command = found
        refusal: Refusal | None = None
        match command:
            case Motion():
                refusal = self.core.begin(command)
                self._hear()  # a motion counts as a heartbeat
            case Cancel():
                self.core.cancel(command.key)
            case LookAgain():
                self.core.look_again(command.key, command.in_s)
            case Release() if self._link.held:
                stopped = (fact(Kind.HELD_STILL, Mode.STOPPED),)
                refusal = Refusal(stopped, "a person has stopped the robot, and releases it")
            case Release():
                self.core.release()
            case msgspec.DecodeError():
                refusal = Refusal((fact(Kind.BAD_COMMAND, "command"),), f"not a command: {command}")
        self._told = LoopAnswer(number, refusal, self.core.report)
        self._publish()

    def _listen(self) -> None:
        beat = self._link.heartbeat()
        if beat != self._beat or self.core.report.phase is not Phase.RUNNING or self.core.braking:
            self._beat = beat
            self._hear()
            return
        self._silent += 1
        if self._silent == LATE_TURNS:
            self.core.pause()
        elif self._silent == GONE_TURNS:
            self.core.abandon((fact(Kind.GAVE_NO_ANSWER, "ex"),))

    @property
    def _late(self) -> bool:
        return self._silent >= LATE_TURNS

    def _hear(self) -> None:
        if self._late:
            self.core.pause(False)
        self._silent = 0

    def _show(self) -> None:
        core = self.core
        if (
            core.report is not self._told.report
            or core.mode is not self._shown
            or core.look_due != self._told.look
        ):
            self._publish()
        elif core.cycles % SHOW_EVERY == 0:
            self._show_state()
            if core.cycles % TRUTH_EVERY == 0:
                self._show_truth()
            if core.cycles % TIMING_EVERY == 0:
                self._link.show("timing", self._pacer.timing())

    def _publish(self) -> None:
        """Save and publish all; state and truth first, so that a reader of a motion's end finds the
        state after it.
        """
        if self._still is not None:
            self._still.restart()
        self._keep()
        self._show_state()
        self._show_truth()
        told, core = self._told, self.core
        self._told = msgspec.structs.replace(told, report=core.report, look=core.look_due)
        self._shown = core.mode
        self._link.show("told", self._told)
        self._link.show("timing", self._pacer.timing())

    def _show_state(self) -> None:
        core = self.core
        rest = LoopState(
            time_s=core.state.time,
            cycles=core.cycles,
            mode=core.mode,
            busy=core.busy,
            work_J=core.backend.work_J,
            faults=core.faults,
            last_fault=core.last_fault,
            saturated=core.saturated,
            body=b"",
            hands=b"",
            world=core.backend.configuration().tobytes(),
            epoch=self._keeper.epoch if self._keeper is not None else "",
        )
        self._link.show_state(core.backend.observe(), core.setpoint, rest)

    def _show_truth(self) -> None:
        if self._truth is not None:
            self._link.show("truth", self._truth.read())

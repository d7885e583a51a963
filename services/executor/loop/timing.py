"""Timing of cycles: absolute deadlines, real-time priority if the kernel grants it, and lateness.

Lateness is counted in a fixed number of bins, so that memory does not grow while the robot runs.
"""

import ctypes
import gc
import os
import resource
import time

import numpy as np

from companion.telemetry import PageFaults
from services.executor.loop.link import Timing

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

"""Whether this machine holds 500 Hz with what runs now: `python -m services.executor.loop.pace`
prints a Pace as JSON.

The loop moves the simulated robot in real time for a second, with the priority that it would get.
With the slot file of a loop that runs (`... pace FILE`) it is that loop which is watched, unless
its world stands still.
"""

import sys
import time
from pathlib import Path

import msgspec
import numpy as np

from companion.skills.loop_messages import KNOT_S, motion
from services.executor.loop.core import LoopCore
from services.executor.loop.link import AgentLink, Timing
from services.executor.loop.process import Pacer, still_memory, take_priority
from velma.model import scene
from velma.sim.mujoco_backend import MujocoBackend

MEASURED_S, WARM_S = 1.0, 0.2
WATCHED_S = 2.5  # a loop shows its timing once a second, or later where it is late
REACH = 0.1  # rad: every joint moves, in the start posture nothing is near
# estimate: idle machines with two slow cores are late in 3 to 9 % of the cycles and keep real time
MOST_LATE = 0.1


class Pace(msgspec.Struct, frozen=True):
    """Number of periods, of those with a late or skipped cycle, whether real time is held,
    computing time [us].

    `realtime`: the loop has the kernel's real-time priority.
    """

    periods: int
    late: int
    held: bool
    realtime: bool
    compute_us: dict[str, float]


def measure(core: LoopCore, pacer: Pacer, seconds: float = MEASURED_S) -> Pace:
    """Return the pace of a motion of this duration in real time [s]; the core must be at rest in
    mode motion.
    """
    core.begin(motion("pace", _rise(core.setpoint, seconds)))
    for _ in range(round(seconds / core.backend.period_s)):
        pacer.wait()
        core.cycle()
        pacer.done()
    return between(Timing(), pacer.timing())


def between(before: Timing, after: Timing) -> Pace:
    """Return the pace of a loop between two looks at its timing; no periods where it keeps no real
    time.
    """
    skipped = after.skipped - before.skipped
    periods, late = after.cycles - before.cycles + skipped, after.missed - before.missed + skipped
    if not after.lateness_us:  # at speed max it has no deadlines
        periods = late = 0
    return Pace(periods, late, late <= MOST_LATE * periods, after.realtime, after.compute_us)


def _rise(start: np.ndarray, seconds: float) -> np.ndarray:
    """Return knots (n, 15) of a smooth motion of all joints from `start` (15,) by REACH and
    back.
    """
    u = np.arange(0.0, seconds + KNOT_S, KNOT_S) / seconds
    return start + REACH * np.sin(np.pi * u)[:, None] ** 2


def watch(slots: Path) -> Pace:
    """Return the pace of the loop that runs, over some seconds; not of one that replaces it. Raises
    SlotError.

    While its world stands still it computes nothing: then another one is tried out.
    """
    link = AgentLink(slots)
    before = link.timing()
    time.sleep(WATCHED_S)
    after = link.timing()
    return try_out() if after.rested > before.rested else between(before, after)


def try_out() -> Pace:
    """Return the pace of a loop of this process."""
    realtime = not take_priority()
    core = LoopCore(MujocoBackend(scene.load()))
    core.hold(WARM_S)
    still_memory()
    return measure(core, Pacer(core.backend.period_s, realtime))


def main(slots: Path | None = None) -> None:
    """Measure and print."""
    found = try_out() if slots is None else watch(slots)
    sys.stdout.write(msgspec.json.encode(found).decode() + "\n")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))

"""Whether this machine holds 500 Hz with what runs now: `python -m services.executor.loop.pace` prints a Pace as JSON.

The loop moves the simulated robot in real time for a second, with the priority that it would get.
"""

import sys

import msgspec
import numpy as np

from services.executor.loop.core import LoopCore
from services.executor.loop.program import KNOT_S, motion
from services.executor.loop.timing import Pacer, still_memory, take_priority
from velma.model import scene
from velma.sim.mujoco_backend import MujocoBackend

MEASURED_S, WARM_S = 1.0, 0.2
REACH = 0.1  # rad: every joint moves, in the start posture nothing is near
MOST_LATE = 0.1  # estimate: idle machines with two slow cores are late in 3 to 9 % of the cycles and keep real time


class Pace(msgspec.Struct, frozen=True):
    """Number of periods, of those with a late or skipped cycle, whether real time is held, computing time [us]."""

    periods: int
    late: int
    held: bool
    compute_us: dict[str, float]


def measure(core: LoopCore, pacer: Pacer, seconds: float = MEASURED_S) -> Pace:
    """Return the pace of a motion of this duration in real time [s]; the core must be at rest in mode motion."""
    core.begin(motion("pace", _rise(core.setpoint, seconds)))
    for _ in range(round(seconds / core.backend.period_s)):
        pacer.wait()
        core.cycle()
        pacer.done()
    timing = pacer.timing()
    periods, late = timing.cycles + timing.skipped, timing.missed + timing.skipped
    return Pace(periods, late, late <= MOST_LATE * periods, timing.compute_us)


def _rise(start: np.ndarray, seconds: float) -> np.ndarray:
    """Return knots (n, 15) of a smooth motion of all joints from `start` (15,) by REACH and back."""
    u = np.arange(0.0, seconds + KNOT_S, KNOT_S) / seconds
    return start + REACH * np.sin(np.pi * u)[:, None] ** 2


def main() -> None:
    """Measure and print."""
    take_priority()
    core = LoopCore(MujocoBackend(scene.load()))
    core.hold(WARM_S)
    still_memory()
    sys.stdout.write(msgspec.json.encode(measure(core, Pacer(core.backend.period_s))).decode() + "\n")


if __name__ == "__main__":
    main()

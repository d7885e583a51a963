"""Whether this machine holds 500 Hz with what runs now: `python -m services.executor.loop.pace` prints a Pace as JSON.

The loop itself moves the simulated robot in real time for a second, with the priority that it would get.
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
MOST_LATE = 0.1  # estimate: quiet machines of two slow cores are late in 3 to 9 % of the cycles, and keep real time


class Pace(msgspec.Struct, frozen=True):
    """Periods that went by, in how many a cycle was late or left out, whether that is real time, cycles' work [us]."""

    periods: int
    late: int
    held: bool
    compute_us: dict[str, float]


def measure(core: LoopCore, pacer: Pacer, seconds: float = MEASURED_S) -> Pace:
    """Move for this long in real time [s]; the core must rest in motion mode."""
    core.begin(motion("pace", _rise(core.setpoint, seconds)))
    for _ in range(round(seconds / core.backend.period_s)):
        pacer.wait()
        core.cycle()
        pacer.done()
    timing = pacer.timing()
    periods, late = timing.cycles + timing.skipped, timing.missed + timing.skipped
    return Pace(periods, late, late <= MOST_LATE * periods, timing.compute_us)


def _rise(start: np.ndarray, seconds: float) -> np.ndarray:
    """A smooth motion of all joints (15,) to REACH beside `start` and back: knots (n, 15)."""
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

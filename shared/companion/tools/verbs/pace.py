"""Whether this machine holds the control loop's 500 Hz with what runs now.

Measured in a process of its own: a second of the loop, or some seconds of one that runs.
"""

import contextlib
import subprocess
import sys
from pathlib import Path

import msgspec

LOOP = "services.executor.loop.pace"
WITHIN_S = 30.0  # estimate: it takes 3 s at a load of 5 on two cores


class Pace(msgspec.Struct, frozen=True):
    """Periods of the loop, those in which a cycle was late or left out, and whether that is real time.

    `realtime`: the loop has the kernel's real-time priority.
    """

    periods: int
    late: int
    held: bool
    realtime: bool = True

    @property
    def words(self) -> str:
        """For a person, without a full stop."""
        return f"{100 * self.late / max(1, self.periods):.0f} % of the control loop's cycles are late here now"


def measure(slots: Path | None = None) -> Pace | None:
    """Return the pace now: of a loop that runs, by its slot file, or else of one that is tried out.

    None where it cannot be measured: the executor's libraries are not installed, or the loop keeps no real time.
    """
    command = [sys.executable, "-P", "-m", LOOP, *([str(slots)] if slots else [])]
    with contextlib.suppress(OSError, subprocess.SubprocessError, msgspec.DecodeError):
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=WITHIN_S, check=True)
        found = msgspec.json.decode(done.stdout, type=Pace)
        return found if found.periods else None
    return None

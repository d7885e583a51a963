"""Whether this machine holds the control loop's 500 Hz with what runs now: a second of the loop, in its own process."""

import contextlib
import subprocess
import sys

import msgspec

LOOP = "services.executor.loop.pace"
WITHIN_S = 30.0  # estimate: it takes 3 s at a load of 5 on two cores


class Pace(msgspec.Struct, frozen=True):
    """Periods of the loop, those in which a cycle was late or left out, and whether that is real time."""

    periods: int
    late: int
    held: bool

    @property
    def words(self) -> str:
        """For a person, without a full stop."""
        return f"{100 * self.late / max(1, self.periods):.0f} % of the control loop's cycles are late here now"


def measure() -> Pace | None:
    """The pace now; None where it cannot be measured (the executor's libraries are not installed)."""
    command = [sys.executable, "-m", LOOP]
    with contextlib.suppress(OSError, subprocess.SubprocessError, msgspec.DecodeError):
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=WITHIN_S, check=True)
        return msgspec.json.decode(done.stdout, type=Pace)
    return None

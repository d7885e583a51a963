"""The stop flag of the robot, as the page reaches it: a byte in the run folder, read by the loop (docs/run-folder.md).

In containers and across hosts the loop has another run folder; then hi is asked, which says what it can do.
"""

from pathlib import Path

from agent_runtime.io.fleet_processes import set_stop
from agent_runtime.io.run_files import STOP_FILE, STOP_HELD
from companion.run_files import SLOTS_FILE


class RobotStop:
    """The flag of the run folder that the robot's loop shares, if one does."""

    def __init__(self, run: Path) -> None:
        self._run = run

    def hold(self, held: bool) -> bool:
        """Stop the robot, or let it go. Return whether its loop reads the flag; hi is to be asked where it does not."""
        if not self.here:
            return False
        try:
            set_stop(self._run, held)
        except OSError:
            return False
        return True

    @property
    def here(self) -> bool:
        """Whether the robot's loop has had this run folder's flag mapped."""
        return (self._run / SLOTS_FILE).exists()

    @property
    def held(self) -> bool:
        """Whether the flag is set."""
        try:
            return (self._run / STOP_FILE).read_bytes()[:1] == STOP_HELD
        except OSError:
            return False

"""The stop flag of the robot, as hi reaches it: a byte in the run folder (docs/run-folder.md), that the loop reads.

No agent, router or key is needed. Where the loop has another run folder, in another container or on another host, the
flag is out of reach; that is said, and what is next best is done.
"""

from pathlib import Path

from agent_runtime.io.fleet_processes import set_stop
from agent_runtime.io.run_files import STOP_FILE, STOP_HELD
from companion.run_files import SLOTS_FILE

OUT_OF_REACH = (
    "I cannot stop the robot from here: its control loop has another run folder. I cancel all tasks instead, and what "
    "is held is put down. Where the robot runs, `roco stop` stops it at once"
)
NOT_HELD_HERE = "I cannot release the robot from here: its loop has another run folder; `roco release` does it there"


class Robot:
    """The robot whose control loop shares this run folder, if one does."""

    def __init__(self, run_dir: Path) -> None:
        self._run = run_dir

    def hold(self, held: bool) -> bool:
        """Stop the robot, or let it go. Return whether its loop reads the flag; raise OSError if it cannot be written.

        Where a supervisor made a flag it is written even if there is no loop yet, which then begins with it.
        """
        if (self._run / STOP_FILE).exists() or self._reached:
            set_stop(self._run, held)
        return self._reached

    @property
    def held(self) -> bool:
        """Whether the robot is stopped, as far as can be told here."""
        try:
            return (self._run / STOP_FILE).read_bytes()[:1] == STOP_HELD
        except OSError:
            return False

    @property
    def _reached(self) -> bool:
        return (self._run / SLOTS_FILE).exists()

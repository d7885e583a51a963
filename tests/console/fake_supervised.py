"""`roco` with a pretended fleet in place of the supervisor: `fake_supervised.py MODE WORDS OF
ROCO`.

MODE: `ready`, `starting` (never ready), or `slow` (never ready, and it does not end before a file
`may-end` is there).
"""

import subprocess
import sys
from pathlib import Path

from console.__main__ import main
from console.fleet import starting

FAKE = Path(__file__).with_name("fake_fleet.py")


def start(run: Path, arguments: list[str]) -> "subprocess.Popen[bytes]":
    """A pretended fleet as the console starts the real one: in a session of its own."""
    run.mkdir(parents=True)
    command = [sys.executable, FAKE, "services.supervisor", run, "True", mode]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        command, start_new_session=True, stdin=quiet, stdout=quiet, stderr=quiet
    )


mode = sys.argv.pop(1)
starting.start = start
main()

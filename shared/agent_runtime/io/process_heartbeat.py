"""The heartbeat of a process other than an agent: `<name>.heartbeat.json`, whose time of change is
the last beat.

Who supervises from outside (deploy/healthy) ends a process whose heartbeat stands still and starts
another. An agent's heartbeat says more, and others hear it (shell.py); a router, a recorder and a
control loop have this one.
"""

import os
import threading
import time
from contextlib import suppress
from pathlib import Path

import msgspec

from agent_runtime.io.run_files import heartbeat_file, make_run, write_whole

PERIOD_S = 1.0
"""As an agent's."""


class ProcessHeartbeat:
    """Beats when asked to, at most once in PERIOD_S: for each turn of a loop."""

    def __init__(self, run: Path, name: str) -> None:
        """Write the file with the process id, which is the first beat. Raises OSError."""
        self.file = heartbeat_file(run, name)
        self._data = msgspec.json.encode({"name": name, "pid": os.getpid()})
        self._next = 0.0
        self._write()

    def beat(self) -> None:
        """Say that the process gets on: a change of the file's time, no more. A run folder that is
        gone is made again.

        A beat that cannot be written is missed.
        """
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + PERIOD_S
        try:
            os.utime(self.file)
        except OSError:
            with suppress(OSError):
                make_run(self.file.parent)
                self._write()

    def _write(self) -> None:
        write_whole(self.file, self._data)


class Turns:
    """Beats for a loop that may not wait for a disk: it counts its turns, a thread sees that they
    go on.

    Before the first turn it beats as long as the process runs.

    Start it before the loop takes a real-time priority, which a new thread would inherit.
    """

    def __init__(self, pulse: ProcessHeartbeat, period_s: float = PERIOD_S) -> None:
        self.count = 0
        self._pulse, self._period_s = pulse, period_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="pulse", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Beat no more."""
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        seen = -1
        while not self._ended.wait(self._period_s):
            if self.count != seen or not self.count:
                seen = self.count
                self._pulse.beat()

"""Behaviour of an agent whose disk is full: it says so once, keeps the events in order, and tries
again.

A step whose record cannot be written has not happened: nothing of it was receipted, sent or told.
So the event waits, with those behind it, until there is room; peers send again what no receipt
covers.
"""

import errno
import os
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from agent_runtime.io.logs import Log

PAUSES_S = (0.1, 0.2, 0.5, 1.0)
"""Between tries; the last one again and again. Estimate: people free a disk in minutes."""
DISK = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "the file may not grow any more",
    errno.EIO: "the disk fails",
    errno.EROFS: "the disk is read-only",
}


def worded(path: object, error: OSError) -> str:
    """What is wrong with the disk, in words."""
    what = DISK.get(error.errno or 0, "the disk cannot be used")
    return f"{what}: {path} cannot be written ({error.strerror or error})"


class FullDisk:
    """State of one agent. `why`: what is wrong now, "" where nothing is; `events`: those that wait,
    oldest first.
    """

    def __init__(self, log: Log) -> None:
        self._log = log
        self._tries = 0
        self.why = ""
        self.events: deque[Any] = deque()

    def failed(self, path: object, error: OSError) -> None:
        """Note a write that failed; said once."""
        if not self.why:
            self.why = worded(path, error)
            why = (
                f"{self.why}; nothing is receipted, said or done until there is room, then it goes"
                " on by itself"
            )
            self._log.write("no room", level="error", why=why)

    def freed(self) -> None:
        """Note a write that came through."""
        if self.why:
            self.why, self._tries = "", 0
            self._log.write("room again", why="what waited goes on")

    def pause_s(self) -> float:
        """The time until the next try."""
        self._tries += 1
        return PAUSES_S[min(self._tries, len(PAUSES_S)) - 1]

    def wait_for_room(
        self, happen: Callable[[Any], None], beat: Callable[[], None], stopped: Callable[[], bool]
    ) -> None:
        """Try the steps that could not be recorded again, until they can or a signal comes; beat on
        meanwhile.
        """
        while self.events and not stopped():
            beat()
            time.sleep(self.pause_s())
            waiting, self.events = self.events, deque()
            for event in waiting:
                happen(event)


def overwrite(path: Path, data: bytes) -> None:
    """Write over a small file where there is no room for another beside it; a longer one is only
    touched.

    Raise OSError.
    """
    fd = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    try:
        size = os.fstat(fd).st_size
        if len(data) <= size:
            os.pwrite(fd, data.ljust(size), 0)  # JSON may end in blanks
    finally:
        os.utime(fd)
        os.close(fd)

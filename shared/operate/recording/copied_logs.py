"""Step logs of agents on other hosts, or in containers of their own: copied into the recorder's run folder.

An agent that lives and has no log in the folder is asked for it, each ASK_S, with what is there of it already
(agent_runtime.io.log_sender). So a copy is whole whenever the recorder began, and whatever was lost on the way; who
reads the folder reads a copy as any other log.
"""

import time
from collections.abc import Callable
from pathlib import Path

from agent_runtime.core.wiring import service_key
from agent_runtime.io.log_sender import OFFSET, WANTED
from operate.run_folder import STEPS

ASK_S = 1.0
"""Between two askings; estimate: a copy that lacks something goes on within it."""
COPIED = "copied"
"""Ending of the name of an empty file beside a log: it is a copy."""

Put = Callable[[str, bytes], None]


class CopiedLogs:
    """The copies in one run folder, of the agents of one system."""

    def __init__(self, run: Path, system: str) -> None:
        self._folder, self._system = run / STEPS, system
        self._of = {path.stem for path in self._folder.glob(f"*.{COPIED}")}
        self._living: set[str] = set()
        self._asked = 0.0

    def lived(self, agent: str, *, alive: bool) -> None:
        """An agent came, or is gone."""
        if not alive:
            self._living.discard(agent)
            return
        self._living.add(agent)
        if agent not in self._of and not self._log(agent).exists():
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            (self._folder / f"{agent}.{COPIED}").touch(mode=0o600)
            self._of.add(agent)

    def ask(self, put: Put, own: str) -> None:
        """Ask for what is missing, where it is time; `own`: the name of who asks."""
        now = time.monotonic()
        if now < self._asked + ASK_S:
            return
        self._asked = now
        for agent in sorted(self._of & self._living):
            put(service_key(self._system, WANTED, own, agent), OFFSET.pack(self._size(agent)))

    def take(self, agent: str, data: bytes) -> None:
        """Add a part of a log to the copy, if it goes on from there. Raise OSError."""
        if agent not in self._of or len(data) <= OFFSET.size:
            return
        (at,) = OFFSET.unpack_from(data)
        size, end = self._size(agent), at + len(data) - OFFSET.size
        if at <= size < end:
            with self._log(agent).open("ab") as file:
                file.write(data[OFFSET.size + size - at :])

    def _log(self, agent: str) -> Path:
        return self._folder / f"{agent}.{STEPS}"

    def _size(self, agent: str) -> int:
        log = self._log(agent)
        return log.stat().st_size if log.exists() else 0

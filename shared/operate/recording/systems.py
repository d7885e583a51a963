"""Folders of the recordings of several systems: robots at one router, and one monitor.

With one system its recording is in the run folder itself; with several each has the folder of its name therein, which
may be the run folder of that robot's fleet, and its step logs are there then.
"""

import re
from pathlib import Path

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
"""A system's name is one chunk of a key, and here a folder's name."""


class SystemNameError(ValueError):
    """A system's name that could not be a folder's; `name`."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"no system can be called {name!r}: letters, digits and _.- only, as in velma1")


def folders(run: Path, systems: tuple[str, ...]) -> dict[str, Path]:
    """System -> where its recording is. Raises SystemNameError."""
    for name in systems:
        if NAME.fullmatch(name) is None:
            raise SystemNameError(name)
    return {systems[0]: run} if len(systems) == 1 else {name: run / name for name in systems}

"""Calls of the recorder's own tools on recordings and results; they run as processes, since only the recorder reads
recordings.
"""

import os
import subprocess
import sys
from pathlib import Path

from operate.cli.errors import NO, WRONG_USE, ConsoleError
from operate.system import System, here, of_run

RECORDING = "operate.recording"
TIMEOUT_S = 600.0
"""Thirty recordings are read in a minute on a loaded machine; estimate, with room."""


class AnalysisError(ConsoleError):
    """The tool has nothing to work on (`usage`: the caller named the wrong thing), or it died."""

    def __init__(self, text: str, *, usage: bool = False) -> None:
        self.code = WRONG_USE if usage else NO
        super().__init__(text)


def command(*words: str) -> list[str]:
    """Return how the recorder's tool `words` is called."""
    return [sys.executable, "-P", "-m", RECORDING, *words]


def environment(system: System) -> dict[str, str]:
    """Return the environment by which a process finds the same system."""
    return os.environ | system.environment(Path())


def analysed(verb: str, *words: str, about: Path | None = None) -> bytes:
    """Return the output of `python -m operate.recording VERB WORDS`. Raises AnalysisError with its error message.

    `about`: the run or recording whose system is meant; else the one of this folder.
    """
    shared = environment(here() if about is None else of_run(about))
    try:
        done = subprocess.run(command(verb, *words), env=shared, capture_output=True, timeout=TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise AnalysisError(
            f"{verb} has not ended after {TIMEOUT_S:.0f} s; give fewer or shorter recordings"
        ) from error
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip()
        last = said.splitlines()[-1] if said else f"{verb} ended with {done.returncode}"
        missing = "; install the extra `monitor`" if "ModuleNotFoundError" in said else ""
        raise AnalysisError(last + missing, usage=done.returncode == WRONG_USE)
    return done.stdout

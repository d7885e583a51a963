"""What the monitor's own tools make of recordings and results: processes, for recordings are the monitor's business."""

import subprocess
import sys

from operate.cli.errors import NO, WRONG_USE, ConsoleError

MONITOR = "services.monitor"
TIMEOUT_S = 600.0
"""Thirty recordings are read in a minute on a loaded machine; estimate, with room."""


class AnalysisError(ConsoleError):
    """The tool has nothing to work on (`usage`: the caller named the wrong thing), or it died."""

    def __init__(self, text: str, *, usage: bool = False) -> None:
        self.code = WRONG_USE if usage else NO
        super().__init__(text)


def analysed(verb: str, *words: str) -> bytes:
    """What `python -m services.monitor VERB WORDS` prints. Raises AnalysisError with what it said."""
    command = [sys.executable, "-m", MONITOR, verb, *words]
    try:
        done = subprocess.run(command, capture_output=True, timeout=TIMEOUT_S, check=False)
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

"""The verdicts about a run for `roco traffic` and `roco conversation`: read, or made again by the monitor's own judge.

The judge afterwards is a process (`python -m services.monitor judge`): recordings are the monitor's business.
"""

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import msgspec

from operate.cli.errors import ConsoleError
from operate.run_folder import VERDICTS_FILE, Judged

MONITOR = "services.monitor"
NOTHING_TO_JUDGE = 2
_decoder = msgspec.json.Decoder(Judged)


class JudgeError(ConsoleError):
    """There is nothing to judge (`usage`: the caller named the wrong thing), or the judge died."""

    def __init__(self, text: str, *, usage: bool = False) -> None:
        self.usage = usage
        super().__init__(text)


def judged(file: Path, design: Path | None = None, languages: str = "") -> list[Judged]:
    """The verdicts about a recording, made now. Raises JudgeError."""
    command = [sys.executable, "-m", MONITOR, "judge", str(file)]
    command += [] if design is None else ["--design", str(design)]
    command += ["--languages", languages] if languages else []
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip()
        raise JudgeError(words or f"the judge ended with {done.returncode}", usage=done.returncode == NOTHING_TO_JUDGE)
    return read(done.stdout.splitlines())


def told(run: Path) -> list[Judged]:
    """The verdicts the monitor wrote while it listened; of a run without them the recording is judged now."""
    file = run / VERDICTS_FILE
    return read(file.read_bytes().splitlines()) if file.exists() else judged(run)


def read(lines: Iterable[bytes]) -> list[Judged]:
    """Lines as verdicts, in the order of time; one that is not whole yet, or of another version, is left out."""
    found: list[Judged] = []
    for line in lines:
        try:
            found.append(_decoder.decode(line))
        except msgspec.DecodeError:
            continue
    return sorted(found, key=lambda one: one.t)

"""The verdicts about a run for `roco traffic` and `roco conversation`: read, or made again by the monitor's own judge.

The judge afterwards is a process (`python -m operate.recording judge`): recordings are the recorder's business.
"""

import os
import subprocess
from collections.abc import Iterable
from pathlib import Path

import msgspec

from operate.cli.analysis import command, environment
from operate.cli.errors import WRONG_USE, ConsoleError
from operate.run_folder import VERDICTS_FILE, Judged
from operate.system import of_run

_decoder = msgspec.json.Decoder(Judged)


class JudgeError(ConsoleError):
    """There is nothing to judge (`usage`: the caller named the wrong thing), or the judge died."""

    def __init__(self, text: str, *, usage: bool = False) -> None:
        if usage:
            self.code = WRONG_USE
        super().__init__(text)


def judged(file: Path, design: Path | None = None, languages: str = "") -> list[Judged]:
    """The verdicts about a recording, made now. Raises JudgeError."""
    asked = [str(file), *(["--design", str(design)] if design else [])]
    asked += ["--languages", languages] if languages else []
    shared = dict(os.environ) if design else environment(of_run(file))
    done = subprocess.run(command("judge", *asked), env=shared, capture_output=True, check=False)
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip()
        raise JudgeError(words or f"the judge ended with {done.returncode}", usage=done.returncode == WRONG_USE)
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

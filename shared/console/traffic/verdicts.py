"""The verdicts about a run for `roco traffic` and `roco conversation`: as its monitor wrote them,
or made now.
"""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import msgspec

from operate.file_names import VERDICTS_FILE
from operate.system import System, of_run
from operate.verdict_lines import Judged

_decoder = msgspec.json.Decoder(Judged)


def judged(file: Path, system: System | None = None) -> list[Judged]:
    """The verdicts about a recording, made now, by the design of its own system or of another
    one.
    """
    from operate.recording.run import verdicts

    return list(verdicts(file, of_run(file) if system is None else system))


def verdicts_of(run: Path) -> list[Judged]:
    """The verdicts the monitor wrote while it listened; of a run without them the recording is
    judged now.
    """
    file = run / VERDICTS_FILE
    return read(file.read_bytes().splitlines()) if file.exists() else judged(run)


def read(lines: Iterable[bytes]) -> list[Judged]:
    """Lines as verdicts, in the order of time; one that is not whole yet, or of another version, is
    left out.
    """
    found: list[Judged] = []
    for line in lines:
        with suppress(msgspec.DecodeError):
            found.append(_decoder.decode(line))
    return sorted(found, key=lambda one: one.t)

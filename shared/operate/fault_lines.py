"""faults.jsonl: whole lines of bytes in, faults out, the last line of each id; and what is new in
the file.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec

from fipa_codec.communicate import UNREADABLE
from operate.run_folder import FAULTS_FILE, Fault

_decoder = msgspec.json.Decoder(Fault)


def encoded(fault: Fault) -> bytes:
    """Return a fault as a line."""
    return msgspec.json.encode(fault) + b"\n"


def read(data: bytes) -> Iterator[Fault]:
    """Yield the faults of whole lines in their order; a line that is torn or of another version is
    left out.
    """
    for line in data[: data.rfind(b"\n") + 1].splitlines():
        try:
            yield _decoder.decode(line)
        except UNREADABLE:
            continue


def latest(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return each fault as its last line has it, in the order in which they were asked for."""
    return tuple({one.id: one for one in faults}.values())


def done(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return those that began, in the order of their beginnings."""
    return tuple(sorted((one for one in latest(faults) if one.began), key=lambda one: one.began))


class FaultFile:
    """The file of a run. Lines up to `known` [unix s] were recorded by a recorder before this
    one.
    """

    def __init__(self, run: Path, known: float = 0.0) -> None:
        self._path, self._known, self._offset = run / FAULTS_FILE, known, 0

    def new(self) -> list[Fault]:
        """Return the faults whose lines were written since the last look; a line not whole yet
        comes later.
        """
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
        except OSError:
            return []
        self._offset += data.rfind(b"\n") + 1
        return [one for one in read(data) if one.t > self._known]

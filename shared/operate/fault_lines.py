"""faults.jsonl: whole lines of bytes in, faults out, the last line of each id; and what is new in
the file.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec

from fipa_codec.communicate import UNREADABLE
from operate.file_names import FAULTS_FILE


class Fault(msgspec.Struct, frozen=True, omit_defaults=True, kw_only=True):
    """One line of faults.jsonl, written by `roco fault`: a fault on purpose. A later line replaces
    those of its id.

    `t`: when the line was written; `began`: 0 while it waits for its moment `at`; `ended`: None
    while it goes on [unix s]. `text`: what came of it. `pid`, `start`: the process that was hit,
    and when that started [ticks after boot]. `by`, `by_start`: the command that heals it, likewise;
    where it is gone, the next `roco fault list` or `heal` does. `amount`, `speaker`: of kinds that
    have one (docs/faults.md). `neighbour`: of a fault of one link, whom that leads to. `what`: of a
    kind that only this system has, what is done to which part, in words; `target` is then the
    process that does it.
    """

    id: str
    kind: str
    target: str
    t: float
    began: float = 0.0
    ended: float | None = None
    at: str = ""
    text: str = ""
    pid: int = 0
    start: int = 0
    by: int = 0
    by_start: int = 0
    amount: float = 0.0
    speaker: str = ""
    neighbour: str = ""
    what: str = ""

    @property
    def wire(self) -> str:
        """The name of the wires that it is done to: all of the target, or its link with a
        neighbour, as co-pl.
        """
        return f"{self.target}-{self.neighbour}" if self.neighbour else self.target

    @property
    def words(self) -> str:
        """Kind and target, amount, speaker and moment: "delay pl by 0.2 at pl:searching"."""
        by = f" by {self.amount:g}" if self.amount else ""
        of = f" as {self.speaker}" if self.speaker else ""
        return f"{self.kind} {self.what or self.wire}{by}{of}{f' at {self.at}' if self.at else ''}"


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

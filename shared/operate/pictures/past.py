"""What was before somebody looked: of a run that goes on, from its recording and its verdicts."""

import heapq
from collections.abc import Iterator
from pathlib import Path

import msgspec

from operate.pictures.happenings import Happening, Reader
from operate.recording.mcap_file import FILE, Reading
from operate.recording.records import House
from operate.run_folder import VERDICTS_FILE, Judged
from operate.system import System

SIGNALS_S = 900.0
"""Signals of the robot are drawn from so long before on [s], everything else from the beginning. Drawing them takes a
processor 2 % of their time, at the lowest of priorities (docs/rerun.md)."""
LATE_S = 60.0
"""What agents logged, and a verdict about it, may come so much later than it was said [s]; estimate: answers are waited
for that long."""
_decode = msgspec.json.Decoder(Judged).decode


class Past:
    """Happenings before `at` [unix s]; what comes from then on, who feeds the pictures has."""

    def __init__(self, at: float = 0.0) -> None:
        self._at = at
        self._judged: set[tuple[float, str, str]] = set()
        self._received: set[float] = set()

    def has(self, at: float) -> bool:
        """Whether the past has what was heard at `at` [unix s]."""
        return at < self._at and (at < self._at - LATE_S or at in self._received)

    def judged(self, one: Judged) -> bool:
        """Whether the past has this verdict."""
        return _name(one) in self._judged

    def read(self, run: Path, system: System, reader: Reader) -> Iterator[Happening]:
        """Yield them in the order of time."""
        return heapq.merge(self._heard(run, system, reader), self._verdicts(run), key=lambda one: one.at)

    def _heard(self, run: Path, system: System, reader: Reader) -> Iterator[Happening]:
        signals = system.addition("telemetry") or {}
        for record in Reading(run / FILE, system):
            old = record.received < self._at - SIGNALS_S
            if record.received >= self._at or (old and isinstance(record, House) and record.kind in signals):
                continue
            if record.received > self._at - LATE_S:
                self._received.add(record.received)
            yield from reader.read(record)

    def _verdicts(self, run: Path) -> Iterator[Happening]:
        try:
            lines = (run / VERDICTS_FILE).open("rb")
        except FileNotFoundError:
            return
        with lines:
            for line in lines:
                if not line.endswith(b"\n"):  # it is being written
                    return
                one = _decode(line)
                if one.t >= self._at:
                    continue
                if one.t > self._at - LATE_S:
                    self._judged.add(_name(one))
                yield Happening(one.t, one)


def _name(one: Judged) -> tuple[float, str, str]:
    return one.t, one.id, one.verdict

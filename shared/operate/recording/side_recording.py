"""`roco record`: a filtered recording beside the run's own, of what `hear` prints, until it is stopped.

The file is whole up to FLUSH_S before a kill. No report and no judge: what is kept can be judged, shown and replayed
afterwards. It ends with the process that started it.
"""

import os
import signal
import sys
import threading
import time
from pathlib import Path

import msgspec

from agent_runtime.io.tap import Sample, Waiting
from operate.filters import Filter
from operate.recording.contents import versions_now
from operate.recording.mcap_file import Recording
from operate.recording.records import SETTING, House, Record, Spoken, Token, understood
from operate.recording.stored import NOTE
from operate.system import System

FLUSH_S = 0.1
TOLD_S = 0.5
"""Seconds between two reports of progress; estimate: what a person watches."""
FILTER = "filter"


class Kept(msgspec.Struct, frozen=True):
    """Progress of a recording: communicates, all records, bytes of the file, since when [s], what came too fast."""

    communicates: int
    records: int
    bytes: int
    seconds: float
    dropped: int


class Asked(msgspec.Struct, frozen=True):
    """Target and filter of a recording; `count` communicates or `seconds`, 0: until it is stopped."""

    out: Path
    which: Filter
    count: int
    seconds: float


class Keeper:
    """The open recording."""

    def __init__(self, asked: Asked, system: System) -> None:
        self._asked, self._system, self._began = asked, system, time.time()
        self._recording = Recording(asked.out)
        self.communicates = self.records = 0
        self._recording.note(NOTE, versions_now(system))
        if asked.which:
            self._recording.note(FILTER, {kind: ",".join(names) for kind, names in _named(asked.which)})

    @property
    def over(self) -> bool:
        """Whether there is enough."""
        enough = self._asked.count and self.communicates >= self._asked.count
        return bool(enough or (self._asked.seconds and time.time() - self._began >= self._asked.seconds))

    def take(self, sample: Sample) -> None:
        """Keep a sample, if it is meant: with a filter only communicates, and what is needed to judge them."""
        record = understood(sample, self._system)
        if isinstance(record, House) and record.kind == SETTING:  # which `hear` tells first, where there is one
            self._add(msgspec.structs.replace(record, owner="record", received=self._began))
            return
        which = self._asked.which
        if which and not (which.keeps(record) if isinstance(record, Spoken) else isinstance(record, Token)):
            return
        self._add(record)
        self.communicates += isinstance(record, Spoken)

    def kept(self, dropped: int) -> Kept:
        """Return the progress, after handing all to the operating system."""
        self._recording.flush()
        size = self._asked.out.stat().st_size
        return Kept(self.communicates, self.records, size, round(time.time() - self._began, 3), dropped)

    def finish(self, dropped: int) -> Kept:
        """Close in order."""
        why = self._recording.finish()
        if why:
            print(f"{why}; the recording is whole, `roco record repair` makes its index", file=sys.stderr)
        size = self._asked.out.stat().st_size
        return Kept(self.communicates, self.records, size, round(time.time() - self._began, 3), dropped)

    def _add(self, record: Record) -> None:
        self._recording.add(record)
        self.records += 1


def serve(system: System, asked: Asked) -> None:
    """Record what comes on standard input, to its end; tells on standard output how far it is, a Kept a line."""
    waiting, parent = _until_told(), os.getppid()
    threading.Thread(target=_read, args=(waiting,), daemon=True).start()
    keeper = Keeper(asked, system)
    _keep(keeper, waiting, parent)
    _end(keeper, waiting)


def _until_told() -> Waiting:
    """A flag that a signal sets."""
    waiting = Waiting()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, waiting.stop)
    return waiting


def _read(waiting: Waiting) -> None:
    with os.fdopen(os.dup(0), "rb") as lines:  # sys.stdin may not be in use by a thread when Python ends
        waiting.fill(lines)


def _keep(keeper: Keeper, waiting: Waiting, parent: int) -> None:
    flushed = told = time.monotonic()
    _tell(keeper.kept(0))
    while not waiting.stopped and not keeper.over and os.getppid() == parent:
        sample = waiting.get(FLUSH_S)
        if sample is not None:
            keeper.take(sample)
        now = time.monotonic()
        if now - flushed > FLUSH_S:
            kept, flushed = keeper.kept(waiting.dropped), now
            if now - told > TOLD_S:
                _tell(kept)
                told = now


def _end(keeper: Keeper, waiting: Waiting) -> None:
    for sample in waiting.left():
        if not keeper.over:
            keeper.take(sample)
    _tell(keeper.finish(waiting.dropped))


def _named(which: Filter) -> list[tuple[str, tuple[str, ...]]]:
    return [(kind, getattr(which, kind)) for kind in which.__struct_fields__]


def _tell(kept: Kept) -> None:
    try:
        sys.stdout.buffer.write(msgspec.json.encode(kept) + b"\n")
        sys.stdout.flush()
    except BrokenPipeError:
        pass

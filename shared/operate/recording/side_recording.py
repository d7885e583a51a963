"""A filtered recording beside the run's own (`roco record`). No report and no judge: what is kept
can be judged, shown and replayed afterwards.
"""

import time
from pathlib import Path

import msgspec

from agent_runtime.io.tap import Sample
from operate.filters import Filter
from operate.recording.contents import versions_now
from operate.recording.index import NOTE
from operate.recording.mcap_file import Recording
from operate.recording.records import SETTING, House, Spoken, Token, understood
from operate.system import System

FILTER = "filter"


class Kept(msgspec.Struct, frozen=True):
    """Progress of a recording: communicates, all records, bytes of the file, since when [s], what
    came too fast.
    """

    communicates: int
    records: int
    bytes: int
    seconds: float
    dropped: int
    file: str


class Asked(msgspec.Struct, frozen=True):
    """Target and filter of a recording; `count` communicates or `seconds`, 0: until it is
    stopped.
    """

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
            names = msgspec.structs.asdict(asked.which)
            self._recording.note(FILTER, {kind: ",".join(some) for kind, some in names.items()})

    @property
    def over(self) -> bool:
        """Whether there is enough."""
        enough = self._asked.count and self.communicates >= self._asked.count
        return bool(
            enough or (self._asked.seconds and time.time() - self._began >= self._asked.seconds)
        )

    def take(self, sample: Sample) -> None:
        """Keep a sample, if it is meant: with a filter only communicates, and what is needed to
        judge them.
        """
        record, which = understood(sample, self._system), self._asked.which
        # which `hear` tells first, where there is one
        if isinstance(record, House) and record.kind == SETTING:
            record = msgspec.structs.replace(record, owner="record", received=self._began)
        elif which and not (
            which.keeps(record) if isinstance(record, Spoken) else isinstance(record, Token)
        ):
            return
        self._recording.add(record)
        self.records += 1
        self.communicates += isinstance(record, Spoken)

    def kept(self, dropped: int) -> Kept:
        """Return the progress, after handing all to the operating system."""
        self._recording.flush()
        return self._kept(dropped)

    def finish(self, dropped: int) -> tuple[Kept, str]:
        """Close in order; the progress, and why the file has no index, "" where it has one."""
        why = self._recording.finish()
        return self._kept(
            dropped
        ), f"{why}; the recording is whole, `roco record repair` makes its index" if why else ""

    def _kept(self, dropped: int) -> Kept:
        size, seconds = self._asked.out.stat().st_size, round(time.time() - self._began, 3)
        return Kept(self.communicates, self.records, size, seconds, dropped, str(self._asked.out))

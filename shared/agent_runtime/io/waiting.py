"""Samples of a tap that wait for the one thread that takes them: bounded, so that a slow reader costs no memory."""

import threading
from collections.abc import Iterable
from contextlib import suppress
from queue import Empty

import msgspec

from agent_runtime.io.one_reader import OneReaderQueue
from agent_runtime.io.tap import Sample

MOST_WAITING = 100_000
"""Samples that may wait; beyond that they are dropped and counted. Estimate: minutes of traffic."""
MOST_BYTES = 256 * 1024 * 1024
"""All of their data together; estimate: a hundred seconds of a pour have 25 MB."""


class Waiting:
    """Samples that wait; `dropped`: how many were too many; `stopped`: no more are wanted."""

    def __init__(self) -> None:
        self._queue = OneReaderQueue[Sample | None]()
        self._lock = threading.Lock()
        self._bytes = 0
        self.dropped = 0
        self.stopped = False

    def put(self, sample: Sample) -> None:
        """From Zenoh's threads; never blocks."""
        size = len(sample.data)
        with self._lock:
            if len(self._queue) >= MOST_WAITING or self._bytes + size > MOST_BYTES:
                self.dropped += 1
                return
            self._bytes += size
        self._queue.put(sample)

    def fill(self, lines: Iterable[bytes]) -> None:
        """From a thread of its own: put samples that another process wrote, a JSON object a line; then stop."""
        decoder = msgspec.json.Decoder(Sample)
        for line in lines:
            with suppress(msgspec.DecodeError):  # the last one may be cut off
                self.put(decoder.decode(line))
        self.stop()

    def stop(self, *_: object) -> None:
        """From a signal: takes no lock that the interrupted thread might hold."""
        self.stopped = True
        self._queue.put(None)

    def get(self, timeout_s: float) -> Sample | None:
        """The oldest sample; None: stop, or none came in time."""
        try:
            return self._taken(self._queue.get(timeout_s))
        except Empty:
            return None

    def left(self) -> list[Sample]:
        """Return the waiting samples."""
        left = []
        while len(self._queue):
            sample = self.get(0.0)
            if sample is not None:
                left.append(sample)
        return left

    def _taken(self, sample: Sample | None) -> Sample | None:
        if sample is not None:
            with self._lock:
                self._bytes -= len(sample.data)
        return sample

"""Samples of a tap that wait for the one thread that takes them: bounded, so that a slow reader costs no memory."""

import queue

from agent_runtime.tap import Sample

MOST_WAITING = 100_000
"""Samples that may wait; beyond that they are dropped and counted. Estimate: minutes of traffic."""


class Waiting:
    """Samples that wait; `dropped`: how many were too many; `stopped`: no more are wanted."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Sample | None] = queue.SimpleQueue()
        self.dropped = 0
        self.stopped = False

    def put(self, sample: Sample) -> None:
        """From Zenoh's threads; never blocks."""
        if self._queue.qsize() < MOST_WAITING:
            self._queue.put(sample)
        else:
            self.dropped += 1

    def stop(self, *_: object) -> None:
        """From a signal: SimpleQueue's put may be called while the same thread is in it."""
        self.stopped = True
        self._queue.put(None)

    def get(self, timeout_s: float) -> Sample | None:
        """The oldest sample; None: stop, or none came in time."""
        try:
            return self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def left(self) -> list[Sample]:
        """What still waits."""
        left = []
        while not self._queue.empty():
            sample = self._queue.get()
            if sample is not None:
                left.append(sample)
        return left

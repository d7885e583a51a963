"""The monitor's end: a bounded queue, a thread, and a child that draws. Whatever becomes of them, the recorder goes on.

`put` never waits: what finds no room drives out what is oldest, and is counted. The thread writes to the child's pipe;
it alone waits for a child that is slow or frozen, and starts a new one, after a growing pause, where one has died.
"""

import importlib.util
import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from agent_runtime.io.tap import Sample
from operate.pictures.viewer_address import SWITCH, Place, wanted
from operate.pictures.wire import Heard, Item, Missed, Said, encode, framed
from operate.run_folder import Judged
from operate.system import System

QUEUE_BYTES = 8 * 1024 * 1024
"""Waits at most for the child; estimate: a minute of a pour. Beside it, one batch of at most BATCH_BYTES is written."""
BATCH_BYTES = 1024 * 1024
OVERHEAD = 100
"""Bytes that Python needs beside those of an item (bytes object and its place in the queue), rounded up."""
PERIOD_S = 0.05
"""Between two writes: the thread wakes for many samples at once. Estimate: an eye does not see it."""
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 30.0
"""Between two children; estimate."""
END_S = 5.0
"""The child may take so long to end in order, then it is killed."""
Say = Callable[..., None]


class Queue:
    """Encoded items that wait for the child, at most `most` bytes of them with their overhead."""

    def __init__(self, most: int = QUEUE_BYTES) -> None:
        self._most, self._items = most, deque[bytes]()
        self._lock = threading.Lock()
        self.bytes = 0
        self.dropped = 0

    def put(self, item: bytes) -> None:
        """Add an item; the oldest ones make room for it, and one that is larger than all room is dropped itself."""
        with self._lock:
            self._items.append(item)
            self.bytes += len(item) + OVERHEAD
            while self.bytes > self._most:
                self.bytes -= len(self._items.popleft()) + OVERHEAD
                self.dropped += 1

    def take(self, most: int = BATCH_BYTES) -> list[bytes]:
        """Return the oldest items of at most this many bytes, at least one if there is one."""
        taken: list[bytes] = []
        size = 0
        with self._lock:
            while self._items and (not taken or size + len(self._items[0]) <= most):
                item = self._items.popleft()
                self.bytes -= len(item) + OVERHEAD
                size += len(item)
                taken.append(item)
        return taken


class Feed:
    """Feeds a child that draws a run in `run`, served at `place`."""

    def __init__(self, run: Path, place: Place, system: System, say: Say, *, command: tuple[str, ...] = ()) -> None:
        """`command`: another program than the child (tests)."""
        self._queue = Queue()
        self._command = command or (sys.executable, "-P", "-m", "operate.pictures", str(run), *place.words)
        self._run, self._say = run, say
        self._environment = _environment() | system.environment(run)
        self._over = threading.Event()
        self._child: subprocess.Popen[bytes] | None = None
        self._told = 0
        self._thread = threading.Thread(target=self._serve, name="feed", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Return the number of items that found no room so far."""
        return self._queue.dropped

    @property
    def pid(self) -> int:
        """The child's process; 0: none at present."""
        child = self._child
        return child.pid if child is not None and child.poll() is None else 0

    def heard(self, sample: Sample) -> None:
        """Show a sample. Never waits."""
        self._put(Heard(sample))

    def said(self, judged: Judged) -> None:
        """Show a verdict. Never waits."""
        self._put(Said(judged))

    def close(self) -> None:
        """End the child, in order where it follows, else by kill."""
        self._over.set()
        child = self._child
        if child is not None and child.poll() is None:
            child.terminate()
            try:
                child.wait(END_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
        self._thread.join(timeout=END_S)

    def _put(self, item: Item) -> None:
        self._queue.put(encode(item))

    def _serve(self) -> None:
        pause = FIRST_PAUSE_S
        while not self._over.is_set():
            began = time.monotonic()
            try:
                self._start()
                self._write()
            except OSError as error:  # the pipe broke: the child is gone; or no process could be made
                self._tell_end(error)
            pause = FIRST_PAUSE_S if time.monotonic() - began > LONGEST_PAUSE_S else min(2 * pause, LONGEST_PAUSE_S)
            self._over.wait(pause)

    def _start(self) -> None:
        with (self._run / "rerun.log").open("ab") as log:
            self._child = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=log, stderr=log, bufsize=0, env=self._environment
            )
        self._say("showing", pid=self._child.pid)

    def _write(self) -> None:
        """Write until the end is asked for, or the pipe breaks (OSError)."""
        child = self._child
        assert child is not None
        assert child.stdin is not None
        with child.stdin as pipe:
            while not self._over.wait(PERIOD_S):
                if child.poll() is not None:
                    raise BrokenPipeError(f"it ended with code {child.returncode}")
                while items := self._queue.take():
                    _write_all(pipe.fileno(), b"".join(framed(item) for item in items))
                if self._queue.dropped > self._told:
                    self._told = self._queue.dropped
                    self._put(Missed(time.time(), self._told))

    def _tell_end(self, error: OSError) -> None:
        if not self._over.is_set():
            self._say("no pictures for now", level="warning", why=str(error), file=str(self._run / "rerun.log"))


def _write_all(pipe: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(pipe, view) :]


def _environment() -> dict[str, str]:
    """One thread for what numpy and Rerun compute: the cores belong to the fleet."""
    return os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def feeding(where: Mapping[str, Path], system: System, say: Say) -> dict[str, Feed]:
    """A feed for each system's run, as the environment wants it; none where that is wrong, which `say` reports.

    None either where Rerun is not installed, as in the recorder's image.
    """
    feeds = {}
    if os.environ.get(SWITCH) != "off" and importlib.util.find_spec("rerun") is None:
        say("no pictures", why="Rerun is not installed here; `roco view` shows the recording where it is")
        return {}
    for number, (name, run) in enumerate(where.items()):
        try:
            place = wanted(os.environ, number)
        except ValueError as error:
            say("no pictures", level="error", why=str(error))
            return {}
        if place is not None:
            feeds[name] = Feed(run, place, system, partial(say, system=name))
    return feeds

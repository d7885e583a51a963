"""The monitor's end: the ports of the pictures, a bounded queue, a thread, and a child that draws
once somebody looks.

Until then nothing is drawn. What was heard in the last seconds is kept; what was before it, the
child reads from the recording. `put` never waits: what finds no room drives out what is oldest, and
is counted. The thread writes to the child's pipe; it alone waits for a child that is slow or
frozen. Where one has died, the next viewer has a new one started, after a growing pause.
"""

import importlib.util
import os
import select
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path

import msgspec

from agent_runtime.io.tap import Sample
from operate.pictures.viewer_address import SWITCH, Place, opened, tell, wanted
from operate.system import System
from operate.verdict_lines import Judged

# --- The pipe to the process that draws: frames of four bytes of length and msgpack, an Item each


LENGTH = 4
LONGEST = 64 * 1024 * 1024
"""Bytes of a frame; a longer one is damage (the longest communicate has 4 MiB)."""


class Heard(msgspec.Struct, frozen=True, tag="s"):
    """A sample of the tap."""

    sample: Sample


class ShownVerdict(msgspec.Struct, frozen=True, tag="v"):
    """A verdict."""

    judged: Judged


class Missed(msgspec.Struct, frozen=True, tag="m"):
    """So many samples were dropped so far, since drawing was too slow; `at`: when that was noticed
    [unix s].
    """

    at: float
    samples: int


class Since(msgspec.Struct, frozen=True, tag="b"):
    """The first item: what was heard before `at` [unix s] is in the recording only."""

    at: float


Item = Heard | ShownVerdict | Missed | Since
encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(Item).decode


def framed(data: bytes) -> bytes:
    """An encoded item as it goes through the pipe."""
    return len(data).to_bytes(LENGTH, "big") + data


class Frames:
    """Takes bytes as they come, gives the items that are whole."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[Item]:
        """The items that these bytes complete. Raises ValueError where they are something else than
        frames.
        """
        self._rest += data
        items, at = [], 0
        while len(self._rest) - at >= LENGTH:
            length = int.from_bytes(self._rest[at : at + LENGTH], "big")
            if length > LONGEST:
                raise ValueError(
                    f"a frame of {length} bytes, at most {LONGEST}: this is not a pipe of the"
                    " monitor"
                )
            if len(self._rest) - at - LENGTH < length:
                break
            items.append(_decode(bytes(self._rest[at + LENGTH : at + LENGTH + length])))
            at += LENGTH + length
        del self._rest[:at]
        return items


# --- The monitor's end ----------------------------------------------------------------------------


QUEUE_BYTES = 8 * 1024 * 1024
"""Waits at most for the child; estimate: a minute of a pour. Beside it, one batch of at most
BATCH_BYTES is written.
"""
BATCH_BYTES = 1024 * 1024
OVERHEAD, SAID_BYTES = 500, 500
"""Bytes that Python needs beside those of an item, and for a verdict without its texts; estimates,
rounded up.
"""
RECENT_S = 5.0
"""Kept while nobody looks [s]: what is older is on the disk, where the child reads it (estimate:
the recorder hands all to the disk each 0.1 s).
"""
PERIOD_S = 0.05
"""Between two writes: the thread wakes for many samples at once. Estimate: an eye does not see
it.
"""
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 30.0
"""Between two children; estimate."""
END_S = 5.0
"""The child may take so long to end in order, then it is killed."""
Say = Callable[..., None]


class Queue:
    """Items that wait for the child, at most `most` bytes of them with their overhead."""

    def __init__(self, most: int = QUEUE_BYTES) -> None:
        self._most, self._items = most, deque[tuple[float, Item, int]]()
        self._lock = threading.Lock()
        self.bytes = 0
        self.dropped = 0

    def put(self, item: Item, size: int) -> None:
        """Add an item of so many bytes; the oldest ones make room, and one larger than all room is
        dropped itself.
        """
        with self._lock:
            self._items.append((time.monotonic(), item, size + OVERHEAD))
            self.bytes += size + OVERHEAD
            while self.bytes > self._most:
                self._remove()
                self.dropped += 1

    def take(self, most: int = BATCH_BYTES) -> list[Item]:
        """The oldest items of at most this many bytes, at least one if there is one."""
        taken: list[Item] = []
        size = 0
        with self._lock:
            while self._items and (not taken or size + self._items[0][2] <= most):
                size += self._items[0][2]
                taken.append(self._remove())
        return taken

    def forget(self, older_s: float) -> None:
        """Remove what was put longer ago than this [s]; it does not count as dropped."""
        before = time.monotonic() - older_s
        with self._lock:
            while self._items and self._items[0][0] < before:
                self._remove()

    @property
    def since(self) -> float:
        """When the oldest sample that waits was heard [unix s]; now where there is none."""
        with self._lock:
            heard = (item.sample.at for _, item, _ in self._items if isinstance(item, Heard))
            return next(heard, time.time())

    def _remove(self) -> Item:
        _, item, size = self._items.popleft()
        self.bytes -= size
        return item


class Feed:
    """Has a run in `run` drawn and served at `place` as long as somebody looks."""

    def __init__(
        self, run: Path, place: Place, system: System, say: Say, *, command: tuple[str, ...] = ()
    ) -> None:
        """`command`: another program than the child (tests)."""
        self._queue = Queue()
        self._command = command or (sys.executable, "-P", "-m", "operate.pictures", str(run))
        self._run, self._place, self._say = run, place, say
        self._environment = _environment() | system.environment(run)
        self._over, self._looking = threading.Event(), False
        self._woken, self._wake = socket.socketpair()
        self._child: subprocess.Popen[bytes] | None = None
        self._told = 0
        self._thread = threading.Thread(target=self._serve, name="feed", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """The number of items that found no room so far."""
        return self._queue.dropped

    @property
    def pid(self) -> int:
        """The child's process; 0: none at present."""
        child = self._child
        return child.pid if child is not None and child.poll() is None else 0

    def heard(self, sample: Sample) -> None:
        """Show a sample. Never waits."""
        self._put(Heard(sample), len(sample.key) + len(sample.data))

    def said(self, judged: Judged) -> None:
        """Show a verdict. Never waits."""
        self._put(
            ShownVerdict(judged), SAID_BYTES + len(judged.text) + len(judged.why) + len(judged.key)
        )

    def close(self) -> None:
        """End the child, in order where it follows, else by kill. Once more changes nothing."""
        if self._over.is_set():
            return
        self._over.set()
        self._wake.send(b"!")
        child = self._child
        if child is not None and child.poll() is None:
            child.terminate()
            try:
                child.wait(END_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
        self._thread.join(timeout=END_S)
        for end in (self._woken, self._wake):
            end.close()

    def _put(self, item: Item, size: int) -> None:
        self._queue.put(item, size)
        if not self._looking:
            self._queue.forget(RECENT_S)

    def _serve(self) -> None:
        pause = FIRST_PAUSE_S
        while not self._over.is_set():
            try:
                place = self._place
                with opened(place.bind, place.grpc) as grpc, opened(place.bind, place.web) as web:
                    tell(self._run, place)
                    self._serve_at((grpc, web))
            except OSError as error:  # another program has one of them
                self._tell_end(error)
                self._over.wait(pause)
                pause = min(2 * pause, LONGEST_PAUSE_S)

    def _serve_at(self, ports: tuple[socket.socket, socket.socket]) -> None:
        pause = FIRST_PAUSE_S
        # until somebody connects, or the end is asked for first
        while (
            not self._over.is_set()
            and self._woken not in select.select([*ports, self._woken], [], [])[0]
        ):
            began = time.monotonic()
            try:
                self._looking = True
                self._start(ports)
                self._write()
            # the pipe broke: the child is gone; or no process could be made
            except OSError as error:
                self._tell_end(error)
            finally:
                self._looking = False
            long = time.monotonic() - began > LONGEST_PAUSE_S
            pause = FIRST_PAUSE_S if long else min(2 * pause, LONGEST_PAUSE_S)
            self._over.wait(pause)

    def _start(self, ports: tuple[socket.socket, socket.socket]) -> None:
        files = [port.fileno() for port in ports]
        with (self._run / "rerun.log").open("ab") as log:
            self._child = subprocess.Popen(
                (*self._command, *map(str, files)),
                pass_fds=files,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                bufsize=0,
                env=self._environment,
            )
        self._say("showing", pid=self._child.pid)

    def _write(self) -> None:
        """Write until the end is asked for, nobody looks, or the pipe breaks (OSError)."""
        child = self._child
        assert child is not None
        assert child.stdin is not None
        with child.stdin as pipe:
            _write_all(pipe.fileno(), framed(encode(Since(self._queue.since))))
            over = False
            while not over:
                # at the end, what still waits is written once more
                over = self._over.wait(PERIOD_S)
                if child.poll() == 0:
                    self._say("nobody looks")
                    return
                if child.poll() is not None:
                    raise BrokenPipeError(f"it ended with code {child.returncode}")
                with suppress(BrokenPipeError):  # how it ended shows at the next turn
                    while items := self._queue.take():
                        _write_all(pipe.fileno(), b"".join(framed(encode(item)) for item in items))
                if self._queue.dropped > self._told:
                    self._told = self._queue.dropped
                    self._put(Missed(time.time(), self._told), 0)

    def _tell_end(self, error: OSError) -> None:
        if not self._over.is_set():
            told = {"why": str(error), "file": str(self._run / "rerun.log")}
            self._say("no pictures for now", level="warning", **told)


def _write_all(pipe: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(pipe, view) :]


def _environment() -> dict[str, str]:
    """One thread for what numpy and Rerun compute: the cores belong to the fleet."""
    return os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def feeding(where: Mapping[str, Path], system: System, say: Say) -> dict[str, Feed]:
    """A feed for each system's run, as the environment wants it; none where that is wrong, which
    `say` reports.

    None either where Rerun is not installed, as in the recorder's image.
    """
    feeds = {}
    if os.environ.get(SWITCH) != "off" and importlib.util.find_spec("rerun") is None:
        why = "Rerun is not installed here; `roco view` shows the recording where it is"
        say("no pictures", why=why)
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

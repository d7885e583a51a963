"""The way of what an agent hears to the thread that steps it: queue, inbox, and who may step."""

import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from queue import Empty
from time import monotonic
from typing import Any, Generic, TypeVar

import msgspec

# --- Many writers, one reader ---------------------------------------------------------------------
# A queue and an event of many writers and one reader, whose waits end. A signal handler may put and
# set.
# In CPython 3.11 `queue.SimpleQueue.get` with a time-out can wait for ever: where the deadline
# passes between two tries, the C code waits with a negative time-out (seen on 3.11.2 and 3.11.7).
# `queue.Queue.put` and `threading.Event.set` take a lock that the interrupted thread might hold:
# then it waits for itself for ever (seen in 3 of 1,500 processes that waited for an event 0.2 ms at
# a time, and were ended by a signal).
# A put and a get take 0.6 us; with SimpleQueue 0.1 us, with queue.Queue 2.4 us (measured on 2
# cores, load 5, 2026-11-23).


T = TypeVar("T")


class OneReaderQueue(Generic[T]):
    """Items in the order in which they were put. Only one thread may `get`.

    The lock is free while something may be there: who puts frees it, the reader takes it before it
    waits. Both steps of `put` are atomic, so a put amid another put or a get, as by a signal
    handler, is as good as any.
    """

    def __init__(self) -> None:
        self._items: deque[T] = deque()
        self._nothing = threading.Lock()
        self._nothing.acquire()

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: T) -> None:
        """Leave an item. Never waits."""
        self._items.append(item)
        try:  # noqa: SIM105 (with suppress a put takes 500 ns, so 220)
            self._nothing.release()
        except RuntimeError:  # it is free: the reader has not looked since the last put
            pass

    def get(self, timeout_s: float | None = None) -> T:
        """The oldest item; wait for one at most `timeout_s` [s], None: for ever. Raise
        queue.Empty.
        """
        try:
            return self._items.popleft()
        except IndexError:
            return self._awaited(timeout_s)

    def _awaited(self, timeout_s: float | None) -> T:
        until = None if timeout_s is None else monotonic() + timeout_s
        while True:
            left = (
                -1.0 if until is None else min(max(0.0, until - monotonic()), threading.TIMEOUT_MAX)
            )
            woken = self._nothing.acquire(timeout=left)
            try:
                return self._items.popleft()
            except IndexError:
                if not woken:
                    raise Empty from None


class OneReaderEvent:
    """An event that is set once. Only one thread may `wait`."""

    def __init__(self) -> None:
        self._set, self._woken = False, OneReaderQueue[None]()

    def is_set(self) -> bool:
        """Whether it happened."""
        return self._set

    def set(self) -> None:
        """Say that it happened. Never waits."""
        self._set = True
        self._woken.put(None)

    def wait(self, timeout_s: float) -> bool:
        """Wait for it at most `timeout_s` [s]; return whether it happened."""
        if not self._set:
            with suppress(Empty):
                self._woken.get(timeout_s)
        return self._set


# --- Inbox of an agent ----------------------------------------------------------------------------
# It holds events of callbacks and devices until the loop thread takes them: in turns, bounded for
# each sender.
# A callback that worked or waited would hold up every other subscriber of the session, silently; so
# callbacks only put. Each sender has a lane of each class, and the lanes are served in turns:
# whoever floods waits behind its own. What is beyond a bound is dropped and counted, and nothing is
# lost by it for good: streams are re-sent, questions asked again, receipts repeated.


class Class(StrEnum):
    """Classes of entries; those of others are bounded for each sender."""

    OWN = "own"
    """The own side: its devices, the link to the router. Never dropped."""
    LIFE = "life"
    """Liveliness tokens."""
    CONTROL = "control"
    """Receipts, pings, orders: the newest is worth most."""
    STREAM = "stream"
    VOLATILE = "volatile"


class Bound(msgspec.Struct, frozen=True):
    """`waiting`: most entries of a sender; beyond it the newest is dropped, or (`latest`) the
    oldest.

    `rate`: how many a second are taken from a sender, after `burst` at once; more are dropped
    before they cost a step.
    """

    waiting: int
    rate: float
    burst: float
    latest: bool = False


BOUNDS = {
    Class.LIFE: Bound(1024, rate=4000.0, burst=4000.0),
    Class.CONTROL: Bound(64, rate=1000.0, burst=1000.0, latest=True),
    Class.STREAM: Bound(64, rate=1000.0, burst=1000.0),
    Class.VOLATILE: Bound(256, rate=4000.0, burst=4000.0),
}
"""Waiting: 16 unreceipted messages with copies; some seconds of questions; all of Peers' tokens
(estimates).

Rates: whoever asks, and asks again when the answer is there, says 900 things a second (1.1 ms,
benchmarks/README.md); a machine four times as fast was assumed. What is durable waits for a disk,
and its receipt with it (estimate).
"""
MOST_BYTES = 16 * 1024 * 1024
"""Of what waits in a lane; estimate: four of the longest messages."""
_Lane = tuple[Class, str]


class _Interrupt(msgspec.Struct, frozen=True):
    """An entry that was left by a signal handler."""

    item: Any


class Inbox:
    """A queue for many writers and one reader. `dropped`: how many entries of which sender and
    class.
    """

    def __init__(self) -> None:
        self._turns = OneReaderQueue[_Lane | _Interrupt]()
        """Lanes in which something waits, each once."""
        self._lanes: dict[_Lane, deque[tuple[Any, int]]] = {}
        self._bytes: Counter[_Lane] = Counter()
        self._left: dict[_Lane, tuple[float, float]] = {}
        self._unfinished = 0
        self._in_hand = False
        self._lock = threading.Lock()
        self.dropped: Counter[str] = Counter()

    def admits(self, kind: Class, sender: str) -> bool:
        """Whether the sender is within its rate; else it is counted as dropped. Takes no lock."""
        bound = BOUNDS.get(kind)
        if bound is None:
            return True
        now, lane = monotonic(), (kind, sender)
        left, at = self._left.get(lane, (bound.burst, now))
        left = min(bound.burst, left + (now - at) * bound.rate)
        self._left[lane] = (left - 1.0 if left >= 1.0 else left), now
        if left < 1.0:
            self.dropped[f"{kind} of {sender}"] += 1
        return left >= 1.0

    def put(self, kind: Class, item: Any, sender: str = "", size: int = 0) -> bool:
        """Leave an entry of `size` bytes; False where its sender has too many. Never blocks.

        For the stop signal use `interrupt`.
        """
        name = (kind, sender)
        with self._lock:
            lane = self._lanes.setdefault(name, deque())
            fits = self._make_room(name, lane, size)
            if fits:
                lane.append((item, size))
                self._bytes[name] += size
                self._unfinished += 1
                if len(lane) == 1:
                    self._turns.put(name)
            return fits

    def interrupt(self, item: Any) -> None:
        """Leave an entry from a signal handler: takes no lock that the interrupted thread might
        hold.
        """
        self._turns.put(_Interrupt(item))

    @property
    def idle(self) -> bool:
        """Whether no entry waits, and the reader is done with the last one: it asked for the
        next.
        """
        return self._unfinished == 0

    def get(self, timeout_s: float | None) -> Any:
        """The oldest entry of whose turn it is; None when there is none within the time (None: wait
        for ever).
        """
        if self._in_hand:
            with self._lock:
                self._unfinished -= 1
            self._in_hand = False
        try:
            turn = self._turns.get(timeout_s)
        except Empty:
            return None
        if isinstance(turn, _Interrupt):
            return turn.item
        self._in_hand = True
        with self._lock:
            lane = self._lanes[turn]
            item, size = lane.popleft()
            self._bytes[turn] -= size
            if lane:
                self._turns.put(turn)
        return item

    def _make_room(self, name: _Lane, lane: deque[tuple[Any, int]], size: int) -> bool:
        """Whether an entry fits, perhaps after the oldest was dropped."""
        bound = BOUNDS.get(name[0])
        if bound is None or (len(lane) < bound.waiting and self._bytes[name] + size <= MOST_BYTES):
            return True
        self.dropped[f"{name[0]} of {name[1]}"] += 1
        if not bound.latest or size > MOST_BYTES:
            return False
        while len(lane) > 1 and (
            len(lane) >= bound.waiting or self._bytes[name] + size > MOST_BYTES
        ):
            self._bytes[name] -= lane.popleft()[1]
            self._unfinished -= 1
        return len(lane) < bound.waiting and self._bytes[name] + size <= MOST_BYTES


# --- The thread that steps an agent: its loop thread, or one that hears ---------------------------
# A thread that hears steps where nothing waits before what it heard.
# Who steps has the lock, one at a time. What is heard while the lock is free is taken at once by
# the thread that heard it, and no second thread has to be woken for it: with that, a question and
# its answer took a tenth longer (benchmarks/as_shipped.py). What is heard while the lock is taken
# waits in the inbox, in its sender's order; so does what devices post, whose threads have work of
# their own.


class Failed(msgspec.Struct, frozen=True):
    """A step failed on a thread that hears; the loop thread ends the process."""

    error: Exception


class StepLock:
    """`until`: unix time until which the loop thread may sleep."""

    def __init__(
        self, inbox: Inbox, take: Callable[[Any], None], next_at: Callable[[], float]
    ) -> None:
        """`take` steps with an entry; `next_at`: unix time at which the loop thread has to look
        again.
        """
        self._inbox, self._take, self._next_at = inbox, take, next_at
        self._lock = threading.Lock()
        self._open = False
        self._wanted = False
        self._speaker = 0
        self._own: list[Any] = []
        self.until = 0.0

    # --- the loop thread --------------------------------------------------------------------------

    @contextmanager
    def held(self) -> Iterator[None]:
        """Take the lock before anything else is heard; return with `until` renewed."""
        self._wanted = True
        with self._lock:
            self._wanted = False
            try:
                yield
            finally:
                self.until = self._next_at()

    def open(self) -> None:
        """From now on those who hear may step."""
        with self.held():
            self._open = True

    def close(self) -> None:
        """From now on only the loop thread steps; waits for a step under way."""
        with self._lock:
            self._open = False

    def step(self, item: Any) -> None:
        """Take an entry, then what the own side posted meanwhile on the same thread. Only by who
        has the lock.
        """
        self._speaker = threading.get_ident()
        try:
            self._take(item)
        finally:
            self._speaker = 0
        if self._own:
            own, self._own = self._own, []
            for posted in own:
                self._take(posted)

    # --- any thread -------------------------------------------------------------------------------

    def put(self, kind: Class, item: Any, sender: str = "", size: int = 0) -> None:
        """From a thread that hears: step with the item, or leave it in the inbox. Never waits for
        another step.

        What is beyond the sender's rate is dropped here: a flood would else be all that this thread
        has time for.
        """
        if sender and not self._inbox.admits(kind, sender):
            return
        if not self._wanted and self._lock.acquire(blocking=False):
            try:
                if self._open and self._inbox.idle:
                    self.step(item)
                    at = self._next_at()
                    if at < self.until:
                        self.until = at
                        self._inbox.put(Class.OWN, None)  # the loop thread looks at the time
                    return
            except Exception as error:
                # whatever is heard from now on waits behind it
                self._inbox.put(Class.OWN, Failed(error))
                return
            finally:
                self._lock.release()
        self._inbox.put(kind, item, sender, size)

    def post(self, item: Any) -> None:
        """From the own side: into the inbox; from within a step it is taken right after it."""
        if self._speaker == threading.get_ident():
            self._own.append(item)
        else:
            self._inbox.put(Class.OWN, item)

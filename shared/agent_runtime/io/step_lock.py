"""The thread that steps an agent: its loop thread, or a thread that hears, where nothing waits
before what it heard.

Who steps has the lock, one at a time. What is heard while the lock is free is taken at once by the
thread that heard it, and no second thread has to be woken for it: with that, a question and its
answer took a tenth longer (benchmarks/as_shipped.py). What is heard while the lock is taken waits
in the inbox, in its sender's order; so does what devices post, whose threads have work of their
own.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgspec

from agent_runtime.io.inbox import Class, Inbox


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
                    self._step_here(item)
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

    def _step_here(self, item: Any) -> None:
        try:
            self.step(item)
        except Exception as error:
            # whatever is heard from now on waits behind it
            self._inbox.put(Class.OWN, Failed(error))
            return
        at = self._next_at()
        if at < self.until:
            self.until = at
            self._inbox.put(Class.OWN, None)  # the loop thread looks at the time

"""What a verb is doing, on standard error, for a person who waits for longer than a second.

A line that is drawn again each second and goes away before anything else is written. A verb that
has written something is shown again only where it says what it does (operate.doing): it may wait
for what others do, as `roco traffic echo`.
"""

import os
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from operate import doing
from operate.wording import escaped

PATIENCE_S = 1.0
"""How long a person waits before asking what goes on (estimate)."""
CLEARED = "\r\x1b[K"
"""Return to the start of the line and erase it (ECMA-48, EL)."""


class Progress:
    """The line, drawn by a thread of its own. `words`: of a verb that does not say what it does."""

    def __init__(self, terminal: TextIO, words: str) -> None:
        self._terminal, self._words = terminal, words
        self._lock, self._ended = threading.RLock(), threading.Event()
        self._since, self._shown, self._spoken = time.monotonic(), "", False

    def run(self) -> None:
        """Draw until the verb has ended."""
        while not self._ended.wait(PATIENCE_S / 4):
            with self._lock:
                self._draw()

    def clear(self) -> None:
        """Somebody writes: the line goes away."""
        with self._lock:
            self._clear()
            self._since, self._spoken = time.monotonic(), True

    def end(self) -> None:
        """Draw nothing more."""
        self._ended.set()
        with self._lock:
            self._clear()

    def _draw(self) -> None:
        waited = time.monotonic() - self._since
        words = doing.now() or ("" if self._spoken else self._words)
        if self._ended.is_set() or not words or waited < PATIENCE_S:
            return
        line = f"{escaped(words)} … {waited:.0f} s"[: shutil.get_terminal_size().columns - 1]
        if line != self._shown:
            self._write(f"{CLEARED}{line}")
            self._shown = line

    def _clear(self) -> None:
        if self._shown:
            self._write(CLEARED)
            self._shown = ""

    def _write(self, text: str) -> None:
        try:
            self._terminal.write(text)
            self._terminal.flush()
        except (OSError, ValueError):  # the terminal was closed
            self._ended.set()


class Noticed:
    """A text stream before whose writing the line goes away."""

    def __init__(self, beneath: TextIO, progress: Progress) -> None:
        self._beneath, self._progress = beneath, progress

    def write(self, text: str) -> int:
        """Write it."""
        self._progress.clear()
        return self._beneath.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._beneath, name)


@contextmanager
def shown(out: TextIO, err: TextIO, words: str, *, wanted: bool) -> Iterator[tuple[Any, Any]]:
    """Both streams for a verb that may take long. Where nobody looks they are as they were."""
    if not wanted or not err.isatty() or os.environ.get("TERM") == "dumb":
        yield out, err
        return
    progress = Progress(err, words)
    threading.Thread(target=progress.run, daemon=True).start()
    try:
        yield Noticed(out, progress), Noticed(err, progress)
    finally:
        progress.end()

"""Single keys of a terminal, without Enter; a pipe has none."""

import select
import sys
import termios
import time
import tty
from typing import Any


class Keyboard:
    """Keys come one by one as long as this lasts; afterwards the terminal is as it was."""

    def __init__(self) -> None:
        self._before: list[Any] | None = None

    def __enter__(self) -> "Keyboard":
        if sys.stdin.isatty():
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def pressed(self, within_s: float) -> str:
        """The next key, "" where none is pressed in time."""
        if self._before is None:
            time.sleep(within_s)
            return ""
        ready, _, _ = select.select([sys.stdin], [], [], within_s)
        return sys.stdin.read(1) if ready else ""

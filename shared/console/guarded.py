"""Output of verbs: names and messages are written by others, and what a terminal would obey in them
is escaped; what goes wrong is told in words.
"""

import codecs
import functools
import struct
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from typing import Any, TextIO, cast

from operate.wording import escaped

FOR_PROGRAMS = ("json", "otlp")
"""Formats of answers beside which a problem is told as JSON, too."""
UNSHOWN = "roco.unshown"
"""Name of the error handler of an output that lacks a letter: it is escaped as in JSON, \\u2713 in
place of a tick.
"""


def _escaped(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    units = error.object[error.start : error.end].encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{unit:04x}" for (unit,) in struct.iter_unpack(">H", units)), error.end


codecs.register_error(UNSHOWN, _escaped)


class Guarded:
    """A text stream that escapes what a terminal would obey. `beneath`: the stream itself, for
    whoever has escaped what others wrote and adds colours (console.terminal.console). It has no
    `buffer`, which would be a way around.
    """

    def __init__(self, beneath: TextIO) -> None:
        self.beneath = beneath

    def write(self, text: str) -> int:
        """Write it, escaped."""
        return self.beneath.write(escaped(text))

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":
            raise AttributeError(name)
        return getattr(self.beneath, name)


def guarded(verb: Callable[..., Any]) -> Callable[..., Any]:
    """A verb whose output is escaped, however it prints, and whose problems are told in words."""

    @functools.wraps(verb)
    def call(*given: Any, **named: Any) -> Any:
        out, err = (cast(TextIO, Guarded(stream)) for stream in (sys.stdout, sys.stderr))
        from console.output import (  # a verb has imported it; a list of verbs need not
            Format,
            problems,
        )

        form = Format.JSON if named.get("form") in FOR_PROGRAMS else Format.TEXT
        with redirect_stdout(out), redirect_stderr(err), problems(form):
            return verb(*given, **named)

    return call

"""Output of verbs: names and messages are written by others, and what a terminal would obey in them
is escaped.
"""

import codecs
import struct
from typing import Any, TextIO

from operate.wording import escaped

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

"""Rich's console for what a verb prints: colours are ours, and text that others wrote stays text
(operate.wording).
"""

import sys
from collections.abc import Iterator
from typing import Any

from rich import console
from rich.segment import Segment
from rich.text import Text

from console.guarded import Guarded
from operate.wording import OBEYED, escaped


class Console(console.Console):  # noqa: TID251  (this is what all others take)
    """A console that escapes control characters where the text is laid out, before it adds its own.

    Square brackets are no markup: in somebody's name they could be a link.
    """

    def __init__(self, **settings: Any) -> None:
        stream = sys.stderr if settings.get("stderr") else sys.stdout
        beneath = {"file": stream.beneath} if isinstance(stream, Guarded) else {}
        super().__init__(**{"markup": False, "emoji": False} | beneath | settings)

    def render_str(self, text: str, **settings: Any) -> Text:
        """As rich does, escaped before it is broken into lines."""
        return super().render_str(escaped(text), **settings)

    def render(
        self, renderable: console.RenderableType, options: console.ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """As rich does; what was not escaped before, as the cells of tables, is here."""
        whole = shown(renderable) if isinstance(renderable, Text) else renderable
        for part in super().render(whole, options):
            yield part if part.control else Segment(escaped(part.text), part.style)


def shown(text: Text) -> Text:
    """Return a text escaped, with the styles of all else in it."""
    cuts = [at for found in OBEYED.finditer(text.plain) for at in found.span()]
    whole = text.blank_copy()
    for part in text.divide(cuts):
        whole.append_text(Text(escaped(part.plain)) if OBEYED.search(part.plain) else part)
    return whole if cuts else text

"""Rich's console for what a verb prints, and its tables: colours are ours, and text that others
wrote stays text (operate.wording).
"""

import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from rich import console
from rich.segment import Segment
from rich.table import Table
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


# --- Tables: columns two blanks apart, without lines ----------------------------------------------


Cell = str | Text


def table(
    heads: Sequence[str],
    rows: Iterable[Iterable[Cell]] = (),
    *,
    right: Collection[str] = (),
    fold: Collection[str] = (),
    cut: Collection[str] = (),
    least: Mapping[str, int] | None = None,
    header_style: str = "dim",
    **settings: Any,
) -> Table:
    """A row of heads, which is left out where all are empty, and a row for each of `rows`.

    By the head of their column cells are set to the `right`, are broken into several lines where
    they are too long (`fold`), or take what room is left and are `cut` there. All others stay in
    one line. `least`: columns that a column has at least, so that a picture that is renewed stands
    still. `settings`: of rich's Table.
    """
    usual = {"box": None, "padding": (0, 2, 0, 0), "show_header": any(heads)}
    drawn = Table(header_style=header_style, **usual | settings)
    for head in heads:
        drawn.add_column(
            head,
            justify="right" if head in right else "left",
            no_wrap=head not in fold,
            overflow="fold" if head in fold else "ellipsis",
            ratio=1 if head in cut else None,
            min_width=(least or {}).get(head),
        )
    for row in rows:
        drawn.add_row(*row)
    return drawn


def pairs(rows: Iterable[tuple[Cell, Cell]], name_style: str = "dim") -> Table:
    """Names in a style, each with its value, which is broken into several lines where it is too
    long.
    """
    drawn = Table.grid(padding=(0, 2))
    drawn.add_column(style=name_style)
    drawn.add_column(overflow="fold")
    for row in rows:
        drawn.add_row(*row)
    return drawn

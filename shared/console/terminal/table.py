"""Tables that verbs print: columns two blanks apart, without lines."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from rich.table import Table
from rich.text import Text

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

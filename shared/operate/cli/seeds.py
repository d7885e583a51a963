"""The option --seed: a number that varies what a system leaves to chance, or none."""

from typing import Annotated

import typer

NONE = "none"
AS_WRITTEN = 0
"""The seed that varies nothing."""


def number(text: str) -> int:
    """Return the seed of an option; 0 for "none". Raise typer.BadParameter that says what would be right."""
    if str(text) == NONE:
        return AS_WRITTEN
    if not str(text).isdecimal():
        raise typer.BadParameter(f"{text!r} is not a seed: give a number from 0 on, or {NONE}, which is 0")
    return int(text)


Seed = Annotated[
    int,
    typer.Option(
        parser=number,
        metavar="N|none",
        help="Varies what a system leaves to chance, such as poses and noise; none, or 0: as the scene is written.",
    ),
]
FirstSeed = Annotated[
    int, typer.Option(parser=number, metavar="N|none", help="Of the first run; each next one takes the next.")
]

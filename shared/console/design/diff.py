"""`roco design diff A B`: what changed between two designs, entry by entry, with what follows from
it.

Exit codes: 0 the designs are the same, 1 they differ, 2 a file cannot be read.
"""

import textwrap
from pathlib import Path
from typing import Annotated

import typer

from console.design import files
from console.output import Form, Format, argument
from topdown.check.difference import Change, Way, diff
from topdown.model.design import load

MARKS = {Way.ADDED: "+", Way.REMOVED: "-", Way.CHANGED: "~"}


def diff_(
    old: Annotated[Path, argument("A design file.")],
    new: Annotated[Path, argument("The design file it became.")],
    form: Form = Format.TEXT,
) -> None:
    """Tell what changed between two designs, whatever the order of their entries. Exits with 1
    where they differ.

    Examples:
      roco design diff old.toml new.toml
    """
    with files.problems(form):
        found = diff(load(old), load(new))
    files.tell(found, form, written(found, files.width()))
    if found:
        raise typer.Exit(1)


def written(found: tuple[Change, ...], width: int) -> str:
    """The changes as people read them: what was written, then what follows."""
    if not found:
        return "the designs are the same"
    lines: list[str] = []
    for derived, title in ((False, "written"), (True, "what follows")):
        some = [change for change in found if change.derived is derived]
        if some:
            lines += [title, *_grouped(some, width), ""]
    return "\n".join(lines).rstrip()


def _grouped(changes: list[Change], width: int) -> list[str]:
    """Changes of one entry stand below its name."""
    lines: list[str] = []
    last = ""
    for one in changes:
        entry = f"  {MARKS[one.way]} {one.kind} {one.name}"
        if one.way is not Way.CHANGED:
            lines += _wrapped(entry, one.old or one.new, width)
        else:
            lines += [entry] * (entry != last)
            change = f"{one.old or 'nothing'} -> {one.new or 'nothing'}"
            lines += _wrapped(f"      {one.field}", change, width)
        last = entry
    return lines


def _wrapped(head: str, words: str, width: int) -> list[str]:
    whole = f"{head}: {words}" if words else head
    indent = len(head) - len(head.lstrip()) + 4
    return textwrap.wrap(whole, width, subsequent_indent=" " * indent, drop_whitespace=True)

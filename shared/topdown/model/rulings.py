"""The rulings of a design: where its source is silent or contradicts itself, what the design does
instead.
"""

from collections.abc import Iterator

import msgspec

from topdown.model.design import Design
from topdown.model.loading import Path_, line_of

_NAMES = ("name", "id", "kind")


class Ruling(msgspec.Struct, frozen=True):
    """A ruling, the entry it stands on, its line; None: not known."""

    where: str
    text: str
    line: int | None


def rulings(design: Design) -> tuple[Ruling, ...]:
    """Every ruling, in the file's order."""
    found = [
        Ruling(where, text, line_of(design.text, at))
        for where, text, at in _walk(design.file, "", ())
    ]
    return tuple(sorted(found, key=lambda one: one.line or 0))


def _walk(entry: object, where: str, at: Path_) -> Iterator[tuple[str, str, Path_]]:
    if isinstance(entry, tuple):
        for index, one in enumerate(entry):
            yield from _walk(one, f"{where} {_name(one, index)}", (*at, index))
    elif isinstance(entry, msgspec.Struct):
        if text := getattr(entry, "ruling", ""):
            yield where.strip(), text, (*at, "ruling")
        for field in msgspec.structs.fields(entry):
            inside = f"{where}, {field.encode_name}" if where else field.encode_name
            yield from _walk(getattr(entry, field.name), inside, (*at, field.encode_name))


def _name(entry: object, index: int) -> str:
    """The name of a list's entry; of a message, sender and act; else its number."""
    names = [str(getattr(entry, field)) for field in _NAMES if hasattr(entry, field)]
    if hasattr(entry, "performative") and hasattr(entry, "sender"):
        names = [f"{entry.sender} {entry.performative}"]
    return names[0] if names else str(index + 1)

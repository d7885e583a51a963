"""What several rooms do with structs, and the error of a reader that finds nothing."""

from typing import Any, TypeVar

import msgspec

S = TypeVar("S", bound=msgspec.Struct)


def alike(kind: type[S], one: object, /, **more: Any) -> S:
    """A Struct of this kind with the fields that it shares with another object, and `more`."""
    names = (name for name in kind.__struct_fields__ if name not in more and hasattr(one, name))
    return kind(**{name: getattr(one, name) for name in names}, **more)


class NothingToRead(Exception):
    """There is nothing to work on where it was looked for; the message says what would be right."""

"""Errors of topdown.

TopdownError
 +- DesignError      a design file that cannot be read: where, what is wrong, what would be right
 +- NoSuchEntry      the design has no such agent, channel, protocol or state; it lists those it has
"""

from collections.abc import Iterable


class TopdownError(Exception):
    """Base of all errors of topdown."""


class DesignError(TopdownError):
    """A design file is wrong at `file`, `line` (None: not known), `field`; `wrong` and `right` say how."""

    def __init__(self, file: str, line: int | None, field: str, wrong: str, right: str) -> None:
        self.file = file
        self.line = line
        self.field = field
        self.wrong = wrong
        self.right = right
        place = f"{file}:{line}" if line is not None else file
        super().__init__(f"{place}: {field}: {wrong}; {right}")


class NoSuchEntry(TopdownError, LookupError):
    """The design has no `kind` named `name`; `known` lists the defined ones."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind = kind
        self.name = name
        self.known = tuple(known)
        super().__init__(f"no {kind} {name!r}; the design has {', '.join(self.known) or 'none'}")

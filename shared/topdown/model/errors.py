"""Errors of topdown.

TopdownError
 +- DesignError      a design file that cannot be read: where, what is wrong, what would be right
 +- ParameterError   a value that a parameter cannot have, or a parameter that is not there
 +- NoSuchEntry      the design has no such agent, channel, protocol or state; it lists those it has
"""

from collections.abc import Iterable


class TopdownError(Exception):
    """Base of all errors of topdown."""


class DesignError(TopdownError):
    """A design file is wrong at `file`, `line` (None: not known), `field`; `wrong` and `right` say
    how. `at`: the entry's path in the file, where it is known.
    """

    def __init__(
        self,
        file: str,
        line: int | None,
        field: str,
        wrong: str,
        right: str,
        at: tuple[str | int, ...] = (),
    ) -> None:
        self.at = at
        self.file = file
        self.line = line
        self.field = field
        self.wrong = wrong
        self.right = right
        place = f"{file}:{line}" if line is not None else file
        super().__init__(f"{place}: {field}: {wrong}; {right}")


class ParameterError(TopdownError, ValueError):
    """`parameter` of `agent` cannot be `value`; `right` says what it can be."""

    def __init__(self, agent: str, parameter: str, value: object, right: str) -> None:
        self.agent, self.parameter, self.value, self.right = agent, parameter, value, right
        super().__init__(f"{parameter} of {agent} cannot be {value!r}; it is {right}")


class NoSuchParameter(ParameterError):
    """`agent` has no `parameter`; `right` lists those it has."""

    def __init__(self, agent: str, parameter: str, known: Iterable[str]) -> None:
        super().__init__(agent, parameter, None, ", ".join(known) or "none")
        self.args = (f"agent {agent} has no parameter {parameter!r}; its parameters: {self.right}",)


class NoSuchEntry(TopdownError, LookupError):
    """The design has no `kind` named `name`; `known` lists the defined ones."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind = kind
        self.name = name
        self.known = tuple(known)
        super().__init__(f"no {kind} {name!r}; the design has {', '.join(self.known) or 'none'}")

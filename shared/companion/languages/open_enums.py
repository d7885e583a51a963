"""Enumerations to which the tasks add: the general members here, those of one task in its part
`done`.
"""

from enum import StrEnum
from functools import cache
from typing import TypeVar

from companion.tasks import parts

E = TypeVar("E", bound=StrEnum)


@cache
def members(base: type[E]) -> dict[str, E]:
    """The members of all enumerations made from `base`, by value. Raises ValueError if two have the
    same one.
    """
    parts("done")
    found: dict[str, E] = {}
    for one in (one for table in base.__subclasses__() for one in table.__members__.values()):
        if one.value in found:
            both = f"{type(found[one.value]).__name__} and {type(one).__name__}"
            raise ValueError(f"both {both} have {one.value!r}")
        found[one.value] = one
    return found


def member(base: type[E], value: str) -> E:
    """The member with this value. Raises ValueError if there is none."""
    found: E | None = members(base).get(value)
    if found is None:
        raise ValueError(f"unknown {base.__name__} {value!r}")
    return found

"""The form of a check of `roco doctor`."""

from enum import StrEnum

import msgspec


class Level(StrEnum):
    """fine; note: worth knowing, nothing fails by it; wrong: something does not work, or soon will not."""

    FINE = "fine"
    NOTE = "note"
    WRONG = "wrong"


class Check(msgspec.Struct, frozen=True):
    """What was looked at, what is, and what to do."""

    name: str
    level: Level
    what: str
    remedy: str = ""

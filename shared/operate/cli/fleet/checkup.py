"""The form of a check of `roco doctor`."""

from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from operate.cli.fleet.process_status import Look
    from operate.cli.fleet.targets import Target


class Level(StrEnum):
    """fine; note: worth knowing, nothing fails by it; wrong: something does not work, or soon will not."""

    FINE = "fine"
    NOTE = "note"
    WRONG = "wrong"


class Check(msgspec.Struct, frozen=True):
    """One check: its subject, the finding, and the remedy."""

    name: str
    level: Level
    what: str
    remedy: str = ""


class Checks(msgspec.Struct, frozen=True):
    """Checks a system adds, or puts in place of those of the same name: of the machine, and of its fleet."""

    machine: dict[str, Callable[[], Iterator[Check]]] = {}
    fleet: dict[str, Callable[["Target", "Look"], Iterator[Check]]] = {}

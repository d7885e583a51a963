"""Asking to look around."""

from typing import ClassVar

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import Command


class LookAround(Command, frozen=True):
    """Look around and say what is there."""

    surveys: ClassVar[bool] = True

    @property
    def task(self) -> hfsm.Task:
        return hfsm.Task("look_around", ())

    @property
    def says(self) -> str:
        return "look"


ROW = Row(LookAround, {"look": lambda things, side: LookAround()}, phrases(__name__))

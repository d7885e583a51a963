"""Asking to take a thing."""

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import Command


class Take(Command, frozen=True):
    """Take an object out and hold it; the side is the robot's choice where none is named."""

    object: str
    side: str = ""

    @property
    def task(self) -> hfsm.Task:
        return hfsm.Task("take", (self.object, self.side))

    @property
    def says(self) -> str:
        return "take_side" if self.side else "take"


ROW = Row(Take, {"take": lambda things, side: Take(things[0], side)}, phrases(__name__))

"""Asking to bring a thing."""

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import Command


class Bring(Command, frozen=True):
    """Take an object and hold it over a free place of a table, until it is to be put down there."""

    object: str
    side: str = ""

    @property
    def task(self) -> hfsm.Task:
        return hfsm.Task("bring", (self.object, self.side))

    @property
    def says(self) -> str:
        return "bring_side" if self.side else "bring"


ROW = Row(Bring, {"bring": lambda things, side: Bring(things[0], side)}, phrases(__name__))

"""Asking to be given a thing."""

from typing import ClassVar

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import Command


class HandOver(Command, frozen=True):
    """Hold an object out to the person, who takes it out of the hand."""

    gives: ClassVar[bool] = True

    object: str

    @property
    def task(self) -> hfsm.Task:
        return hfsm.Task("hand_over", (self.object,))

    @property
    def says(self) -> str:
        return "hand_over"


ROW = Row(HandOver, {"hand_over": lambda things, side: HandOver(things[0])}, phrases(__name__))

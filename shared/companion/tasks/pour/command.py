"""Asking to pour the content of one thing into another."""

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import Command


class PourInto(Command, frozen=True):
    """Pour the content of one object into another."""

    final = True

    source: str
    destination: str

    @property
    def task(self) -> hfsm.Task:
        return hfsm.Task("pour", (self.source, self.destination))

    @property
    def says(self) -> str:
        return "pour"


ROW = Row(
    PourInto,
    {
        "pour": lambda things, side: PourInto(*things),
        "fill": lambda things, side: PourInto(*reversed(things)),
    },
    phrases(__name__),
)

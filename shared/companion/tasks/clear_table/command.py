"""Asking to clear the table."""

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import Command


class ClearTable(Command, frozen=True):
    """Put into the cabinet what stands on a table, as far as there is room for it."""

    @property
    def task(self) -> hfsm.Task:
        return hfsm.Task("clear_table", ())

    @property
    def says(self) -> str:
        return "clear"


ROW = Row(ClearTable, {"clear": lambda things, side: ClearTable()}, phrases(__name__))

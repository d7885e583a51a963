"""Asking to take a held thing with the other hand."""

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import Command


class SwapHands(Command, frozen=True):
    """Take a held object with the other hand; without a name the only one that is held."""

    object: str = ""

    @property
    def task(self) -> hfsm.Task:
        return hfsm.Task("swap_hands", (self.object,))

    @property
    def says(self) -> str:
        return "swap_thing" if self.object else "swap"

    def settled(self, plan: hfsm.HierarchicalPlan) -> hfsm.Task | None:
        """Hands can be swapped only while one of them is full: at its end the plan has the thing in
        the hand meant.
        """
        match tuple(plan.holds.items()):
            case ((side, thing),):
                return hfsm.Task("bring", (thing, side))
        return None


ROW = Row(SwapHands, {"swap": lambda things, side: SwapHands(*things)}, phrases(__name__))

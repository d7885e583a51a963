"""Asking to put a thing down, somewhere, or back."""

from companion.commands import Row, phrases
from companion.languages import hfsm
from companion.languages.cmd import BACK, Command
from companion.languages.rc import Release


class PutDown(Command, frozen=True):
    """Put a held object down wherever there is room. With a place ("table", "cabinet", BACK) put it
    there; it is taken first if no hand holds it.
    """

    object: str
    place: str = ""

    @property
    def task(self) -> hfsm.Task:
        if not self.place:
            return hfsm.Task("put_down", (self.object,))
        return hfsm.Task("put_at", (self.object, self.place))

    @property
    def says(self) -> str:
        return {"": "put", BACK: "back"}.get(self.place, "place")

    def settled(self, plan: hfsm.HierarchicalPlan) -> hfsm.Task | None:
        """A hand held it when this plan was made: a later plan may find that it stands where that
        hand left it.
        """
        put = [act.object for act in hfsm.acts(plan.root) if isinstance(act, Release)]
        return hfsm.Task("stand", (put[-1],)) if put and not self.place else None


ROW = Row(
    PutDown,
    {
        "put": lambda things, side: PutDown(*things),
        "place": lambda things, side: PutDown(*things),
        "back": lambda things, side: PutDown(things[0], BACK),
    },
    phrases(__name__),
)

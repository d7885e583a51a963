"""Compares what a running agent does in a step with the rows of its design: what was proven of the
rows holds for it.

A step that fits no row is named, with the rows there are. Words that are said for information only
(`may`) and words that change nothing anywhere are not compared. Must not know: how agents run.
"""

from collections.abc import Iterable
from typing import Protocol

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from topdown.model.machines import SETTLED, UNSETTLED, Cause, Event, Machine, ProtocolAct, Row


class Done(Protocol):
    """A step, as agent_runtime.core.events.Deed tells it."""

    @property
    def before(self) -> str: ...
    @property
    def event(self) -> str: ...
    @property
    def took(self) -> tuple[str, Performative, Kind] | None: ...
    @property
    def said(self) -> tuple[tuple[str, Performative, Kind], ...]: ...
    @property
    def after(self) -> str: ...
    @property
    def owed(self) -> tuple[str, ...]: ...


# Classes of events other than messages -> causes of the rows they may be. A wake may be a patience
# that is over.
_CAUSES: dict[str, tuple[Cause, ...]] = {
    "Started": (Cause.RESTART,),
    "Late": (Cause.LATE,),
    "PeerChanged": (Cause.BACK, Cause.OWN),
    "Woken": (Cause.OWN, Cause.LATE),
    "Local": (Cause.OWN, Cause.PERSON),
    "Ordered": (Cause.OWN, Cause.PERSON),
    "Settled": (Cause.OWN,),
}
NOT_UNDERSTOOD = ("Broken",)
"""A conversation that ended by not-understood: outside the proof (topdown.prove.verify)."""


class Steps(Machine):
    """The rows of an agent, asked about the steps it really made."""

    def why_not(self, deed: Done) -> str:
        """Return why a step is not one of the design's, "" if it is."""
        if deed.event.partition(" ")[0] in NOT_UNDERSTOOD or deed.before not in self.waits:
            return ""
        if deed.took is not None and deed.took[1] is Performative.NOT_UNDERSTOOD:
            return ""
        rows = tuple(self._rows(deed))
        if (
            deed.took is None
            and deed.after == deed.before
            and not deed.said
            and not self._is_due(rows, deed)
        ):
            return ""
        if self.fitting(deed):
            return ""
        said = ", ".join(str(ProtocolAct(*one)) for one in deed.said) or "nothing"
        what = str(ProtocolAct(*deed.took)) if deed.took else deed.event
        known = "; ".join(map(str, rows)) or "none"
        return f"in {deed.before} on {what} said {said}, then {deed.after}; rows for it: {known}"

    def fitting(self, deed: Done) -> tuple[Row, ...]:
        """The rows that a step may have followed."""
        return tuple(row for row in self._rows(deed) if self._fits(row, deed))

    def _rows(self, deed: Done) -> Iterable[Row]:
        if deed.took is not None:
            return self.by_event.get((deed.before, Event(Cause.TAKE, *deed.took)), ())
        word, _, about = deed.event.partition(" ")
        causes = _CAUSES.get(word, ())
        rows = [row for row in self.spontaneous[deed.before] if row.event.cause in causes]
        # Late and back name a use or a peer; a wake or a word of the own side names none.
        named = (Cause.LATE, Cause.BACK)
        return [
            row
            for row in rows
            if row.event.cause not in named or not about or row.event.name == about
        ]

    def _is_due(self, rows: Iterable[Row], deed: Done) -> bool:
        """Whether doing nothing is less than the rows promise: after a death, or a wait that is
        over, a row applies whatever the conversations are. Other such events may have been for
        nothing.
        """
        word = deed.event.partition(" ")[0]
        return word in ("Started", "Late") and any(
            not row.when
            and not row.several
            and not any(
                self.uses[said.use].durable or said.act not in self.uses[said.use].protocol.openings
                for said in row.say
            )
            for row in rows
        )

    def _fits(self, row: Row, deed: Done) -> bool:
        return (
            deed.after == (row.to or deed.before)
            and all(self.uses[use].peer in deed.owed for use in row.owes)
            and all(self._holds(guard.use, guard.words, deed) for guard in row.when)
            and _says(row, [ProtocolAct(*one) for one in deed.said])
        )

    def _holds(self, use: str, words: frozenset[str], deed: Done) -> bool:
        """Only what is due can be seen of a step from outside; a guard that names other words may
        hold by them.
        """
        due = UNSETTLED if self.uses[use].peer in deed.owed else SETTLED
        return due in words or not words <= {SETTLED, UNSETTLED}


def _says(row: Row, said: list[ProtocolAct]) -> bool:
    """All that the row says, in its order, and nothing besides but what it may say."""
    wanted = list(row.say)
    for one in said:
        if wanted and one == wanted[0]:
            wanted.pop(0)
        elif one not in row.may:
            return False
    return not wanted

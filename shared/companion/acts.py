"""All acts of the robot: the general ones and those of the tasks (companion.tasks, part `done`),
with their rows.

The union `AnyAct` and the contents of RC are made from them.
"""

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING

from companion.languages import rc
from companion.languages.evidence import AnyClaim, Check, Claim, Otherwise, Sense
from companion.languages.facts import Facts, Kind, fact
from companion.rows import THERE, ActRow, ShownRow, held
from companion.tasks import parts


def _seen(look: rc.Look, done: rc.Done) -> Facts:
    things = sorted(one.object for one in done.seen)
    return (fact(Kind.SEEN, *things) if things else fact(Kind.SEEN_NOTHING),)


_STANDS = Check(Claim.STANDS, "object", (Sense.EYES,), Otherwise.LOOK)
_LOOKED = Check(Claim.LOOKED, "", (Sense.EYES,), Otherwise.SAID)
_PUT = Check(Claim.STANDS, "put", (Sense.EYES,), Otherwise.SAID)
GENERAL = (
    ActRow(rc.MoveJoint, (THERE, held(""))),
    ActRow(rc.MoveCartesian, (THERE, held("")), rest_s=5.0),
    ActRow(rc.Grasp, (THERE, held("object", Otherwise.FAILED)), rest_s=12.0, handles=True),
    ActRow(rc.Release, (THERE, _STANDS), rest_s=20.0, handles=True),
    ActRow(rc.Look, (THERE, _LOOKED, _PUT), rest_s=15.0, outcome_facts=_seen),
    ActRow(rc.Home, (THERE,)),
)
ACTS: dict[type[rc.Command], ActRow] = {
    row.act: row
    for row in (*GENERAL, *(row for part in parts("done") for row in getattr(part, "ACTS", ())))
}

GENERAL_SHOWN = (
    ShownRow(rc.MoveJoint, "move", "#94a3b8", "moves an arm"),
    ShownRow(rc.MoveCartesian, "pull", "#64748b", "pulls straight"),
    ShownRow(rc.Home, "home", "#94a3b8", "moves an arm home"),
    ShownRow(rc.Grasp, "grasp", "#d97706", "grasps", points_on="object"),
    ShownRow(rc.Release, "put down", "#15803d", "puts down"),
    ShownRow(rc.Look, "look", "#6d28d9", "looks"),
)
SHOWN: dict[type[rc.Command], ShownRow] = {
    row.act: row
    for row in (
        *GENERAL_SHOWN,
        *(row for part in parts("done") for row in getattr(part, "SHOWN", ())),
    )
}
"""How the tools show each act."""

if TYPE_CHECKING:
    AnyAct = rc.Command
    Content = rc.Command | rc.Accepted | rc.Done | rc.NotDone
else:
    AnyAct = reduce(or_, ACTS)
    Content = AnyAct | rc.Accepted | rc.Done | rc.NotDone


def needed(act: type[rc.Command]) -> frozenset[AnyClaim]:
    """The claims about things without which an act fails: a sense must have told of each."""
    kept = (one for one in ACTS[act].checks if one.claim.kept)
    return frozenset(one.claim for one in kept if one.otherwise is Otherwise.FAILED)

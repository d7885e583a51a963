"""How the tools show each act (the general ones, and those of the tasks: companion.tasks, part
`shown`), and a step.
"""

from companion.languages import rc
from companion.languages.hfsm import Place
from companion.languages.hfsm import Step as PlanStep
from companion.languages.values import Side
from companion.rows import ShownRow
from companion.sentences import at
from companion.tasks import parts
from operate.live_lines import Step

GENERAL = (
    ShownRow(rc.MoveJoint, "move", "#94a3b8", "moves an arm"),
    ShownRow(rc.MoveCartesian, "pull", "#64748b", "pulls straight"),
    ShownRow(rc.Home, "home", "#94a3b8", "moves an arm home"),
    ShownRow(rc.Grasp, "grasp", "#d97706", "grasps", points_on="object"),
    ShownRow(rc.Release, "put down", "#15803d", "puts down"),
    ShownRow(rc.Look, "look", "#6d28d9", "looks"),
)
SHOWN: dict[type[rc.Command], ShownRow] = {
    row.act: row
    for row in (*GENERAL, *(row for part in parts("shown") for row in getattr(part, "ACTS", ())))
}


def step(one: Step) -> str:
    """What a state of a plan does, as live.jsonl has it."""
    side = Side(one.side) if one.side in list(Side) else None
    return at(Place(one.path, PlanStep(one.does, one.things, side) if one.does else None, one.act))

"""Methods and steps that belong to no task: what others do first, in between, or in the end."""

from companion.languages.facts import Kind, fact
from companion.planning.homing import home
from companion.planning.looking import confirm, look
from companion.planning.methods import Known, Subtasks, away
from companion.planning.registry import Plan


def localize(known: Known, km: str, name: str) -> Subtasks | None:
    """Look at it; the rest needs a new plan."""
    return [("a_look", name), ("a_replan", name)]


def after_arms_home(known: Known, km: str, task: str, *arguments: str) -> Subtasks | None:
    """Bring empty arms home, then do the task: after an interrupted act one may be in the way, in a cabinet say."""
    sides = away(known, km)
    if not sides:
        return known.unfit(fact(Kind.ARMS_HOME))
    return [*(("a_home", side) for side in sides), (task, *arguments)]


COMMON = Plan(
    methods={"localize": (localize,)},
    around={"after_arms_home": after_arms_home},
    actions={"a_home": home, "a_look": look, "a_confirm": confirm},
)

"""What the hands hold when a plan begins, as the commands that put it down again: for a plan cancelled on its way."""

from companion.languages import rc, wm
from companion.languages.values import Side
from services.planner.search.asking import Asking, Unanswered
from services.planner.search.situation import SIDES
from services.planner.search.steps import approach_points
from velma.kinematics.frames import transform
from velma.kinematics.tasks.placing import backwards


def held_at(asking: Asking, state: str) -> dict[Side, rc.Release]:
    """A release per hand that holds something in `state`; where it is put is left to ex."""
    found = {}
    for side in SIDES:
        try:
            held = asking(wm.GraspAtSide(state=state, side=side), wm.GraspOf)
            if held.object:
                found[side] = _release(asking, state, side, held)
        except Unanswered:
            continue  # a hand of which nothing is known: nothing can be said of putting down
    return found


def _release(asking: Asking, state: str, side: Side, held: wm.GraspOf) -> rc.Release:
    query = wm.GraspDefinition(state=state, object=held.object, grasp=held.grasp)
    steps = asking(query, wm.Grasps).grasps[0].steps
    retreat = approach_points(backwards([(transform(s.pose).inverse(), s.fingers) for s in steps]))
    return rc.Release("", side, held.object, "", None, retreat)

"""Planning to bring a thing: it is taken by a grasp from which it can be held out, over a place on
a table.
"""

from companion.languages import hfsm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning.methods import Known, Subtasks
from companion.planning.placing import Surfaces, above, retreating
from companion.planning.registry import Argument, Plan, each_hand, each_try
from companion.planning.steps import Geometry, Step, moved
from velma.kinematics.tasks import LOADED_SPEED


def bring_with(known: Known, state: str, hand: Side, name: str, side: str) -> Subtasks | None:
    """Take it with this hand, if it is wanted and no other one holds it, and hold it over a place
    on a table.
    """
    if side not in ("", hand):
        return known.unfit(fact(Kind.OTHER_HAND_WANTED, side))
    holder = known.facts.holder(state, name)
    if holder is None:
        other = known.facts.in_hand(state, hand)
        return known.unfit(fact(Kind.HOLDS, hand, other)) if other else [("hold_out", name, hand)]
    if holder is hand:
        return [("a_offer", hand)]
    return [("take", name, hand)] if side else known.unfit(fact(Kind.HOLDS, holder, name))


def hold_out_at_try(
    known: Known, state: str, number: str, name: str, hand: Side
) -> Subtasks | None:
    """Take it by some grasp, from which it can be held over a place: not every one leaves a way
    there.
    """
    return [("a_take", name, hand, number), ("a_offer", hand)]


def offer(geometry: Geometry, state: str, side: Side) -> Step | None:
    """The step that holds the object over a place where it can be put down."""
    here = geometry.at(state)
    held = here.held[side]
    found = above(
        geometry, here, side, retreating(geometry, state, held.object, held.grasp), Surfaces()
    )
    if found is None:
        return None
    return moved(hfsm.Step("offer", (held.object,)), side, found[1], LOADED_SPEED)


PLAN = Plan(
    tasks={"bring": (Argument.THING, Argument.SIDE)},
    methods={
        "bring": ("after_opening", each_hand(bring_with), "after_clearing"),
        "hold_out": (each_try(hold_out_at_try),),
    },
    actions={"a_offer": offer},
)

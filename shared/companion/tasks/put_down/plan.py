"""Planning to put a thing down: on any free place, at a place that is named, or back where it
stood.

On top of furniture it comes down from above. Into furniture that opens to the side it goes through
the opening, which not every grasp allows: so the grasp is chosen with the place.
"""

from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning.grasping import preferred, reachable, take, ways
from companion.planning.methods import Known, Subtasks, away
from companion.planning.placing import BEST, Inside, Surfaces, inserted, place, places
from companion.planning.registry import Argument, Plan, each_hand, each_try
from companion.planning.steps import Geometry, Step

# --- anywhere -------------------------------------------------------------------------------------


def put_down(known: Known, state: str, name: str) -> Subtasks | None:
    """Put it down and look at it; where it stands already, as after a way that was blocked, bring
    the hand home.
    """
    if known.facts.holder(state, name):
        return [("set_down", name), ("a_confirm", name)]
    if (
        known.facts.support(state, name)
        and away(known, state)
        and not known.facts.fallen(state, name)
    ):
        return _home_and_look(known, state, name)
    known.failed(fact(Kind.NO_HAND_HOLDS, name))
    return None


def put_down_lying_with(known: Known, state: str, hand: Side, name: str) -> Subtasks | None:
    """Take a thing with this hand that fell over, and put it down upright."""
    if known.facts.holder(state, name) or not known.facts.fallen(state, name):
        return known.unfit(fact(Kind.DID_NOT_FALL, name))
    if held := known.facts.in_hand(state, hand):
        return known.unfit(fact(Kind.HOLDS, hand, held))
    return [("a_take", name, hand), ("set_down", name), ("a_confirm", name)]


def stands(known: Known, state: str, name: str) -> Subtasks | None:
    """Only look at it where a hand left it, though the act of that hand had failed."""
    if holder := known.facts.holder(state, name):
        return known.unfit(fact(Kind.HOLDS, holder, name))
    if not known.facts.support(state, name):
        return known.unfit(fact(Kind.NO_HAND_HOLDS, name))
    how = known.facts.fallen(state, name)
    return known.unfit(how) if how else _home_and_look(known, state, name)


def set_down(known: Known, state: str, name: str) -> Subtasks | None:
    """Put it down, and bring the hand home; whoever needs it there looks at it."""
    side = known.facts.holder(state, name)
    if not side:
        return known.unfit(fact(Kind.NO_HAND_HOLDS, name))
    return [("a_place", side), ("a_home", side)]


def _home_and_look(known: Known, state: str, name: str) -> Subtasks:
    return [*(("a_home", side) for side in away(known, state)), ("a_confirm", name)]


# --- at a place -----------------------------------------------------------------------------------


def put_at_nothing(known: Known, state: str, name: str, where: str) -> Subtasks | None:
    """Only look at it where it stands there already, with empty hands at home: one may have left it
    leaning.
    """
    if holder := known.facts.holder(state, name):
        return known.unfit(fact(Kind.HOLDS, holder, name))
    if known.facts.at(state, name, where):
        how = known.facts.fallen(state, name)
        return known.unfit(how) if how else _home_and_look(known, state, name)
    return known.unfit(fact(Kind.STANDS_ELSEWHERE, name))


def put_at_held(known: Known, state: str, name: str, where: str) -> Subtasks | None:
    """Put it there with the hand that holds it, bring that one home, and look at it."""
    side = known.facts.holder(state, name)
    after = (("a_home", side), ("a_confirm", name))
    return (
        [("a_place", side, where), *after] if side else known.unfit(fact(Kind.NO_HAND_HOLDS, name))
    )


def put_at_with(known: Known, state: str, hand: Side, name: str, where: str) -> Subtasks | None:
    """Take it with this hand, if it is empty, and put it there."""
    if holder := known.facts.holder(state, name):
        return known.unfit(fact(Kind.HOLDS, holder, name))
    if held := known.facts.in_hand(state, hand):
        known.failed(fact(Kind.HOLDS, hand, held))
        return None
    return [("set_at", name, hand, where)]


def set_at_try(
    known: Known, state: str, number: str, name: str, hand: Side, where: str
) -> Subtasks | None:
    """Take it by some grasp, from which it can be put there: not every one leaves a way."""
    placed = [("a_place", hand, where), ("a_home", hand), ("a_confirm", name)]
    return [("a_take_to", name, hand, number, where), *placed]


# --- the step that takes it for a place -----------------------------------------------------------


def take_to(
    geometry: Geometry, state: str, name: str, side: Side, number: str, where: str
) -> Step | None:
    """The step that takes an object by a grasp by which it can be put there (see take and
    places).
    """
    if not reachable(geometry, state, name, side):
        return None
    for target in places(geometry, state, name, where):
        only = _grasps(geometry, state, name, side, number, target)
        step = (
            take(geometry, state, name, side, number, only=only) if only is None or only else None
        )
        if step is not None:
            return step
    return None


def _grasps(
    geometry: Geometry, state: str, name: str, side: Side, number: str, target: Inside | Surfaces
) -> frozenset[str] | None:
    """The grasps with which a thing can be put behind an opening; None for any, where it comes from
    above.
    """
    if isinstance(target, Surfaces):
        return None
    known = ways(preferred(geometry, state, name))
    found = inserted(geometry, geometry.at(state), side, name, target, known, number)
    if not found:
        geometry.failed(fact(Kind.NO_PLACE_REACHED_IN, side, name, target.opening.name))
    return frozenset(grasp for grasp, _ in found[:BEST])


PLAN = Plan(
    tasks={
        "put_down": (Argument.THING,),
        "stand": (Argument.THING,),
        "put_at": (Argument.THING, Argument.PLACE),
    },
    methods={
        "put_down": (put_down, each_hand(put_down_lying_with), "after_arms_home"),
        "stand": (put_down, stands, each_hand(put_down_lying_with), "after_arms_home"),
        "set_down": (set_down,),
        "put_at": (
            "after_opening",
            put_at_nothing,
            put_at_held,
            each_hand(put_at_with),
            "after_clearing",
            "after_arms_home",
        ),
        "set_at": (each_try(set_at_try),),
    },
    actions={"a_take_to": take_to, "a_place": place},
)

"""Planning to take a thing: with which hand, after what stands in the way was put aside; and to
carry it.
"""

from itertools import islice

from companion.languages import hfsm
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.planning.grasping import graspable, preferred, reachable, take
from companion.planning.methods import Known, Subtasks
from companion.planning.registry import Argument, Each, Plan, each_hand
from companion.planning.steps import Geometry, Step, moved
from velma.kinematics.tasks import LOADED_SPEED
from velma.kinematics.tasks.carrying import CARRY_TILT, carries

CLEARED = (1, 2)
"""Ranks of the things beside a wanted one that are put aside, 1 the nearest. Estimate: a try takes
seconds.
"""
CARRIES = 16  # estimate: found in 0.1 s


# --- with a hand that is free ---------------------------------------------------------------------


def take_nothing(known: Known, state: str, name: str, side: str) -> Subtasks | None:
    """Do nothing where the wanted hand holds it already."""
    holder = known.facts.holder(state, name)
    if holder is None:
        return known.unfit(fact(Kind.NO_HAND_HOLDS, name))
    if side not in ("", holder):
        return known.unfit(fact(Kind.HOLDS, holder, name), fact(Kind.OTHER_HAND_WANTED, side))
    return []


def take_over(known: Known, state: str, name: str, side: str) -> Subtasks | None:
    """Put down what the other hand holds, look at it, plan again."""
    holder = known.facts.holder(state, name)
    if holder is None:
        return known.unfit(fact(Kind.NO_HAND_HOLDS, name))
    if side in ("", holder):
        return known.unfit(fact(Kind.HOLDS, holder, name))
    return [("set_down", name), ("localize", name)]


def take_with(known: Known, state: str, hand: Side, name: str, side: str) -> Subtasks | None:
    """Take it with this hand, if it is empty and wanted."""
    if side not in ("", hand):
        return known.unfit(fact(Kind.OTHER_HAND_WANTED, side))
    if holder := known.facts.holder(state, name):
        return known.unfit(fact(Kind.HOLDS, holder, name))
    if held := known.facts.in_hand(state, hand):
        known.failed(fact(Kind.HOLDS, hand, held))
        return None
    return [("a_take", name, hand)]


# --- after something else was put aside -----------------------------------------------------------


def after_clearing(
    known: Known, state: str, number: int, task: str, name: str, *others: str
) -> Subtasks | None:
    """Put the n-th nearest thing beside the wanted one aside, then do the task."""
    if holder := known.facts.holder(state, name):
        return known.unfit(fact(Kind.HOLDS, holder, name))
    near = known.facts.beside(state, name)
    if len(near) < number:
        few = fact(Kind.FEWER_BESIDE, name, number) if near else fact(Kind.NOTHING_BESIDE, name)
        return known.unfit(few)
    return [("a_in_the_way", name, *near), ("put_aside", near[number - 1]), (task, name, *others)]


def in_the_way(geometry: Geometry, state: str, name: str, *others: str) -> bool:
    """Whether an empty hand can grasp a thing only when others are gone; the reason is noted if
    not.
    """
    for side in Side:
        here, known = geometry.at(state), preferred(geometry, state, name)
        if side in here.held or reachable(geometry, state, name, side):
            continue
        for other in others:
            here.world.remove(other)
        if graspable(geometry, here, side, name, known):
            return True
    geometry.unfit(fact(Kind.NOT_IN_THE_WAY))
    return False


def put_aside_with(known: Known, state: str, hand: Side, name: str) -> Subtasks | None:
    """Take it with this hand, if it is empty, put it down where there is room, and bring the hand
    home.
    """
    if held := known.facts.in_hand(state, hand):
        return known.unfit(fact(Kind.HOLDS, hand, held))
    return [("a_take", name, hand), ("a_place", hand), ("a_home", hand)]


# --- carried --------------------------------------------------------------------------------------


def carry(geometry: Geometry, state: str, side: Side) -> Step | None:
    """The step that carries the held object, upright, where other arm and torso have room."""
    here = geometry.at(state)
    held = here.held[side]
    postures = carries(
        geometry.robot, here.world, side, here.q, held.T_grip_object, geometry.rng("carry", side)
    )
    reached = geometry.free_motion(
        here, side, list(islice(postures, CARRIES)), largest_tilt=CARRY_TILT, tried=CARRIES
    )
    if reached is None:
        geometry.failed(fact(Kind.NO_WAY_CARRYING, side, held.object))
        return None
    return moved(hfsm.Step("carry", (held.object,)), side, reached[1], LOADED_SPEED)


PLAN = Plan(
    tasks={"take": (Argument.THING, Argument.SIDE)},
    methods={
        "take": (
            "after_opening",
            take_nothing,
            take_over,
            each_hand(take_with),
            "after_clearing",
            "after_arms_home",
        ),
        "put_aside": (each_hand(put_aside_with), "after_clearing"),
    },
    around={"after_clearing": Each(after_clearing, CLEARED)},
    actions={"a_take": take, "a_carry": carry},
    conditions={"a_in_the_way": in_the_way},
)

"""Planning to swap hands: what one hand holds is put down, and taken with the other."""

from companion.languages.facts import Kind, fact
from companion.planning.methods import OTHER, Known, Subtasks
from companion.planning.registry import Argument, Plan


def swap_hands(known: Known, state: str, name: str) -> Subtasks | None:
    """Put down what is held, look at it, take it with the other hand to where that one could put it
    down.
    """
    in_hands = {side: known.facts.in_hand(state, side) for side in OTHER}
    held = {side: thing for side, thing in in_hands.items() if thing and name in ("", thing)}
    if len(held) != 1:
        none = fact(Kind.NO_HAND_HOLDS, name) if name else fact(Kind.HANDS_EMPTY)
        known.failed(fact(Kind.HANDS_FULL) if held else none)
        return None
    ((side, thing),) = held.items()
    if other := known.facts.in_hand(state, OTHER[side]):
        known.failed(fact(Kind.HOLDS, OTHER[side], other))
        return None
    return [("set_down", thing), ("a_confirm", thing), ("hold_out", thing, OTHER[side])]


PLAN = Plan(tasks={"swap_hands": (Argument.THING,)}, methods={"swap_hands": (swap_hands,)})

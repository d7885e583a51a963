"""Orders of the operator about a plan: which acts wait for one, and what an order says (levels:
companion.autonomy).
"""

import msgspec

from agent_runtime.core.control import SetParameter
from agent_runtime.core.events import Ordered
from agent_runtime.core.turn import Turn
from companion import autonomy
from companion.autonomy import LEVEL, Verb
from companion.languages import hfsm
from companion.languages.facts import Kind, fact
from companion.languages.hfsm import Place
from services.task import plan as plans
from services.task.memory import Memory

# of a place: the ends of names, no longer step; a report must stay within 400 bytes
NAME_CHARS, STEP_BYTES = 40, 60
WANTED = (fact(Kind.OPERATOR_WANTS_A_PLAN),)


def asks(memory: Memory, turn: Turn, leaf: plans.Leaf) -> bool:
    """Whether a leaf waits for the operator at the present level; what makes a cancelled plan safe
    never does.
    """
    if memory.safe is not None or not isinstance(leaf, hfsm.ActState):
        return False
    return autonomy.asks(turn.parameter(LEVEL, str), type(leaf.command))


def replan_wanted(memory: Memory, turn: Turn) -> bool:
    """Whether this event is the operator's order to end the act under way, which is none of looking
    around.
    """
    if memory.act is None or memory.looking:
        return False
    return verb_about(turn, place(memory)) is Verb.REPLAN


def verb_about(turn: Turn, at: Place | None) -> Verb | None:
    """What the operator wants of this leaf, where the event is an order about it."""
    match turn.event:
        case Ordered(command=command) if (
            isinstance(command.order, SetParameter) and command.order.name == autonomy.STEP
        ):
            order = autonomy.read(str(command.order.value))
            here = at.id if at is not None else ""
            if order is not None and order.at == here:
                return order.verb
            turn.log(
                "word of the operator about another leaf", at=here, word=str(command.order.value)
            )
    return None


def place(memory: Memory) -> Place | None:
    """Where the leaf is that waits or is active, as co is told of it; None before the first one."""
    at = memory.asked or memory.at
    first = memory.safe or (plans.state_at(memory.machine, at[:1]) if at else None)
    if first is None:
        return None
    leaf = plans.leaf(memory.machine, at) if at else None
    command = leaf.command if isinstance(leaf, hfsm.ActState) else None
    path = (*((memory.safe.name,) if memory.safe else ()), *at)
    act = type(command).__name__ if command is not None else ""
    step = hfsm.step_of(first)
    short = step if len(msgspec.msgpack.encode(step)) <= STEP_BYTES else None
    return Place(
        tuple(name[-NAME_CHARS:] for name in path), short, act, getattr(command, "side", None)
    )

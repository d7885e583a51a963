"""Orders of the operator about a plan: which acts wait for one, and what an order says (levels: companion.autonomy)."""

from agent_runtime.core.control import SetParameter
from agent_runtime.core.events import Ordered
from agent_runtime.core.turn import Turn
from companion import autonomy
from companion.autonomy import ASKED, LEVEL, Verb
from companion.languages import hfsm
from companion.languages.facts import Kind, fact
from services.task import plan as plans
from services.task.memory import Memory

PATH_CHARS = 200  # a report must stay within its 400 bytes
WANTED = (fact(Kind.OPERATOR_WANTS_A_PLAN),)


def asks(memory: Memory, turn: Turn, leaf: plans.Leaf) -> bool:
    """Whether a leaf waits for the operator at the present level; what makes a cancelled plan safe never does."""
    level = turn.parameter(LEVEL, str)
    return memory.safe is None and isinstance(leaf, hfsm.ActState) and isinstance(leaf.command, ASKED[level])


def replan_wanted(memory: Memory, turn: Turn) -> bool:
    """Whether this event is the operator's word to end the act under way, which is none of looking around."""
    return memory.act is not None and not memory.looking and verb_about(turn, path(memory)) is Verb.REPLAN


def verb_about(turn: Turn, at: str) -> Verb | None:
    """Return what the operator wants of this leaf, where the event is a word about it."""
    match turn.event:
        case Ordered(command=command) if (
            isinstance(command.order, SetParameter) and command.order.name == autonomy.STEP
        ):
            word = autonomy.read(str(command.order.value))
            if word is not None and word.at == at:
                return word.verb
            turn.log("word of the operator about another leaf", at=at, word=str(command.order.value))
    return None


def path(memory: Memory) -> str:
    """Return the path of the leaf that waits or is active, as co is told of it."""
    at = memory.asked or memory.at
    return "/".join((*((memory.safe.name,) if memory.safe else ()), *at))[-PATH_CHARS:]
